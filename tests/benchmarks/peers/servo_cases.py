# ruff: noqa: E501
"""Pendulums behind position servos: commands and positions, no torque. What all servo fits are given.

`bam_xl330` and `kscale_sts3215_12v` are measured benches, split as their READMEs say; `simulated` has a known truth.
`DIFFNEA_DATA` names the folder of the measured ones; `cases` beside it holds the simulated one.
"""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from cases import DATA, SOURCE
from servo_pendulum import Law, Pendulum, Run

sys.path.insert(0, str(SOURCE / "tests" / "studies"))
from servo_benches import ARM, recordings

CASES = DATA.parent / "cases"
STEP = 0.005  # s, to which BAM's own tools resample their logs
# The load of kscale's lightest and heaviest runs, 32 of 80 for the fit: the peers' hours stay minutes.
KSCALE_LOADS = ("0.535", "1.168")


@dataclass(frozen=True)
class ServoCase:
    """Runs to fit and runs held out, and what the servo's data sheet says: where the peers begin."""

    name: str
    title: str
    model: str
    train: list[str]
    held_out: dict[str, list[str]]
    stall: float  # N·m at full duty
    speed: float  # rad/s without load
    reach: float  # error times gain at full duty [rad]
    gain: float  # a typical gain: the peers' stiffness is scaled to it
    setpoint: bool  # the drive limits the speed of its setpoint
    pendulum: Pendulum | None = None  # the load of all runs; None: see each run's sidecar
    truth: dict[str, float] | None = None  # known parameters of a simulated servo

    def runs(self, files: list[str]) -> list[Run]:
        return [read_run(Path(f), self.pendulum) for f in files]

    def start(self) -> tuple[Law, Law, Law]:
        """Start, lower and upper bounds: a factor of ten about the data sheet, of the delay a row early to BAM's 50 ms."""
        brake = self.stall / self.speed
        load = float(np.mean([r.pendulum.inertia for r in self.runs(self.train)]))
        free = np.inf if not self.setpoint else self.speed
        return (
            Law(self.stall / self.reach, self.reach, brake, 0.05 * brake, 0.05 * self.stall, load, 0.0, 0.01, free),
            Law(0.1 * self.stall / self.reach, 0.1 * self.reach, 0.0, 0.0, 0.0, 0.01 * load, -0.1 * self.stall, -STEP, 0.1 * free),
            Law(10.0 * self.stall / self.reach, 10.0 * self.reach, 10.0 * brake, 2.0 * brake, 0.5 * self.stall, 10.0 * load, 0.1 * self.stall, 0.05, 10.0 * free),
        )  # fmt: skip

    def save(self, folder: Path) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "case.json"
        path.write_text(json.dumps(asdict(self), indent=1), encoding="utf-8")
        return path


def load_servo_case(path: Path) -> ServoCase:
    case = json.loads(path.read_text(encoding="utf-8"))
    case["pendulum"] = case["pendulum"] and Pendulum(**case["pendulum"])
    return ServoCase(**case)


def one_run_each(path: Path, folder: Path) -> list[str]:
    """A file a run, by the column `run`."""
    folder.mkdir(parents=True, exist_ok=True)
    with path.open(encoding="utf-8") as f:
        rows = list(csv.DictReader(f))
    out = []
    for run in dict.fromkeys(r["run"] for r in rows):
        name = folder / f"{path.stem}_{run}.csv"
        with name.open("w", newline="", encoding="utf-8") as f:
            table = csv.DictWriter(f, ["time", "q_servo", "qcmd_servo"], extrasaction="ignore")
            table.writeheader()
            table.writerows(r for r in rows if r["run"] == run)
        out.append(str(name))
    return out


def read_run(path: Path, pendulum: Pendulum | None) -> Run:
    """A recording with its sidecar; reads that are missing stay out, and so does their time."""
    with path.open(encoding="utf-8") as f:
        rows = list(csv.DictReader(f))
    sidecar = Path(f"{path}.json")
    about = json.loads(sidecar.read_text(encoding="utf-8")) if sidecar.is_file() else {}
    if body := about.get("payload"):
        mass, length = body["mass"], -body["com"][2]
        pendulum = Pendulum(mass, length, body["about_com"][0])
    if pendulum is None:
        raise SystemExit(f"{path}: no pendulum: expected a payload in {sidecar.name}")
    time = np.array([float(r["time"]) for r in rows])
    q = np.array([float(r["q_servo"] or "nan") for r in rows])
    return Run(
        name=path.stem,
        time=time - time[0],
        command=np.array([float(r["qcmd_servo"]) for r in rows]),
        on=np.array([float(r.get("torque_enable", 1)) for r in rows]),
        q=q,
        gain=float(about.get("controller", {}).get("servo", {}).get("gain", 1.0)),
        pendulum=pendulum,
    )


def simulated(folder: Path) -> ServoCase:
    source = CASES / "servo_bench_simulated"
    truth = json.loads((source / "truth.json").read_text(encoding="utf-8"))
    # The load of its bench.urdf.
    body = Pendulum(mass=0.587, length=0.103211, about_com=7.162e-5)
    return ServoCase(
        name="simulated",
        title="simulated bench (BAM's conventions), 2 runs of 6 s; one held out",
        model=str(source / "bench.urdf"),
        train=one_run_each(source / "train.csv", folder),
        held_out={"test": one_run_each(source / "test.csv", folder)},
        stall=3.3,
        speed=6.0,
        reach=0.3,  # a guess: its description says nothing
        gain=1.0,
        setpoint=False,
        pendulum=body,
        truth={
            "stiffness": truth["keff"],
            "damping": truth["damping_total"],
            "coulomb": truth["coulomb"],
            "armature": truth["armature"],
        },
    )


def measured(name: str, folder: Path) -> ServoCase:
    splits = recordings(name, folder)
    model = folder / "bench.urdf"
    model.write_text(ARM, encoding="utf-8")
    if name == "kscale_sts3215_12v":
        splits = {
            split: [f for f in files if f.name.startswith(tuple(f"m{m}" for m in KSCALE_LOADS)) and f.stem.endswith("r1")]
            for split, files in splits.items()
        }  # fmt: skip
    files = {split: [str(f) for f in found] for split, found in splits.items()}
    counts = ", ".join(f"{len(files[split])} {split}" for split in ("val", "test"))
    # Data sheets: XL330-M288-T at 5 V, times 7.4 / 5; STS3215 at 12 V. Duties as the data's READMEs give them.
    sheet = {
        "bam_xl330": (0.77, 16.0, 885 * 256 * 2 * np.pi / 4096, 400.0),
        "kscale_sts3215_12v": (2.94, 4.7, 1.0 / 0.16489, 16.0),
    }
    stall, speed, reach, gain = sheet[name]
    return ServoCase(
        name=name,
        title=f"{name}, {len(files['train'])} runs of 6 s; held out {counts}",
        model=str(model),
        train=files["train"],
        held_out={split: files[split] for split in ("val", "test")},
        stall=stall,
        speed=speed,
        reach=float(reach),
        gain=gain,
        setpoint=name == "kscale_sts3215_12v",
    )


def make_servo_cases(folder: Path, names: list[str]) -> list[ServoCase]:
    """All that can be had."""
    out = []
    for name in names:
        source = CASES / "servo_bench_simulated" if name == "simulated" else DATA / name
        if source.is_dir():
            out.append(
                simulated(folder / name) if name == "simulated" else measured(name, folder / name)
            )
        else:
            print(
                f"{name}: no recordings at {source}; DIFFNEA_DATA may name the folder of the measured ones"
            )
    for case in out:
        case.save(folder / case.name)
    return out
