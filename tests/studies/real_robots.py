"""What the studies of the measured robots share: their files, and commands that are printed."""

import argparse
import csv
import json
import os
import subprocess
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SOURCE = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("DIFFNEA_DATA", SOURCE.parent / "shared" / "data"))
MODELS = SOURCE / "models"

Json = dict[str, Any]
Row = dict[str, Any]


@dataclass(frozen=True)
class Bench:
    """The command, and a folder for its results and for what is cut out of the recordings."""

    program: Path
    folder: Path

    def run(self, title: str, command: str, *arguments: object) -> tuple[Path, Json]:
        """Run a command of diffnea, print it, return RUN and its result.json."""
        run = self.folder / f"run_{len(list(self.folder.glob('run_*')))}"
        words = [command, *map(str, arguments), "-o", str(run)]
        shown = " ".join(
            w.replace(str(self.folder), "TMP").replace(str(DATA), "DATA").replace(f"{SOURCE}/", "")
            for w in words
        )
        print(f"\n{title}\n  $ diffnea {shown}", flush=True)
        done = subprocess.run([self.program, *words, "--quiet"], capture_output=True, text=True)
        if done.returncode != 0:
            print(f"  exit code {done.returncode}: {done.stderr.strip()}")
        result: Json = json.loads((run / "result.json").read_text(encoding="utf-8"))
        return run, result


def robots_asked_for(
    parser: argparse.ArgumentParser, known: Collection[str]
) -> tuple[argparse.Namespace, list[str]]:
    """Arguments, and the robots among them; none where there are no recordings, which it says."""
    parser.add_argument("program", type=Path, help="the command diffnea")
    parser.add_argument("robots", nargs="*", metavar="ROBOT", help=f"of {', '.join(known)}; all")
    args = parser.parse_intermixed_args()
    if unknown := set(args.robots) - set(known):
        parser.error(f"no robot {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    if not DATA.is_dir():
        print(f"no measured recordings at {DATA}; DIFFNEA_DATA may name their folder")
        return args, []
    return args, args.robots or list(known)


def print_values(what: str, values: Mapping[str, float | None], scale: float, digits: str) -> None:
    """Print values of joints, times the scale, in a format such as .3f."""
    shown = ("–" if v is None else f"{scale * v:{digits}}" for v in values.values())
    print(f"  {what:<44}" + "  ".join(shown))


def split(path: Path, share: float, folder: Path) -> tuple[Path, Path]:
    """The first rows and the rest, as two files."""
    lines = path.read_text(encoding="utf-8").splitlines()
    cut = 1 + int(share * (len(lines) - 1))
    first, rest = folder / f"{path.stem}_first.csv", folder / f"{path.stem}_rest.csv"
    first.write_text("\n".join(lines[:cut]) + "\n", encoding="utf-8")
    rest.write_text("\n".join([lines[0], *lines[cut:]]) + "\n", encoding="utf-8")
    return first, rest


def read_rows(path: Path) -> list[Row]:
    with path.open(encoding="utf-8") as f:
        return list(csv.DictReader(f))


def write_rows(path: Path, rows: list[Row]) -> Path:
    with path.open("w", newline="", encoding="utf-8") as f:
        out = csv.DictWriter(f, rows[0].keys())
        out.writeheader()
        out.writerows(rows)
    return path
