"""`identify` on whatever holds a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Unpack

from ._core import FitProgress, IdentifyResult, Model, _identify, _identify_options
from ._data import items, locks
from ._files import StrPath, load_model
from ._options import with_options

if TYPE_CHECKING:
    from ._core import _IdentifyOptions
    from ._data import Data


@with_options(_identify_options())
def identify(
    model: Model | StrPath,
    data: Data,
    *,
    test: Data | None = None,
    torque_side: str | None = None,
    passive: Sequence[str] = (),
    joints: Sequence[str] = (),
    lock: Mapping[str, float | None] | None = None,
    progress: Callable[[FitProgress], bool | None] | None = None,
    **options: Unpack[_IdentifyOptions],
) -> IdentifyResult:
    """Fit a model's parameters to recordings; physically consistent, with uncertainties.

    Args:
        model: the robot, or the path of its description.
        data: what to fit: a :class:`Recording`, a path, a data frame, or a list of them. CSV
            files are streamed, so that any length fits into memory.
        test: held-out recordings, never fitted; their errors are reported.
        torque_side: where torque was measured, ``motor`` or ``link``; for files, over what the
            file says.
        passive: for files: joints whose torque is known to be zero.
        joints: these alone move; the others of the model are locked, and their columns left out.
            Without a choice those that are logged move.
        lock: joints that do not move, and where [rad, m]; ``None``: at the median of their
            column, or where the model rests.
        progress: called as the fit goes. Return ``False`` to stop it and have what was found
            until then (``result.summary.interrupted``). Ctrl-C raises ``KeyboardInterrupt``.
        **options: of the fit.

    Raises:
        DataError, ModelError, FileError: where the input is at fault; the message says what to
            do.

    """
    if not isinstance(model, Model):
        model = load_model(model)
    return _identify(
        model,
        items(data, torque_side, passive),
        [] if test is None else items(test, torque_side, passive),
        dict(options),
        torque_side,
        list(passive),
        list(joints),
        locks(lock),
        progress,
    )
