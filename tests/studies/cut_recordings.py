# ruff: noqa: E501
"""Cut the measured recordings as users would have them, and print what `diagnose` says of each.

    python tests/studies/cut_recordings.py PROGRAM [emps pendulum double_pendulum ur10e]

A third of a recording, every so many rows of it, runs of 0.6 s, torques with gaps or of every tenth
row, and the pendulum's large swings beside its small ones. Printed are the first two sentences and
the seconds. Recordings as in real_data.py.
"""

import argparse
import random
import tempfile
from pathlib import Path

from real_robots import DATA, MODELS, Bench, Row, read_rows, robots_asked_for, write_rows


def third(rows: list[Row]) -> list[Row]:
    return rows[: len(rows) // 3]


def short_runs(rows: list[Row], size: int) -> list[Row]:
    """Runs of so many rows; the last one goes if it is shorter."""
    return [{"run": i // size, **row} for i, row in enumerate(rows[: len(rows) // size * size])]


def torque_gaps(rows: list[Row]) -> list[Row]:
    """No torque in 100 rows of every 1000."""
    rng = random.Random(1)
    out = [dict(row) for row in rows]
    for begin in range(0, len(out), 1000):
        first = begin + rng.randrange(800)
        for row in out[first : first + 100]:
            row.update({column: "" for column in row if column.startswith("tau_")})
    return out


def slow_torque(rows: list[Row]) -> list[Row]:
    return [
        row if i % 10 == 0 else {c: "" if c.startswith("tau_") else v for c, v in row.items()}
        for i, row in enumerate(rows)
    ]


def between(rows: list[Row], begin: float, end: float) -> list[Row]:
    return [row for row in rows if begin <= float(row["time"]) <= end]


def say(
    bench: Bench, title: str, model: Path, train: list[Row], test: list[Row] | Path | None = None
) -> None:
    files: list[object] = [write_rows(bench.folder / "train.csv", train)]
    if test:
        held = test if isinstance(test, Path) else write_rows(bench.folder / "test.csv", test)
        files += ["--test", held]
    run = bench.folder / f"run_{len(list(bench.folder.glob('run_*')))}"
    run.mkdir()  # a refusal leaves none
    try:
        _, result = bench.run(title, "diagnose", model, *files)
    except FileNotFoundError:
        return  # a refusal has been printed
    gain, seconds = result["gain"], result["summary"]["seconds"]
    print(f"  {result['verdict']}: {'. '.join(result['sentence'].split('. ')[:2])}")
    print(f"  held out {gain['test_rmse_before']:.3g} -> {gain['test_rmse_after']:.3g}; {seconds:.1f} s")


def emps(bench: Bench) -> None:
    model, test = MODELS / "emps.urdf", DATA / "emps" / "test.csv"
    rows, held = read_rows(DATA / "emps" / "train.csv"), read_rows(test)
    say(bench, "EMPS, the first third", model, third(rows))
    say(bench, "EMPS, 100 Hz", model, rows[::10], held[::10])
    say(bench, "EMPS, 20 Hz", model, rows[::50], held[::50])
    say(bench, "EMPS, runs of 0.6 s", model, short_runs(rows, 600), short_runs(held, 600))
    say(bench, "EMPS, gaps of 0.1 s in the torque", model, torque_gaps(rows), test)
    say(bench, "EMPS, a torque in every tenth row", model, slow_torque(rows), test)


def pendulum(bench: Bench) -> None:
    model = MODELS / "pendulum.json"
    rows = read_rows(DATA / "pendulum_free_swing" / "free_swing.csv")
    swinging = between(rows, 8.0, 115.0)
    small = between(rows, 62.0, 115.0)
    say(bench, "Pendulum, 20 Hz", model, swinging[::12])
    say(bench, "Pendulum, runs of 0.6 s", model, short_runs(swinging, 150))
    for end in (28.0, 43.7, 62.0):
        say(bench, f"Pendulum, 8 to {end:g} s", model, between(rows, 8.0, end))
        title = f"Pendulum, 8 to {end:g} s → 62 to 115 s"
        say(bench, title, model, between(rows, 8.0, end), small)


def double_pendulum(bench: Bench) -> None:
    model, rows = MODELS / "double_pendulum.urdf", read_rows(DATA / "double_pendulum" / "record_00.csv")
    say(bench, "Double pendulum, a third of one recording", model, third(rows))
    say(bench, "Double pendulum, one recording", model, rows)
    say(bench, "Double pendulum, one recording at 20 Hz", model, rows[::25])


def ur10e(bench: Bench) -> None:
    model, test = DATA / "ur10e" / "ur10e.urdf", DATA / "ur10e" / "val_ptp_10_points.csv"
    rows = read_rows(DATA / "ur10e" / "id_50s_12harm.csv")
    say(bench, "UR10e, the first third", model, third(rows))
    say(bench, "UR10e, 20 Hz", model, rows[::5], test)
    say(bench, "UR10e, runs of 0.6 s", model, short_runs(rows, 60), test)


ROBOTS = {"emps": emps, "pendulum": pendulum, "double_pendulum": double_pendulum, "ur10e": ur10e}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    args, robots = robots_asked_for(parser, ROBOTS)
    for robot in robots:
        with tempfile.TemporaryDirectory() as folder:
            ROBOTS[robot](Bench(args.program.resolve(), Path(folder)))


if __name__ == "__main__":
    main()
