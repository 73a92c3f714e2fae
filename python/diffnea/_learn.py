"""`learn`: a movement is searched in the model."""

from __future__ import annotations

import html
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ._core import (
    BallInCupTask,
    ErepsOptions,
    Error,
    IdentifyResult,
    Model,
    Policy,
    _BallInCup,
    _BallNetwork,
    _learn,
)
from ._files import StrPath, load_model
from ._policy import Task
from ._results import _table
from ._rollouts import Ended, Reward, Rollouts, RolloutTrace
from ._tables import table
from .blackbox.network import BallNetwork
from .style import new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    Array: TypeAlias = NDArray[np.float64]

Progress: TypeAlias = Callable[[int, int, float, float], object]

_TASKS = ("ball-in-cup",)


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
        run = (self.policies, self.threads, self.seconds, self.interrupted)
        return self._task().to_dict(*run)

    def save(self, folder: StrPath) -> None:
        """Write what ``diffnea learn -o folder`` leaves there: policies, models, series, page."""
        run = (self.policies, self.threads, self.seconds, self.interrupted)
        self._task().save(folder, *run)

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


def learn(
    model: Model | IdentifyResult | StrPath,
    task: str | Task | BallInCupTask = "ball-in-cup",
    *,
    controller: Model | StrPath | None = None,
    string: float | None = None,
    seeds: int | Sequence[int] = 1,
    threads: int = 1,
    progress: bool | Progress = True,
    reward: Reward | None = None,
    ended: Ended | None = None,
    joints: Sequence[str] = (),
    start: ArrayLike | None = None,
    bases: int = 9,
    duration: float = 1.0,
    hold: float = 1.0,
    samples: int = 80,
    iterations: int = 100,
    epsilon: float = 0.5,
    kappa: float = 0.5,
    stop_std: float = 0.02,
    weight_std: float = 0.4,
    dipole: float = 0.01,
    lambda_q: float = 0.02,
    lambda_qd: float = 0.02,
    lambda_slack: float = 20.0,
    law: str = "pd",
    rate: float = 500.0,
    bandwidth: float = 25.0,
    damping: float = 0.7,
    kp: ArrayLike | None = None,
    kd: ArrayLike | None = None,
    robust: bool = False,
    draws: int = 64,
    each: int | None = None,
    quantile: float | None = None,
    vary: Mapping[str, tuple[float, float]] | None = None,
    ball_network: BallNetwork | StrPath | None = None,
) -> LearnResult:
    """Learn a task in a model, offline: eREPS over the weights of a movement primitive.

    Ctrl-C stops it and gives back what was learned (``result.interrupted``).

    Args:
        model: robot with a ball on a string and a cup: a model, a fit, or a path.
        task: ``ball-in-cup``, or a task of your own that is seen with the same ball and cup.
        controller: model that the robot's controller compensates gravity with; default: ``model``.
        string: which string is on the robot, its nominal length [m]. A length that was identified
            stays, and more than 10 % off is an error; otherwise the model's string gets it.
        seeds: of the searches: a list, or how many, from 0 on. One policy each.
        threads: of the simulation; the result does not depend on it.
        progress: ``True`` for a bar if tqdm is installed, or a function (seed, iteration, mean
            reward, share of samples that solve it); if it returns ``False``, all stop.
        reward: in place of the task's: a function of whole rollouts, ``rollouts["ball_x"]`` is
            (N, T), that returns (N,). The task still says when an episode is over.
        ended: with ``reward``: a function of one look that ends episodes as well.
        joints: that move; default: those that turn the cup in the upright plane of its arm.
        start: posture (n,) [rad]; default: the description's ``home``.
        bases: radial bases a joint.
        duration: of the movement [s].
        hold: after the movement [s].
        samples: rollouts an iteration.
        iterations: at most.
        epsilon: bound on the KL of the samples' weights [nat].
        kappa: bound on the KL of the Gaussian's update [nat].
        stop_std: of every weight, at which a search is done.
        weight_std: of the first weights [rad].
        dipole: ε of the reward [m²].
        lambda_q: weight of joint positions in the reward [1/rad²].
        lambda_qd: weight of joint velocities [s²/rad²]; in the paper's reward of the order of
            0.002.
        lambda_slack: weight of the string's slack while the ball is free; 0: the paper's reward.
        law: of the controller: ``pd`` or ``computed_torque``.
        rate: of the controller [Hz].
        bandwidth: of gains that are not given [rad/s].
        damping: of gains that are not given.
        kp: gains (n,) [N·m/rad].
        kd: gains (n,) [N·m·s/rad].
        robust: for all models that the recordings leave possible: samples are executed in draws
            of the posterior that `identify` left in the model (``model.json``, or a fit).
        draws: with ``robust``: of the posterior.
        each: with ``robust``: draws that a sample is executed in, so many rollouts; default: 1,
            with ``quantile`` 8.
        quantile: with ``robust``: a sample's reward is this quantile of those it got, instead of
            their mean.
        vary: with ``robust``: parameters that draws have anywhere within a range, low and high:
            what the model may lack, ``{"string.string_mass.mass_ratio": (0, 0.1)}``.
        ball_network: moves the ball in place of string and gravity: a black-box baseline
            (:func:`diffnea.blackbox.train`), or its file. The policies say which.

    Raises:
        DataError: a reward is NaN (names iteration, sample and parameters), or the task cannot be.
        ModelError: there is no ball on a string, no cup, or no joint moves it.

    """
    if isinstance(task, str) and task not in _TASKS:
        raise Error(f"learn: task: got {task!r}; choices: {', '.join(_TASKS)}, or a Task")
    if isinstance(model, IdentifyResult):
        model = model.model
    elif not isinstance(model, Model):
        model = load_model(model)
    if controller is None:
        controller = model
    elif not isinstance(controller, Model):
        controller = load_model(controller)
    seeds = list(range(seeds) if isinstance(seeds, int) else seeds)
    if not seeds:
        raise Error("learn: seeds: there are none; give at least one")
    promp = {"bases": bases, "duration": duration, "hold": hold}
    search = ErepsOptions(
        samples=samples,
        epsilon=epsilon,
        kappa=kappa,
        iterations=iterations,
        stop_std=stop_std,
    )
    weights = {
        "epsilon": dipole,
        "lambda_q": lambda_q,
        "lambda_qd": lambda_qd,
        "lambda_slack": lambda_slack,
    }
    options: tuple[Any, ...] = (
        list(joints),
        None if start is None else np.asarray(start, dtype=np.float64),
        promp,
        search,
        weight_std,
        weights,
        law,
        rate,
        bandwidth,
        damping,
        kp,
        kd,
        _robust(robust, draws, each, quantile, vary),
        _network(ball_network),
    )
    world = _BallInCup(model, controller, string, *options)

    begin = time.monotonic()
    own = task if not isinstance(task, str) else None
    if robust and not (own is None and reward is None):
        raise Error("learn: robust: is of the task's own reward; leave out reward and task")
    with _bar(progress, len(seeds) * iterations) as report:
        if own is None and reward is None:
            if ended is not None:
                raise Error("learn: ended: the task says itself when an episode is over")
            policies = _learn(world, seeds, threads, report)
        else:
            whole = reward is not None
            rollouts = Rollouts._of(world.rollouts(own, ended, whole, threads), reward)
            policies = []
            for seed in seeds:
                policies.append(_search(world, rollouts, seed, report))
                if not policies[-1].stopped:
                    break
    interrupted = len(policies) < len(seeds) or any(not p.stopped for p in policies)
    seconds = time.monotonic() - begin
    return LearnResult(
        world.model, controller, policies, interrupted, string, threads, seconds, options
    )


