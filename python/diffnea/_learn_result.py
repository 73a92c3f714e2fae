"""What `learn` gives back: policies, one a seed, and the model that they were learned in."""

from __future__ import annotations

import html
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ._core import Model, Policy, RunInput, _BallInCup
from ._files import StrPath
from ._results import _table
from ._rollouts import Rollouts, RolloutTrace
from ._tables import table
from .style import new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class LearnResult:
    """Policies learned in a model, one a seed."""

    model: Model
    """That they were learned in, with the string that is on the robot."""
    controller: Model
    """What the robot's controller knows."""
    policies: list[Policy]
    """One a seed, in their order; those that Ctrl-C left out are missing."""
    interrupted: bool
    """Ctrl-C, or ``progress``, stopped it; the policies are of what was learned until then."""
    string: float | None
    """Nominal length of the string that is on the robot [m]; None: not said."""
    threads: int
    seconds: float
    """That passed."""
    _options: tuple[Any, ...]
    _inputs: tuple[RunInput, ...] = ()

    def _task(self) -> _BallInCup:
        return _BallInCup(self.model, self.controller, self.string, *self._options)

    @property
    def seeds(self) -> list[int]:
        """Of the policies."""
        return [policy.seed for policy in self.policies]

    @property
    def solved(self) -> NDArray[np.bool_]:
        """(policies,) whose mean does the task in the model."""
        return np.array([policy.solved for policy in self.policies], dtype=bool)

    @property
    def caught_share(self) -> Array:
        """(policies,) share of draws of the posterior in which the mean does the task.

        Draws that the search had not seen; NaN where it had the model alone.
        """
        shares = [policy.caught_share for policy in self.policies]
        return np.array([np.nan if share is None else share for share in shares])

    @property
    def best(self) -> Policy:
        """The policy that does the task with the largest reward in the model."""
        return max(self.policies, key=lambda policy: (policy.solved, policy.expected))

    @property
    def curves(self) -> dict[str, Array]:
        """Arrays (policies, iterations) by name; NaN after a search was done."""
        curves = [policy.curve for policy in self.policies]
        longest = max((len(curve["reward_mean"]) for curve in curves), default=0)
        names = curves[0].keys() if curves else ()
        out = {name: np.full((len(curves), longest), np.nan) for name in names}
        for k, curve in enumerate(curves):
            for name, values in curve.items():
                out[name][k, : len(values)] = values
        return out

    def imagine(self, policy: Policy | None = None) -> RolloutTrace:
        """Execute a policy's mean (default: of the best) in the model, and keep all of it."""
        rollouts = Rollouts._of(self._task().rollouts(None, None, False, 1), None)
        return rollouts.trace((policy or self.best).mean)

    def plot(self) -> Figure:
        """Draw reward and share of rollouts that do the task over iterations, with the spread."""
        figure = new_figure("LearnResult.plot", 9, 6)
        panels: Any = figure.subplots(2, 1, sharex=True)
        curves = self.curves
        for panel, name, label in (
            (panels[0], "reward_mean", "mean reward"),
            (panels[1], "solved_share", "solved [%]"),
        ):
            values = _held(curves[name]) * (100 if name == "solved_share" else 1)
            at = np.arange(1, values.shape[1] + 1)
            low, middle, high = np.quantile(values, (0.25, 0.5, 0.75), axis=0)
            panel.fill_between(at, values.min(axis=0), values.max(axis=0), color="0.9")
            panel.fill_between(at, low, high, color="C0", alpha=0.3)
            panel.plot(at, middle, color="C0")
            panel.set_ylabel(label)
        panels[1].set_xlabel("iteration")
        panels[1].locator_params(axis="x", integer=True)
        count = len(self.policies)
        figure.suptitle(
            f"{int(self.solved.sum())} of {count} solved in the model; median, quartiles and range"
            f" of {count} seeds"
        )
        return figure

    def to_frame(self) -> pd.DataFrame:
        """Return a data frame, a row a policy, the seed as index."""
        return table(
            [
                {
                    "seed": p.seed,
                    "solved": bool(p.solved),
                    "expected": p.expected,
                    "caught_share": np.nan if p.caught_share is None else p.caught_share,
                    "iterations": len(p.curve["eta"]),
                    "rollouts": p.rollouts,
                    "stopped": p.stopped,
                    "seconds": p.seconds,
                }
                for p in self.policies
            ]
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, schema ``diffnea/learn/1``."""
        return self._task().to_dict(*self._run())

    def save(self, folder: StrPath) -> None:
        """Write what ``diffnea learn -o folder`` leaves there: policies, models, series, page.

        Raises :class:`FileError` where that would replace another command's result, or files that
        diffnea did not leave.
        """
        self._task().save(folder, *self._run())

    def _run(self) -> tuple[Any, ...]:
        run = (self.policies, self.threads, self.seconds, self.interrupted)
        return (list(self._inputs), *run)

    def __repr__(self) -> str:
        end = ", interrupted" if self.interrupted else ""
        return (
            f"LearnResult({self.model.name!r}: {int(self.solved.sum())} of {len(self.policies)}"
            f" policies solved in the model{end})"
        )

    def _repr_html_(self) -> str:
        rows = [
            [
                str(p.seed),
                "yes" if p.solved else "no",
                f"{p.expected:.3f}",
                str(len(p.curve["eta"])),
                str(p.rollouts),
                p.stopped or "interrupted",
            ]
            for p in self.policies
        ]
        head = ["seed", "solved", "reward of the mean", "iterations", "rollouts", "stopped"]
        return f"<p>{html.escape(repr(self))}</p>" + _table(head, rows)


def _held(values: Array) -> Array:
    """Each row's last number in place of the NaN after it."""
    last = np.sum(np.isfinite(values), axis=1) - 1
    at = np.minimum(np.arange(values.shape[1]), last[:, None])
    return np.take_along_axis(values, at, axis=1)
