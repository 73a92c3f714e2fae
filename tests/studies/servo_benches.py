"""Servos on benches that others measured, from commands and positions alone.

    python tests/studies/servo_benches.py PROGRAM SERVO_RUNS

PROGRAM is the command diffnea, SERVO_RUNS the study of that name beside this file. A drive is fitted
to the training runs; then whole runs of each split are simulated in closed loop from their first
state, never reset. The figure is the mean over runs of the mean absolute error.
"""

import argparse
import json
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path

from real_robots import DATA, Bench, Json, Row, read_rows, write_rows

CORPUS = DATA.parent / "corpus"

GRAVITY = 9.81  # [m/s²]
# A read that is this far from its neighbours, which agree, is of no motion [rad].
SPIKE = 0.1

ARM = """<robot name="bench"><link name="base"/>
<link name="arm"><inertial><origin xyz="0 0 0"/><mass value="1e-4"/>
<inertia ixx="1e-7" iyy="1e-7" izz="1e-7" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="servo" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 -1 0"/>
<limit lower="-3.14" upper="3.14" effort="3.3" velocity="9"/></joint></robot>
"""

# The carriage of the EMPS, of less than its mass: a rotor has the rest.
SCREW = """<mujoco model="emps"><worldbody><body name="carriage">
<joint name="x" type="slide" axis="1 0 0" range="-0.01 0.4"/>
<inertial pos="0 0 0" mass="50" diaginertia="1 1 1"/></body></worldbody></mujoco>
"""
FORCE = 35.15065  # [N/V]
LOOP = (243.45, 160.18)  # published gains of its velocity [V s/m] and of its position [1/s]

ARM_JOINTS = ("Rotation", "Pitch", "Elbow", "Wrist_Pitch", "Wrist_Roll")

SETS = {
    "dry friction": "position_servo,armature,viscous_friction,coulomb_friction,torque_offset",
    "and of the load": "position_servo,armature,viscous_friction,coulomb_friction,torque_offset,"
    "load_friction",
    "and of the supply": "position_servo,armature,viscous_friction,coulomb_friction,torque_offset,"
    "load_friction,supply_sag",
}


def without_spikes(rows: list[Row]) -> list[Row]:
    """Rows of what a drive tells; single reads that jump are left empty."""
    q = [float(r["q_servo"]) for r in rows]
    for k in range(1, len(q) - 1):
        off = abs(q[k] - 0.5 * (q[k - 1] + q[k + 1]))
        if off > SPIKE and abs(q[k + 1] - q[k - 1]) < 0.5 * off:
            q[k] = float("nan")
    names = ("time", "q_servo", "qcmd_servo", "torque_enable", "voltage")
    out = [{name: r[name] for name in names} for r in rows]
    for row, value in zip(out, q, strict=True):
        row["q_servo"] = "" if value != value else value
    return out


def kscale(run: Row) -> tuple[float, float, float]:
    """Mass, length of the arm and inertia about its own center; the arm included."""
    mass = float(run["mass_kg"])
    length = float(run["mgl_Nm"]) / (GRAVITY * mass)
    return mass, length, float(run["inertia_total_kgm2"]) - mass * length * length


def bam(run: Row) -> tuple[float, float, float]:
    """The same; the data know a point mass."""
    return float(run["mass_kg"]), float(run["length_m"]), 0.0


BENCHES = {"kscale_sts3215_12v": kscale, "bam_xl330": bam}


def recordings(bench: str, folder: Path) -> dict[str, list[Path]]:
    """The runs of each split, with the gain of their drive and what it carries as sidecars."""
    splits: dict[str, list[Path]] = {}
    for run in read_rows(DATA / bench / "index.csv"):
        source = DATA / bench / run["file"]
        mass, length, inertia = BENCHES[bench](run)
        about = max(inertia, 1e-7)
        body = {
            "name": f"{run['mass_kg']} kg at {run['length_m']} m",
            "where": "servo",
            "mass": mass,
            "com": [0.0, 0.0, -length],
            "about_com": [about, 0.0, 0.0, about, 0.0, 1e-7],
        }
        split = folder / bench / run["split"]
        split.mkdir(parents=True, exist_ok=True)
        out = write_rows(split / source.name, without_spikes(read_rows(source)))
        sidecar = {
            "schema": "diffnea/recording/1",
            "payload": body,
            "controller": {"servo": {"gain": float(run["kp"])}},
        }
        Path(f"{out}.json").write_text(json.dumps(sidecar), encoding="utf-8")
        splits.setdefault(run["split"], []).append(out)
    return splits


