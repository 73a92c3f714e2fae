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

from real_robots import DATA, Bench, Row, read_rows, write_rows

GRAVITY = 9.81  # [m/s²]
# A read that is this far from its neighbours, which agree, is of no motion [rad].
SPIKE = 0.1

ARM = """<robot name="bench"><link name="base"/>
<link name="arm"><inertial><origin xyz="0 0 0"/><mass value="1e-4"/>
<inertia ixx="1e-7" iyy="1e-7" izz="1e-7" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="servo" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 -1 0"/>
<limit lower="-3.14" upper="3.14" effort="3.3" velocity="9"/></joint></robot>
"""

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


def mean_error(servo_runs: Path, model: Path, runs: Iterable[Path]) -> float:
    """Mean absolute error of whole runs [mrad]."""
    words = [servo_runs, model, *runs]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    return float(done.stdout.splitlines()[-1].split()[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("program", type=Path, help="the command diffnea")
    parser.add_argument("servo_runs", type=Path, help="the study that simulates whole runs")
    parser.add_argument("--every", type=int, default=1, help="fit every so manyth training run")
    parser.add_argument("--only", choices=BENCHES, nargs="+", default=list(BENCHES))
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = folder / "bench.urdf"
        model.write_text(ARM, encoding="utf-8")
        bench = Bench(args.program, folder)
        for data in args.only:
            splits = recordings(data, folder)
            for title, effects in SETS.items():
                run, result = bench.run(
                    f"{data}, {title}",
                    "identify",
                    model,
                    *splits["train"][:: args.every],
                    "--effects",
                    effects,
                )
                for p in result["parameters"]:
                    if p["std"]:
                        print(f"  {p['name']:<40} {p['value']:.5g} ± {p['std']:.2g} {p['unit']}")
                errors = (
                    f"{split} {mean_error(args.servo_runs, run / 'model.json', runs):.1f}"
                    for split, runs in splits.items()
                )
                print(f"  mean absolute error [mrad]: {', '.join(errors)}", flush=True)
                print(f"  {result['summary']['seconds']:.0f} s, {result['summary']['termination']}")


if __name__ == "__main__":
    main()
