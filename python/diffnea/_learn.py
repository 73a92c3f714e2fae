"""`learn`: a movement is searched in the model."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
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
    _describe_model,
    _learn,
)
from ._files import StrPath, load_model
from ._learn_result import LearnResult
from ._policy import Task
from ._rollouts import Ended, Reward, Rollouts
from .blackbox.network import BallNetwork

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Progress: TypeAlias = Callable[[int, int, float, float], object]

_TASKS = ("ball-in-cup",)


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
    inputs = tuple(_describe_model(model))

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
                policy, go_on = _search(world, rollouts, seed, report)
                policies.append(policy)
                if not go_on:
                    break
    interrupted = len(policies) < len(seeds) or any(not p.stopped for p in policies)
    seconds = time.monotonic() - begin
    return LearnResult(
        world.model, controller, policies, interrupted, string, threads, seconds, options, inputs
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


def _search(
    world: _BallInCup, rollouts: Rollouts, seed: int, report: Progress
) -> tuple[Policy, bool]:
    """Search with a task or a reward in Python; Ctrl-C ends it where it is.

    Returns the policy, and whether searches from other seeds should follow.
    """
    begin, before, go_on = time.monotonic(), rollouts.count, True
    search = world.search(seed)
    try:
        while not search.done:
            result = rollouts.run(search.ask())
            search.tell(result.rewards, result.solved)
            history = search.history
            mean, share = history["reward_mean"][-1], history["solved_share"][-1]
            go_on = report(seed, search.iteration, float(mean), float(share)) is not False
            if not go_on:
                break
    except KeyboardInterrupt:
        go_on = False
    count, seconds = rollouts.count - before, time.monotonic() - begin  # of the search
    last = rollouts.run(search.policy.mean[None])
    policy = world.finished(
        search,
        float(last.rewards[0]),
        last.solved is not None and bool(last.solved[0]),
        count,
        seconds,
    )
    return policy, go_on


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
