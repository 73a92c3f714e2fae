"""`audit` on whatever holds a recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ._core import AuditReport, Model, Recording, _audit_files, _audit_recordings
from ._data import items
from ._files import StrPath, load_model

if TYPE_CHECKING:
    from ._data import Data


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
    found = items(data, None, passive)
    paths = [x for x in found if isinstance(x, Path)]
    if paths:
        return _audit_files(paths, model, significance, list(passive))
    recordings = [x for x in found if isinstance(x, Recording)]
    return _audit_recordings(recordings, model, significance)
