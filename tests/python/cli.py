"""The command under test, and what its tests share."""

import csv
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from diffnea import _core

ROOT = Path(__file__).resolve().parents[2]
MODELS = ROOT / "models"
COMMAND = os.environ.get("DIFFNEA_COMMAND") or str(Path(sys.executable).parent / "diffnea")
# Catches what hangs: a diagnosis of a servo takes two minutes of a busy core, sanitizers more.
SECONDS = float(os.environ.get("DIFFNEA_COMMAND_SECONDS", "300"))

PENDULUM = MODELS / "double_pendulum.urdf"
RUN_FILES = {"result.json", "series.json", "model.json", "model.urdf", "report.html"}
"""What `identify` leaves of a URDF."""

DONE, BAD_INPUT, WRONG_USAGE, NO_USABLE_RESULT, INTERRUPTED = 0, 1, 2, 3, 130


def diffnea(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command to its end, whatever that is."""
    return subprocess.run(
        [COMMAND, *map(str, arguments)], capture_output=True, text=True, cwd=cwd, timeout=SECONDS
    )


def done(*arguments: object, cwd: Path | None = None) -> str:
    """Run the command, which must succeed; return its standard output."""
    answer = diffnea(*arguments, cwd=cwd)
    assert answer.returncode == DONE, answer.stderr
    return answer.stdout


def load(path: Path) -> Any:
    """Read JSON strictly: NaN and Infinity are no JSON."""

    def refuse(constant: str) -> None:
        raise ValueError(f"{path}: {constant} is no JSON")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


def schema(name: str) -> Any:
    """JSON Schema of a file ``diffnea/NAME/1``: of the field lists, or written by hand."""
    if name in _core._schema_names():
        return _core._json_schema(name)
    return load(ROOT / "docs" / "schema" / f"{name}.schema.json")


def refused(run: Path, *arguments: object, command: str = "identify") -> str:
    """Run the command, which must refuse and leave nothing behind; return its message."""
    answer = diffnea(command, *arguments, "-o", run, "--quiet")
    assert answer.returncode == BAD_INPUT, answer.stderr + answer.stdout
    assert answer.stdout == ""
    assert not run.exists()
    return answer.stderr


Table = list[list[str]]


def edited(source: Path, target: Path, edit: Callable[[Table], Table | None]) -> Path:
    """Copy a recording; `edit` may change its rows, the first of which is the header."""
    with source.open(newline="") as file:
        table = list(csv.reader(file))
    table = edit(table) or table
    with target.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(table)
    return target


def column(table: Table, name: str) -> int:
    return table[0].index(name)
