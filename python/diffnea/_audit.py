"""`audit` on whatever holds a recording."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from ._core import AuditReport, Model, Recording, _audit_files, _audit_recordings
from ._files import StrPath, load_model, read_recordings

if TYPE_CHECKING:
    import pandas as pd

    One: TypeAlias = Recording | StrPath | pd.DataFrame
    Data: TypeAlias = One | Sequence[One]


def audit(
    data: Data,
    model: Model | StrPath | None = None,
    *,
    significance: float = 5.0,
    passive: Sequence[str] = (),
) -> AuditReport:
    """Find what is wrong with the channels of recordings, before any dynamics.

    Velocities against dq/dt (sign, scale, lag, swapped joints), the clock, torques at a limit or
    of the wrong sign or joint, dead, frozen, slow and coarse channels, spikes, degrees, periods.

    Args:
        data: recordings of one robot: a :class:`Recording`, a path, a data frame, or a list of
            them.
        model: the robot, or the path of its description, for its limits; without one, whatever
            needs a limit is not checked.
        significance: least size of a fault over its standard error.
        passive: for files: joints whose torque is known to be zero.

    Raises:
        DataError, ModelError, FileError: where the input cannot be read, or is of other joints.

    """
    if model is not None and not isinstance(model, Model):
        model = load_model(model)
    one: list[One] = list(data) if isinstance(data, list | tuple) else [data]  # type: ignore[list-item]
    paths = [Path(x) for x in one if isinstance(x, str | os.PathLike)]
    if len(paths) == len(one) and all(path.suffix not in (".parquet", ".npz") for path in paths):
        return _audit_files(paths, model, significance, list(passive))
    recordings: list[Recording] = []
    for x in one:
        if isinstance(x, Recording):
            recordings.append(x)
        else:
            recordings.extend(read_recordings(x, passive=passive))
    return _audit_recordings(recordings, model, significance)
