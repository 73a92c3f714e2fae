# ruff: noqa: E501
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

from real_robots import DATA, MODELS, Bench, Json, read_rows, split, write_rows

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
                p
                for p in r["parameters"]
                if p["name"].startswith("pendulum.") and not p["fixed"]
            ]
            found.append("  ".join(f"{p['name'][9:]} {p['value']:.4g}" for p in of_friction))
            print(f"  {cells[-1]} mrad, {r['summary']['seconds']:.1f} s; {found[-1]}", flush=True)
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    print("\n| effects | " + " | ".join(f"T = {t:g} s" for t in LADDER) + " |")
    print("\n".join(lines))


def beside(
    bench: Bench, title: str, model: Path, train: list[Path], test: list[Path], *options: object
) -> None:
    """Both losses on one split: simulated error by horizon, torque error of both models."""
    data = [*train, "--test", *test]
    run, motion = bench.run(
        f"{title}, motion loss", "identify", model, *data, "--loss", "motion", *options
    )
    for h in motion["horizons"]:
        print(
            f"  T {h['horizon']:6.2f} s  {h['joint']:<22} train {1e3 * h['train']:9.3f}"
            f"  held out {1e3 * h['test']:9.3f}  before {1e3 * (h['nominal_test'] or float('nan')):9.3f}"
            f"  apart {h['test_apart']} of {h['test_windows']}"
        )
    print(f"  {motion['summary']['seconds']:.1f} s; {motion['summary']['termination']}")
    for note in motion["notes"]:
        if "apart" in note or "noise of" in note:
            print(f"  {note}")
    inverse_options = [o for k, o in enumerate(options) if "--horizon" not in options[max(k - 1, 0) : k + 1]]
    other, inverse = bench.run(f"{title}, inverse loss", "identify", model, *data, *inverse_options)
    torque = lambda r, which: {j: r["rmse"][which][j] for j in r["rmse"][which]}  # noqa: E731
    print(f"  torque error held out, inverse: {torque(inverse, 'test')}")
    # The model that the motion loss found, judged as the inverse loss is: everything held.
    _, judged = bench.run(
        f"{title}, torque error of the model of the motion loss",
        "identify",
        run / "model.json",
        *data,
        "--effects",
        "none",
        *[o for o in inverse_options if o not in ("--effects", *_effects_of(inverse_options))],
    )
    print(f"  torque error held out, motion:  {torque(judged, 'nominal_test')}")
    _, simulated = bench.run(
        f"{title}, simulated error of the model of the inverse loss",
        "identify",
        other / "model.json",
        *data,
        "--loss",
        "motion",
        "--effects",
        "none",
        *[o for o in options if o not in ("--effects", *_effects_of(options))],
    )
    for h in simulated["horizons"]:
        print(
            f"  T {h['horizon']:6.2f} s  {h['joint']:<22} held out, inverse {1e3 * (h['nominal_test'] or float('nan')):9.3f}"
        )


def _effects_of(options: tuple[object, ...] | list[object]) -> list[object]:
    return [options[k + 1] for k, o in enumerate(options[:-1]) if o == "--effects"]


def double(bench: Bench) -> None:
    d = DATA / "double_pendulum"
    beside(
        bench,
        "Double pendulum",
        MODELS / "double_pendulum.urdf",
        [d / f"record_0{k}.csv" for k in range(5)],
        [d / f"record_{k}.csv" for k in ("05", "11", "12", "13")],
        "--horizon",
        0.4,
        "--effects",
        "viscous_friction,coulomb_friction,armature",
    )


def emps(bench: Bench) -> None:
    d = DATA / "emps"
    beside(
        bench,
        "EMPS",
        MODELS / "emps.urdf",
        [d / "train.csv"],
        [d / "test.csv"],
        "--effects",
        "asymmetric_viscous,coulomb_friction,torque_offset",
    )


def ur10e(bench: Bench) -> None:
    d = DATA / "ur10e"
    beside(
        bench,
        "UR10e",
        d / "ur10e.urdf",
        [d / "id_50s_12harm.csv"],
        [d / "val_ptp_10_points.csv"],
        "--effects",
        "armature,viscous_friction,coulomb_friction,torque_offset",
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
        "--effects",
        "armature,viscous_friction,coulomb_friction,torque_offset",
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
