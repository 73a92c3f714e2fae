"""Diagnose each measured robot on five random splits: is it the same cause that comes first?

    python tests/studies/split_stability.py PROGRAM [emps panda ur10e double_pendulum pendulum]

Every recording is cut into ten pieces of equal length; six of all pieces in ten are fitted, drawn
at random, the rest is held out. Printed are the cause that removes most of the held-out error and
what the recording cannot tell it from, and causes that four splits of five name or have in a class.
Recordings as in real_data.py.
"""

import argparse
import random
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from real_robots import DATA, MODELS, Bench, Json, Row, read_rows, robots_asked_for, write_rows

SPLITS, PIECES, FITTED = 5, 10, 0.6
OFTEN = 4  # splits

def pieces_of(rows: list[Row]) -> list[list[Row]]:
    size = -(-len(rows) // PIECES)
    return [rows[i : i + size] for i in range(0, len(rows), size)]


def numbered(pieces: list[list[Row]], out: Path) -> Path:
    """The pieces as runs of one recording."""
    rows = [{"run": k, **row} for k, piece in enumerate(pieces) for row in piece]
    return write_rows(out, rows)


def name(cause: Json) -> str:
    return f"{cause['effect']} at {cause['where']}"


def classes(finding: Json) -> list[list[str]]:
    """Causes, in the order in which each removes most, with what cannot be told from them."""
    named = [c for c in finding["causes"] if c["effect"] != "residual"]
    return [[name(cause), *map(name, cause["class"])] for cause in named]


def splits(bench: Bench, model: Path, recordings: list[Path], *options: object) -> None:
    pieces = [p for path in recordings for p in pieces_of(swinging(path))]
    first: Counter[str] = Counter()
    every: Counter[str] = Counter()
    for k in range(SPLITS):
        dealt = random.Random(k).sample(pieces, len(pieces))
        cut = round(FITTED * len(dealt))
        halves = []
        for name, part in (("fitted", dealt[:cut]), ("held", dealt[cut:])):
            halves.append(numbered(part, bench.folder / f"{name}_{k}.csv"))
            sidecar = recordings[0].with_suffix(".json")
            if sidecar.exists():
                shutil.copy(sidecar, halves[-1].with_suffix(".json"))
        title = f"split {k}"
        _, result = bench.run(title, "diagnose", model, halves[0], "--test", halves[1], *options)
        found = classes(result)
        shown = [" or ".join(one) for one in found]
        print(f"  {result['verdict']}: {'; '.join(shown) or 'no cause'}", flush=True)
        first.update(found[0] if found else ())
        every.update({cause for one in found for cause in one})
    for cause, count in first.most_common(3):
        print(f"first, or in its class, in {count} of {SPLITS}: {cause}")
    often = [f"{cause} ({n})" for cause, n in every.most_common() if n >= OFTEN]
    print(f"in {OFTEN} and more: {', '.join(often) or 'none'}")


def swinging(path: Path) -> list[Row]:
    """Rows of a recording; of the free pendulum those in which no hand leads it."""
    rows = read_rows(path)
    if path.parent.name != "pendulum_free_swing":
        return rows
    return [row for row in rows if 8.0 <= float(row["time"]) <= 115.0]


def emps(bench: Bench) -> None:
    splits(bench, MODELS / "emps.urdf", [DATA / "emps" / f"{n}.csv" for n in ("train", "test")])


def panda(bench: Bench) -> None:
    exciting = DATA / "panda" / "exciting.csv"
    splits(bench, MODELS / "panda.urdf", [exciting], "--torque-side", "link")


def ur10e(bench: Bench) -> None:
    d = DATA / "ur10e"
    splits(bench, d / "ur10e.urdf", [d / "id_50s_12harm.csv", d / "val_ptp_10_points.csv"])


def double_pendulum(bench: Bench) -> None:
    d = DATA / "double_pendulum"
    runs = [d / f"record_{k}.csv" for k in ("00", "01", "02", "03", "04", "05", "11", "12", "13")]
    splits(bench, MODELS / "double_pendulum.urdf", runs)


def pendulum(bench: Bench) -> None:
    data = DATA / "pendulum_free_swing" / "free_swing.csv"
    splits(bench, MODELS / "pendulum.json", [data])


ROBOTS: dict[str, Callable[[Bench], None]] = {
    "emps": emps,
    "panda": panda,
    "ur10e": ur10e,
    "double_pendulum": double_pendulum,
    "pendulum": pendulum,
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    args, robots = robots_asked_for(parser, ROBOTS)
    for robot in robots:
        print(f"\n== {robot}", flush=True)
        with tempfile.TemporaryDirectory() as folder:
            ROBOTS[robot](Bench(args.program.resolve(), Path(folder)))


if __name__ == "__main__":
    main()
