# ruff: noqa: E501
"""The recordings that the identifications are compared on."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from signals import Signals, read_signals

SOURCE = Path(__file__).resolve().parents[3]
MODELS = SOURCE / "models"
DATA = Path(os.environ.get("DIFFNEA_DATA", SOURCE.parent / "shared" / "data"))


@dataclass(frozen=True)
class Case:
    """A robot's description, a recording to fit and one that is held out."""

    name: str
    title: str
    model: str
    joints: list[str]
    train: str
    test: str
    cutoff: float  # of the low-pass that all signals go through [Hz]
    held: bool  # a row's torque acts until the next row
    torque_side: str
    truth: str = ""  # of a simulated robot: what was drawn

    def signals(self, which: str) -> Signals:
        return read_signals(Path(getattr(self, which)), self.joints, self.cutoff, self.held)

    def save(self, folder: Path) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "case.json"
        path.write_text(json.dumps(self.__dict__, indent=1), encoding="utf-8")
        return path


def load_case(path: Path) -> Case:
    return Case(**json.loads(path.read_text(encoding="utf-8")))


def without_shapes(model: Path, folder: Path) -> Path:
    """A copy without geometry: meshes are not there, and Pinocchio refuses a capsule with pos and fromto."""
    tree = ElementTree.parse(model)
    for parent in tree.iter():
        for child in list(parent):
            if child.tag in ("geom", "visual", "collision"):
                parent.remove(child)
    folder.mkdir(parents=True, exist_ok=True)
    out = folder / model.name
    tree.write(out)
    return out


def split(path: Path, share: float, folder: Path) -> tuple[Path, Path]:
    """The first rows and the rest, as two files."""
    lines = path.read_text(encoding="utf-8").splitlines()
    cut = 1 + int(share * (len(lines) - 1))
    out = folder / "train.csv", folder / "test.csv"
    out[0].write_text("\n".join(lines[:cut]) + "\n", encoding="utf-8")
    out[1].write_text("\n".join([lines[0], *lines[cut:]]) + "\n", encoding="utf-8")
    return out


def simulated_wam(command: str, folder: Path) -> Case:
    """A WAM that its model does not know, in MuJoCo: surrogate A, sensor noise, 20 s each."""
    folder.mkdir(parents=True, exist_ok=True)
    model = MODELS / "wam4.xml"
    for name, seed in (("train", 1), ("test", 2)):
        motion, out = folder / f"{name}_motion.csv", folder / f"{name}.csv"
        if out.is_file():
            continue
        for words in (
            ["excite", model, "--duration", 20, "--seed", seed, "-o", motion],
            [
                *("simulate", model, "--trajectory", motion, "--seed", seed, "-o", out),
                *("--world", "mujoco:wam4,perturb=A,seed=5", "--truth", folder / "truth.json"),
            ],
        ):
            subprocess.run([command, *map(str, words)], check=True, stdout=subprocess.DEVNULL)
    return Case(
        name="wam4",
        title="WAM, 4 joints, simulated (MuJoCo, surrogate A), 500 Hz, 20 s",
        model=str(without_shapes(model, folder)),
        joints=[f"joint{k}" for k in range(1, 5)],
        train=str(folder / "train.csv"),
        test=str(folder / "test.csv"),
        cutoff=10.0,
        held=True,
        torque_side="motor",
        truth=str(folder / "truth.json"),
    )


def panda(folder: Path) -> Case:
    folder.mkdir(parents=True, exist_ok=True)
    train, test = split(DATA / "panda" / "exciting.csv", 0.6, folder)
    return Case(
        name="panda",
        title="Panda, 7 joints, measured, 1 kHz, 12.6 s; the other 8.4 s held out",
        model=str(without_shapes(MODELS / "panda.urdf", folder)),
        joints=[f"panda_joint{k}" for k in range(1, 8)],
        train=str(train),
        test=str(test),
        cutoff=10.0,
        held=False,
        torque_side="link",
    )


def ur10e(folder: Path) -> Case:
    data = DATA / "ur10e"
    names = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    return Case(
        name="ur10e",
        title="UR10e, 6 joints, measured, 100 Hz, 58 s; point to point held out",
        model=str(without_shapes(data / "ur10e.urdf", folder)),
        joints=[f"{n}_joint" for n in names],
        train=str(data / "id_50s_12harm.csv"),
        test=str(data / "val_ptp_10_points.csv"),
        cutoff=8.0,
        held=True,
        torque_side="motor",
    )


def emps(folder: Path) -> Case:
    return Case(
        name="emps",
        title="EMPS, one drive, measured, 1 kHz, 25 s; with force pulses held out",
        model=str(without_shapes(MODELS / "emps.urdf", folder)),
        joints=["carriage"],
        train=str(DATA / "emps" / "train.csv"),
        test=str(DATA / "emps" / "test.csv"),
        cutoff=50.0,
        held=True,
        torque_side="motor",
    )


def make_cases(command: str, folder: Path, names: list[str]) -> list[Case]:
    """All that can be had: measured recordings only where their folder is."""
    makers = {"panda": panda, "ur10e": ur10e, "emps": emps}
    out = [simulated_wam(command, folder / "wam4")] if "wam4" in names else []
    for name in names:
        if name in makers:
            if (DATA / name).is_dir():
                out.append(makers[name](folder / name))
            else:
                print(f"{name}: no measured recordings at {DATA}; DIFFNEA_DATA may name the folder")
    for case in out:
        case.save(folder / case.name)
    return out
