"""`identify` on whatever holds a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from ._core import FitProgress, IdentifyResult, Model, _identify
from ._data import items
from ._files import StrPath, load_model

if TYPE_CHECKING:
    from ._data import Data


def _names(given: str | Sequence[str]) -> list[str]:
    return [given] if isinstance(given, str) else list(given)


def identify(
    model: Model | StrPath,
    data: Data,
    *,
    test: Data | None = None,
    loss: str = "inverse",
    robust: str = "none",
    fit: str | Sequence[str] = ("inertia", "armature", "effects", "string"),
    effects: str | Sequence[str] | None = None,
    fix: str | Sequence[str] = (),
    entropic_prior: float = 0.0,
    physical: bool = True,
    filter_hz: float = 0.0,
    decimate_to_hz: float = 0.0,
    window: float = 0.5,
    ball_window: float = 2.0,
    ball_lambda: tuple[float, float, float] = (1.0, 1.0, 1.0),
    max_passes: int = 25,
    threads: int = 1,
    torque_side: str | None = None,
    passive: Sequence[str] = (),
    progress: Callable[[FitProgress], bool | None] | None = None,
) -> IdentifyResult:
    """Fit a model's parameters to recordings; physically consistent, with uncertainties.

    Args:
        model: the robot, or the path of its description.
        data: what to fit: a :class:`Recording`, a path, a data frame, or a list of them. CSV
            files are streamed, so that any length fits into memory.
        test: held-out recordings, never fitted; their errors are reported.
        loss: ``inverse`` (torque), ``forward`` (acceleration) or ``trajectory`` (simulated
            positions); ``constrained``: of a ball's acceleration and its string, where otherwise
            its trajectory is fitted.
        robust: weights that outliers lose by: ``none``, ``huber`` or ``cauchy``.
        fit: what may move: any of ``inertia``, ``armature``, ``effects``, ``string`` (of a ball:
            length and attachment), ``shapes``, ``kinematics``.
        effects: beyond those of the model: ``name`` for every joint it suits, or ``name@joint``;
            ``payload@tip:run=1`` acts in recording 1 alone (from 0, ``data`` first, then ``test``);
            ``[]`` for none. Default: on the motor side armature, viscous and Coulomb friction and
            an offset at every joint, on the link side the offset alone; of a ball on a string
            linear drag, in free flight quadratic drag.
        fix: parameters to hold at the model's value, or at one that is given: names, or patterns
            with ``*``; ``"*payload.mass=2.8"``.
        entropic_prior: pull of every inertia to the model's [units of χ²/2]; 0: none.
        physical: ``False`` leaves inertias free (least squares), for comparison.
        filter_hz: low-pass of the positions [Hz]; 0: chosen from the data.
        decimate_to_hz: rate of the fit [Hz]; 0: chosen from the data.
        window: length of the simulated windows of the trajectory loss [s].
        ball_window: length of a simulated window of a ball's path [s], at most.
        ball_lambda: weights of g and its two derivatives in the constrained loss.
        max_passes: over the data, of robust losses and shape parameters.
        threads: of the trajectory loss.
        torque_side: where torque was measured, ``motor`` or ``link``; for files, over what the
            file says.
        passive: for files: joints whose torque is known to be zero.
        progress: called as the fit goes. Return ``False`` to stop it and have what was found
            until then (``result.summary.interrupted``). Ctrl-C raises ``KeyboardInterrupt``.

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
        loss,
        robust,
        _names(fit),
        None if effects is None else _names(effects),
        _names(fix),
        entropic_prior,
        physical,
        filter_hz,
        decimate_to_hz,
        window,
        ball_window,
        ball_lambda,
        max_passes,
        threads,
        torque_side,
        list(passive),
        progress,
    )