def arm_runs(data: str, folder: Path, joints: Iterable[str]) -> dict[str, list[Path]]:
    """Commands and positions of these joints, of the motions that are kept."""
    names = ("time", *(f"{series}_{joint}" for joint in joints for series in ("qcmd", "q")))
    splits: dict[str, list[Path]] = {}
    for row in read_rows(DATA / data / "index.csv"):
        if row["kept"] != "True":
            continue
        source = DATA / data / "runs" / f"{row['motion']}.csv"
        out = folder / data / source.name
        out.parent.mkdir(exist_ok=True)
        rows = [{name: r[name] for name in names} for r in read_rows(source)]
        splits.setdefault(row["split"], []).append(write_rows(out, rows))
    return splits


def mean_errors(servo_runs: Path, model: Path, runs: Iterable[Path]) -> str:
    """Mean absolute errors of whole runs, joint by joint [mrad] or [mm]."""
    words = [servo_runs, model, *runs]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1].partition(" mean")[0].strip()


def print_fit(
    args: argparse.Namespace, title: str, fit: tuple[Path, Json], splits: dict[str, list[Path]]
) -> None:
    run, result = fit
    print(f"  {title}")
    for p in result["parameters"]:
        if p["std"]:
            print(f"  {p['name']:<40} {p['value']:.5g} ± {p['std']:.2g} {p['unit']}")
    for split, runs in splits.items():
        print(f"  mean abs, {split}: {mean_errors(args.servo_runs, run / 'model.json', runs)}")
    print(
        f"  {result['summary']['seconds']:.0f} s, {result['summary']['termination']}", flush=True
    )


def benches(args: argparse.Namespace, bench: Bench, data: str) -> None:
    """Fit a pendulum on a servo, with friction of several kinds."""
    model = bench.folder / "bench.urdf"
    model.write_text(ARM, encoding="utf-8")
    splits = recordings(data, bench.folder)
    train = splits["train"][:: args.every]
    for title, effects in SETS.items():
        fit = bench.run(f"{data}, {title}", "identify", model, *train, "--effects", effects)
        print_fit(args, title, fit, splits)


def arm(args: argparse.Namespace, bench: Bench, data: str) -> None:
    """Fit the five servos of an SO-101, with the description of MuJoCo Menagerie."""
    model = CORPUS / "menagerie_xml" / "trs_so_arm100" / "so_arm100.xml"
    splits = arm_runs(data, bench.folder, ARM_JOINTS)
    train = splits["train"][:: args.every]
    for title, more in {"dry friction": "", "and of the load": ",load_friction"}.items():
        effects = "position_servo,armature,coulomb_friction,torque_offset" + more
        words = (model, *train, "--lock", "Jaw", "--effects", effects)
        fit = bench.run(f"{data}, {title}", "identify", *words)
        print_fit(args, ", ".join(ARM_JOINTS), fit, splits)


def screw(args: argparse.Namespace, bench: Bench, data: str) -> None:
    """Fit the EMPS by its commands; the drive's gain is known, the pulses are torques it is told."""
    model = bench.folder / "emps.xml"
    model.write_text(SCREW, encoding="utf-8")
    splits = {}
    for split, name in {"train": "DATA_EMPS", "test": "DATA_EMPS_PULSES"}.items():
        rows = [
            {
                "time": r["time"],
                "qcmd_x": r["qcmd_x"],
                "q_x": r["q_x"],
                "taucmd_x": FORCE * float(r.get("pulse_volt", 0.0)),
            }
            for r in read_rows(DATA / data / "runs" / f"{name}.csv")
        ]
        splits[split] = [write_rows(bench.folder / f"{name}.csv", rows)]
    gain = f"x.position_servo.stiffness={FORCE * LOOP[0] * LOOP[1]:.8g}"
    fit = bench.run(data, "identify", model, *splits["train"], "--fix", gain)
    print_fit(args, "the gain of the published law", fit, splits)


STUDIES = {
    "kscale_sts3215_12v": benches,
    "bam_xl330": benches,
    "sage_so101": arm,
    "emps_closed_loop": screw,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("program", type=Path, help="the command diffnea")
    parser.add_argument("servo_runs", type=Path, help="the study that simulates whole runs")
    parser.add_argument("--every", type=int, default=1, help="fit every so manyth training run")
    parser.add_argument("--only", choices=STUDIES, nargs="+", default=list(STUDIES))
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        bench = Bench(args.program, Path(name))
        for data in args.only:
            STUDIES[data](args, bench, data)


if __name__ == "__main__":
    main()
