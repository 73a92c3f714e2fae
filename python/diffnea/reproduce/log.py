"""``runs.jsonl``: what every run of a study did, a line each."""

from __future__ import annotations

import json
import os
from pathlib import Path

from .jobs import Json

NAME = "runs.jsonl"


def append(folder: Path, entry: Json) -> None:
    """Add a line, onto the disk.

    A line of which a killed process wrote but the beginning is ended first.
    """
    file = os.open(folder / NAME, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
    try:
        size = os.fstat(file).st_size
        torn = size > 0 and os.pread(file, 1, size - 1) != b"\n"
        line = ("\n" if torn else "") + json.dumps(entry) + "\n"
        left = line.encode()
        while left:
            left = left[os.write(file, left) :]
        os.fsync(file)
    finally:
        os.close(file)


def entries(folder: Path) -> list[Json]:
    """Return the lines that are whole; of one that is not, the run's results are there anyway."""
    path = folder / NAME
    if not path.exists():
        return []
    out = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        if isinstance(entry, dict):
            out.append(entry)
    return out
