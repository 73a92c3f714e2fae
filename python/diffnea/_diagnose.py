"""`diagnose` on whatever holds a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Unpack

from ._core import Error, Finding, FitProgress, Model, _diagnose, _diagnose_options
from ._data import items, locks
from ._files import StrPath, load_model
from ._options import with_options

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ._core import _DiagnoseOptions
    from ._data import Data

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Candidate:
    """A candidate that the catalogue does not have: torque columns computed from the motion.

        >>> twist = diffnea.Candidate(
        ...     "twist", "elbow", lambda t, q, qd, qdd: q[:, 0] * q[:, 1], {"k": "N*m/rad^2"}
        ... )
        >>> diffnea.diagnose(model, train, test=test, candidates=[twist])

    It is tried, refused, named and listed as a rival like any effect. Model files cannot hold it,
    so ``finding.model`` lacks it where it is named, and ``finding.notes`` say so.

    Args:
        name: as results name it; none of those that :func:`effects` lists.
        where: the joint whose torque it adds to.
        function: ``f(t, q, qd, qdd)`` of the time (N,) [s] since the recording began and the
            filtered motion (N, n) of all joints: the torque (N, k) at that joint [N·m] or [N] for
            one unit of each of the k parameters; (N,) if there is one. It is called once for
            every uninterrupted stretch of each recording.
        parameters: the unit of each parameter by its name, in the order of the columns; the torque
            is linear in all of them.
        signs: ``nonnegative`` or ``positive`` for parameters that physics allows no other sign.

    """

    name: str
    where: str
    function: Callable[[Array, Array, Array, Array], ArrayLike]
    parameters: Mapping[str, str] = field(default_factory=lambda: {"gain": "N*m"})
    signs: Mapping[str, str] = field(default_factory=dict)

    def _as_tuple(self) -> tuple[str, str, list[tuple[str, str, str]], Callable[..., object]]:
        if unknown := set(self.signs) - set(self.parameters):
            raise Error(
                f"diagnose: candidate {self.name!r}: signs: got {', '.join(sorted(unknown))};"
                f" parameters: {', '.join(self.parameters)}"
            )
        of = [(name, unit, self.signs.get(name, "free")) for name, unit in self.parameters.items()]
        return self.name, self.where, of, self.function


@with_options(_diagnose_options())
def diagnose(
    model: Model | StrPath,
    train: Data,
    *,
    test: Data | None = None,
    candidates: Sequence[Candidate] = (),
    torque_side: str | None = None,
    passive: Sequence[str] = (),
    joints: Sequence[str] = (),
    lock: Mapping[str, float | None] | None = None,
    progress: Callable[[FitProgress], bool | None] | None = None,
    **options: Unpack[_DiagnoseOptions],
) -> Finding:
    """Name the effects that a model lacks, with evidence, rivals and the gain on held-out data.

    Args:
        model: the robot, or the path of its description.
        train: what to explain: a :class:`Recording`, a path, a data frame, or a list of them.
        test: recordings of other motions, on which causes must help too. Without them blocks of
            time are held out, which is weaker.
        candidates: your own beside ``effects``.
        torque_side: where torque was measured, ``motor`` or ``link``; for files, over what the
            file says.
        passive: for files: joints whose torque is known to be zero.
        joints: these alone move; the others of the model are locked, and their columns left out.
            Without a choice those that are logged move.
        lock: joints that do not move, and where [rad, m]; ``None``: at the median of their
            column, or where the model rests.
        progress: called before each step. Return ``False`` to stop and have what was found until
            then (``finding.interrupted``). Ctrl-C raises ``KeyboardInterrupt``.
        **options: of the search.

    Raises:
        DataError, ModelError, FileError: where the input is at fault; the message says what to
            do; of own candidates also whatever is wrong with their columns.

    """
    if not isinstance(model, Model):
        model = load_model(model)
    if (effects := options.get("effects")) is not None and not effects:
        raise Error("diagnose: effects: got none; leave it out to try all that effects() lists")
    return _diagnose(
        model,
        items(train, torque_side, passive),
        [] if test is None else items(test, torque_side, passive),
        [c._as_tuple() for c in candidates],
        dict(options),
        torque_side,
        list(passive),
        list(joints),
        locks(lock),
        progress,
    )
