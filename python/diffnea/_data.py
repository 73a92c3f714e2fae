"""Whatever holds recordings, as the compiled part takes it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from ._core import Recording
from ._files import StrPath, read_recordings
from ._readers import is_foreign

if TYPE_CHECKING:
    import pandas as pd

    One: TypeAlias = Recording | StrPath | pd.DataFrame
    Data: TypeAlias = One | Sequence[One]


def items(data: Data, torque_side: str | None, passive: Sequence[str]) -> list[Recording | Path]:
    """All CSV files, or all recordings in memory."""
    one: list[One]
    if isinstance(data, Recording | str | os.PathLike) or not isinstance(data, Sequence):
        one = [data]
    else:
        one = list(data)
    paths = [Path(x) for x in one if isinstance(x, str | os.PathLike)]
    if len(paths) == len(one) and not any(map(is_foreign, paths)):
        return list(paths)
    recordings: list[Recording | Path] = []
    for x in one:
        if isinstance(x, Recording):
            recordings.append(x)
        else:
            recordings.extend(read_recordings(x, torque_side=torque_side, passive=passive))
    return recordings


def locks(lock: Mapping[str, float | None] | None) -> list[str]:
    """Return locks as the compiled part takes them: ``JOINT=VALUE``, or ``JOINT`` alone."""
    return [
        joint if value is None else f"{joint}={float(value)!r}"
        for joint, value in (lock or {}).items()
    ]
