"""Error over horizon on measured robots, and the motion loss beside the inverse one.

    python tests/studies/motion_horizons.py PROGRAM [pendulum double emps ur10e panda]

The pendulum's table is that of free decay: rows from 8 to 62 s fitted, 62 to 115 s held out, five
sets of friction effects, horizons by continuation up to T. Of the driven robots the table has the
simulated error at each horizon and the inverse loss' torque error of both models, held out.
"""

import argparse
import json
import tempfile
from pathlib import Path

from real_robots import DATA, MODELS, Bench, Json, print_values, read_rows, split, write_rows

LADDER = (1.0, 4.0, 12.0, 26.0, 54.0)
FRICTION = {
    "viscous": "viscous_friction",
    "viscous + Coulomb": "viscous_friction,coulomb_friction",
    "sublinear": "sublinear_friction",
    "Coulomb + quadratic": "coulomb_friction,quadratic_friction",
    "all three": "viscous_friction,coulomb_friction,quadratic_friction",
}


def between(path: Path, first: float, last: float, out: Path) -> Path:
    """Rows of a recording within a span of time."""
    return write_rows(out, [r for r in read_rows(path) if first <= float(r["time"]) < last])


def cell(result: Json) -> str:
    last = result["horizons"][-1]
    return f"{1e3 * last['train']:.3g} / {1e3 * last['test']:.3g}"


def pendulum(bench: Bench) -> None:
    data = DATA / "pendulum_free_swing" / "free_swing.csv"
    train = between(data, 8.0, 62.0, bench.folder / "swing_train.csv")
    test = between(data, 62.0, 115.0, bench.folder / "swing_test.csv")
    lines = []
    for name, effects in FRICTION.items():
        cells, found = [], []
        for horizon in LADDER:
            _, r = bench.run(
                f"Pendulum, {name}, horizon {horizon:g} s",
                "identify",
                MODELS / "pendulum.json",
                train,
                "--test",
                test,
                "--loss",
                "motion",
                "--horizon",
                horizon,
                "--effects",
                effects,
            )
            cells.append(cell(r))
            of_friction = [
                p for p in r["parameters"] if p["name"].startswith("pendulum.") and not p["fixed"]
            ]
            found.append("  ".join(f"{p['name'][9:]} {p['value']:.4g}" for p in of_friction))
            print(f"  {cells[-1]} mrad, {r['summary']['seconds']:.1f} s; {found[-1]}", flush=True)
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    print("\n| effects | " + " | ".join(f"T = {t:g} s" for t in LADDER) + " |")
    print("\n".join(lines))


def show(what: str, result: Json, key: str) -> None:
    for h in result["horizons"]:
        error = h[key] if h[key] is not None else float("nan")
        print(f"  {what}: T {h['horizon']:6.2f} s  {h['joint']:<22} held out {1e3 * error:9.3f}")


def beside(
    bench: Bench,
    title: str,
    model: Path,
    train: list[Path],
    test: list[Path],
    effects: str,
    horizon: float,
) -> None:
    """Both losses on one split: simulated error by horizon, torque error of both models.

    A model is judged by the other loss as its model before the fit.
    """
    data = [*train, "--test", *test]
    by_motion = ["--loss", "motion", "--horizon", horizon]
    held = ["--effects", "none", "--fit", "inertia"]
    run, motion = bench.run(
        f"{title}, motion loss", "identify", model, *data, *by_motion, "--effects", effects
    )
    show("motion", motion, "test")
    print(f"  {motion['summary']['seconds']:.1f} s; {motion['summary']['termination']}")
    for note in motion["notes"]:
        if "apart" in note or "noise of" in note:
            print(f"  {note}")
    other, inverse = bench.run(
        f"{title}, inverse loss", "identify", model, *data, "--effects", effects
    )
    _, simulated = bench.run(
        f"{title}, the inverse loss' model simulated",
        "identify",
        other / "model.json",
        *data,
        *by_motion,
        *held,
    )
    show("inverse", simulated, "nominal_test")
    _, judged = bench.run(
        f"{title}, torques of the motion loss' model", "identify", run / "model.json", *data, *held
    )
    print_values("torque held out, inverse", inverse["rmse"]["test"], 1, ".4g")
    print_values("torque held out, motion", judged["rmse"]["nominal_test"], 1, ".4g")
    print_values("torque itself", inverse["rmse"]["torque_rms"], 1, ".4g")


def double(bench: Bench) -> None:
    d = DATA / "double_pendulum"
    beside(
        bench,
        "Double pendulum",
        MODELS / "double_pendulum.urdf",
        [d / f"record_0{k}.csv" for k in range(5)],
        [d / f"record_{k}.csv" for k in ("05", "11", "12", "13")],
        "viscous_friction,coulomb_friction,armature",
        0.4,
    )


def emps(bench: Bench) -> None:
    d = DATA / "emps"
    beside(
        bench,
        "EMPS",
        MODELS / "emps.urdf",
        [d / "train.csv"],
        [d / "test.csv"],
        "asymmetric_viscous,coulomb_friction,torque_offset",
        0.0,
    )


def ur10e(bench: Bench) -> None:
    d = DATA / "ur10e"
    beside(
        bench,
        "UR10e",
        d / "ur10e.urdf",
        [d / "id_50s_12harm.csv"],
        [d / "val_ptp_10_points.csv"],
        "armature,viscous_friction,coulomb_friction,torque_offset",
        0.24,
    )


def panda(bench: Bench) -> None:
    first, rest = split(DATA / "panda" / "exciting.csv", 0.6, bench.folder)
    for path in (first, rest):
        path.with_suffix(".json").write_text(
            json.dumps({"schema": "diffnea/recording/1", "torque_side": "link"})
        )
    beside(
        bench,
        "Panda, first 60 % fitted",
        MODELS / "panda.urdf",
        [first],
        [rest],
        "armature,viscous_friction,coulomb_friction,torque_offset",
        0.24,
    )


ROBOTS = {"pendulum": pendulum, "double": double, "emps": emps, "ur10e": ur10e, "panda": panda}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program", type=Path, help="the command diffnea")
    parser.add_argument("robots", nargs="*", choices=[*ROBOTS, []], default=list(ROBOTS))
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for robot in arguments.robots or ROBOTS:
            ROBOTS[robot](Bench(arguments.program.resolve(), Path(folder)))


if __name__ == "__main__":
    main()
