"""Change recordings in ways that leave what a model lacks as it is, and count where `diagnose` says the same.

    python3 tests/hidden_effects/study.py build/release --generator rigs --set tune --group main --count 1 --keep -o CASES
    python3 tests/studies/same_causes.py build/release/apps/diffnea CASES [--only eighth,axes]
    python3 tests/studies/same_causes.py build/release/apps/diffnea --recording models/emps.urdf TRAIN TEST

Torques times 8 and 1/8 beside the file's masses, joints of the other sense (MJCF alone), columns in another order, a
clock that begins later, and runs of 2.5 s. Needs Python alone.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import shutil
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

Rows = list[list[str]]  # the first is the head
Change = Callable[[Rows, frozenset[str]], Rows]

RUN = 2.5  # length of a run [s]
LATER = 512.0  # [s]: a power of two, so that no digit of the intervals changes


def name_of(column: str) -> str:
    """Column without its unit."""
    return column.split(" ")[0]


def times(factor: float, rows: Rows, is_meant: Callable[[str], bool]) -> Rows:
    meant = [i for i, column in enumerate(rows[0]) if is_meant(name_of(column))]
    out = [rows[0]]
    for row in rows[1:]:
        changed = list(row)
        for i in meant:
            changed[i] = repr(factor * float(row[i])) if row[i] else ""
        out.append(changed)
    return out


def torques(factor: float) -> Change:
    return lambda rows, _: times(factor, rows, lambda name: name.startswith("tau_"))


def axes(rows: Rows, joints: frozenset[str]) -> Rows:
    return times(-1.0, rows, lambda name: name.partition("_")[2] in joints)


def order(rows: Rows, _: frozenset[str]) -> Rows:
    head = rows[0]
    values = [i for i, name in enumerate(head) if name not in ("time", "run")]
    others = [i for i in range(len(head)) if i not in values]
    return [[row[i] for i in others + values[::-1]] for row in rows]


def late(rows: Rows, _: frozenset[str]) -> Rows:
    at = rows[0].index("time")
    return [rows[0]] + [
        [repr(float(v) + LATER) if i == at else v for i, v in enumerate(row)] for row in rows[1:]
    ]


def runs(rows: Rows, _: frozenset[str]) -> Rows:
    head = rows[0]
    time = head.index("time")
    run = head.index("run") if "run" in head else None
    out = [["run"] + [name for name in head if name != "run"]]
    number, begin, of = -1, 0.0, ""
    for row in rows[1:]:
        now, recorded = float(row[time]), row[run] if run is not None else "0"
        if number < 0 or now - begin >= RUN or recorded != of:
            number, begin, of = number + 1, now, recorded
        cells = [repr(round(now - begin, 9)) if i == time else v for i, v in enumerate(row)]
        out.append([str(number)] + [v for i, v in enumerate(cells) if i != run])
    return out


CHANGES: dict[str, Change] = {
    "as it is": lambda rows, _: rows,
    "eight": torques(8.0),
    "eighth": torques(1.0 / 8.0),
    "axes": axes,
    "order": order,
    "late": late,
    "runs": runs,
}


def turned_model(model: Path, to: Path) -> frozenset[str]:
    """Write the model with every other joint turned about, and return these."""
    tree = ET.parse(model)
    joints = [j for j in tree.iter("joint") if j.get("axis") and j.get("name")][::2]
    for joint in joints:
        joint.set("axis", " ".join(repr(-float(v)) for v in joint.attrib["axis"].split()))
        if joint.get("range"):
            low, high = map(float, joint.attrib["range"].split())
            joint.set("range", f"{-high} {-low}")
    tree.write(to)
    return frozenset(j.attrib["name"] for j in joints)


def causes(
    program: Path, model: Path, recordings: dict[str, Path], change: str
) -> frozenset[str] | None:
    """Name what `diagnose` finds in the changed recordings; None: the change suits no such model."""
    joints: frozenset[str] = frozenset()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if change == "axes":
            if model.suffix != ".xml":
                return None
            joints = turned_model(model, folder / "model.xml")
            model = folder / "model.xml"
        for part, path in recordings.items():
            with path.open(encoding="utf-8", newline="") as file:
                rows = CHANGES[change](list(csv.reader(file)), joints)
            with (folder / f"{part}.csv").open("w", encoding="utf-8", newline="") as file:
                csv.writer(file).writerows(rows)
            if path.with_suffix(".json").exists():
                shutil.copy(path.with_suffix(".json"), folder / f"{part}.json")
        command = [program, "diagnose", model, folder / "train.csv", "--test", folder / "test.csv"]
        command += ["--base", "refit", "-o", folder / "run", "--quiet", "--threads", "1"]
        answer = subprocess.run([str(word) for word in command], capture_output=True, text=True)
        if answer.returncode != 0:
            return frozenset({answer.stderr.strip()})
        found = json.loads((folder / "run/result.json").read_text(encoding="utf-8"))
    return frozenset(f"{cause['effect']} at {cause['where']}" for cause in found["causes"])


def cases_in(folders: list[Path]) -> Iterator[tuple[str, Path, dict[str, Path]]]:
    for folder in folders:
        for seen in sorted(folder.glob("**/seen")):
            model = next(seen.glob("model.*"))
            yield seen.parent.name, model, {p: seen / f"{p}.csv" for p in ("train", "test")}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("program", type=Path)
    parser.add_argument("folders", type=Path, nargs="*", metavar="CASES")
    parser.add_argument(
        "--recording", type=Path, nargs=3, action="append", default=[], help="MODEL TRAIN TEST"
    )
    parser.add_argument("--only", help="changes, by commas: " + ", ".join(list(CHANGES)[1:]))
    args = parser.parse_args()
    cases = list(cases_in(args.folders))
    for model, train, test in args.recording:
        cases.append((train.stem, model, {"train": train, "test": test}))
    asked = ["as it is", *(args.only.split(",") if args.only else list(CHANGES)[1:])]
    jobs = [(case, change) for case in cases for change in asked]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = list(
            pool.map(lambda job: causes(args.program, job[0][1], job[0][2], job[1]), jobs)
        )
    results = {(case[0], change): names for (case, change), names in zip(jobs, found, strict=True)}
    for change in asked[1:]:
        tried = [case[0] for case in cases if results[case[0], change] is not None]
        same = [name for name in tried if results[name, change] == results[name, "as it is"]]
        print(f"{change}: {len(same)} of {len(tried)} the same")
        for name in sorted(set(tried) - set(same)):
            usual, here = results[name, "as it is"] or (), results[name, change] or ()
            print(f"  {name}: {', '.join(sorted(usual)) or 'nothing'}")
            print(f"    here {', '.join(sorted(here)) or 'nothing'}")


if __name__ == "__main__":
    main()
