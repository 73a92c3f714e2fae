"""Logs of BAM, the bench of pendulums on servos (github.com/Rhoban/bam): JSON with ``entries``.

``position`` [rad], ``speed`` [rad/s] and ``goal_position`` [rad] become q, qd and qcmd of a joint
``servo``, ``timestamp`` the time; load, voltage and the like stay as they are. What the file says
of the bench goes into a note.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from .._core import DataError, FileError
from .table import Selection, Table, table_of_columns

_JOINT = "servo"
_COLUMNS = {
    "timestamp": "time",
    "position": f"q_{_JOINT}",
    "speed": f"qd_{_JOINT}",
    "goal_position": f"qcmd_{_JOINT}",
    "load": "load_raw",
    "current": "current_raw",
    "input_volts": "voltage [V]",
}


def is_log(path: Path) -> bool:
    """Tell whether a JSON file looks like a log; one of ours or a robot has no entries."""
    with path.open("rb") as file:
        return b'"entries"' in file.read(4096)


def read(path: Path, selection: Selection) -> Table:
    """Read one log."""
    del selection
    try:
        log = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read as JSON ({error})") from error
    entries = log.get("entries") if isinstance(log, dict) else None
    is_list = isinstance(entries, list) and all(isinstance(entry, dict) for entry in entries)
    if not is_list or not entries:
        raise DataError(f"{path}: expected entries, a list of objects, as BAM writes it")
    missing = [key for key in ("timestamp", "position") if key not in entries[0]]
    if missing:
        raise DataError(
            f"{path}: entries have no {', '.join(missing)}; there are: {', '.join(entries[0])}"
        )
    columns = {}
    for key in entries[0]:
        values = [entry.get(key) for entry in entries]
        if all(isinstance(x, bool | int | float) or x is None for x in values):
            numbers = [np.nan if x is None else float(x) for x in values]
            columns[_COLUMNS.get(key, key)] = np.array(numbers)
    said = [f"{key} {x}" for key, x in log.items() if isinstance(x, str | int | float)]
    notes = [f"{path}: {', '.join(said)}"] if said else []
    notes.append(
        f'the joint is called {_JOINT}; --map "q_{_JOINT}=q_JOINT,…" gives it another name'
    )
    return table_of_columns(path, _ordered(columns), notes)


def _ordered(columns: dict[str, Any]) -> dict[str, Any]:
    """Order the columns: time first, then the joint's, then the rest."""
    first = [name for name in _COLUMNS.values() if name in columns]
    return {name: columns[name] for name in [*first, *(n for n in columns if n not in first)]}