def _robust(
    robust: bool,
    draws: int,
    each: int | None,
    quantile: float | None,
    vary: Mapping[str, tuple[float, float]] | None,
) -> dict[str, Any]:
    """Check what `_BallInCup` takes; {}: for the model alone."""
    if not robust:
        if each is not None or quantile is not None or vary:
            raise Error("learn: each, quantile and vary are of draws; give robust=True as well")
        return {}
    if draws < 1:
        raise Error(f"learn: draws: got {draws}, expected 1 or more")
    if each is not None and each < 1:
        raise Error(f"learn: each: got {each}, expected 1 or more")
    return {"draws": draws, "each": each or 0, "quantile": quantile, "vary": dict(vary or {})}


def _network(network: BallNetwork | StrPath | None) -> _BallNetwork | None:
    """Return it as the compiled part takes it."""
    if network is None:
        return None
    return (network if isinstance(network, BallNetwork) else BallNetwork.load(network))._compiled


def _search(world: _BallInCup, rollouts: Rollouts, seed: int, report: Progress) -> Policy:
    """Search with a task or a reward in Python; Ctrl-C ends it where it is."""
    begin, before = time.monotonic(), rollouts.count
    search = world.search(seed)
    try:
        while not search.done:
            result = rollouts.run(search.ask())
            search.tell(result.rewards, result.solved)
            history = search.history
            mean, share = history["reward_mean"][-1], history["solved_share"][-1]
            if report(seed, search.iteration, float(mean), float(share)) is False:
                break
    except KeyboardInterrupt:
        pass
    count, seconds = rollouts.count - before, time.monotonic() - begin  # of the search
    last = rollouts.run(search.policy.mean[None])
    return world.finished(
        search,
        float(last.rewards[0]),
        last.solved is not None and bool(last.solved[0]),
        count,
        seconds,
    )


@contextmanager
def _bar(progress: bool | Progress, iterations: int) -> Iterator[Progress]:
    """Yield what is called after every iteration."""
    if callable(progress):
        yield progress
        return
    try:
        if not progress:
            raise ImportError
        from tqdm.auto import tqdm
    except ImportError:
        yield lambda seed, iteration, mean, share: None
        return
    with tqdm(total=iterations, desc="learning", unit="iteration") as bar:

        def show(seed: int, iteration: int, mean: float, share: float) -> None:
            bar.update(1)
            bar.set_postfix_str(f"seed {seed}: reward {mean:.2f}, solved {100 * share:.0f} %")

        yield show
