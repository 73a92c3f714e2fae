"""Rollouts of a primitive in any world."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ._core import (
    BallInCupTask,
    Error,
    Model,
    NativeSimulator,
    Promp,
    ShapeError,
    _Rollouts,
    _world_file,
    _world_simulator,
)
from ._files import StrPath, load_model
from ._policy import Channels, Observation, Simulator, Task
from ._simulate import _with_path

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array: TypeAlias = NDArray[np.float64]
    Flags: TypeAlias = NDArray[np.bool_]


def _float64(x: ArrayLike) -> Array:
    out: Array = np.asarray(x, dtype=np.float64)
    return out


class RolloutSeries(Channels):
    """Whole rollouts: ``rollouts["ball_x"]`` is (N, T), one rollout a row.

    After the end of an episode its last row is repeated; ``rows`` and ``mask`` tell.
    """

    def __init__(
        self,
        channels: Sequence[str],
        array: Array,
        rows: NDArray[np.int_],
        theta: Array,
        time: Array,
    ) -> None:
        self._index = {name: k for k, name in enumerate(channels)}
        self.array = array
        """(channels, N, T)"""
        self.rows = rows
        """(N,) looks at each rollout until its episode ended."""
        self.theta = theta
        """(N, d) parameters."""
        self.time = time
        """(T,) [s]"""

    @property
    def mask(self) -> Flags:
        """(N, T): the episode went on."""
        out: Flags = np.arange(len(self.time)) < self.rows[:, None]
        return out

    def __getitem__(self, channel: str) -> Array:
        row = self._index.get(channel)
        if row is None:
            raise self.missing(channel)
        found: Array = self.array[row]
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._index)

    def __len__(self) -> int:
        return len(self._index)

    def __repr__(self) -> str:
        _, count, looks = self.array.shape
        return f"RolloutSeries({count} rollouts, {looks} looks, channels {', '.join(self)})"


class RolloutTrace(Channels):
    """One rollout until its episode ended: ``trace["ball_x"]`` is (T,).

    There are no rows where the motion breaks a limit, which ``failure`` then names.
    """

    def __init__(
        self,
        time: Array,
        channels: tuple[str, ...],
        array: Array,
        q_desired: Array,
        reward: float,
        solved: bool,
        failure: str,
    ) -> None:
        self.time = time
        """(T,) [s]"""
        self.channels = channels
        self.array = array
        """(T, channels)"""
        self.q_desired = q_desired
        """(T, joints) [rad]"""
        self.reward = reward
        self.solved = solved
        self.failure = failure
        """Why there is no more of it; empty: nothing went wrong."""

    def __getitem__(self, channel: str) -> Array:
        if channel not in self.channels:
            raise self.missing(channel)
        found: Array = self.array[:, self.channels.index(channel)]
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self.channels)

    def __len__(self) -> int:
        return len(self.channels)

    def points(self, name: str) -> Array:
        """(T, 3) of ``ball``, ``cup`` or ``axis``."""
        return np.stack([self[f"{name}_{axis}"] for axis in "xyz"], axis=1)

    def __repr__(self) -> str:
        end = f", {self.failure}" if self.failure else ""
        return f"RolloutTrace({len(self.time)} looks, reward {self.reward:.4g}{end})"


Reward: TypeAlias = Callable[[RolloutSeries], "ArrayLike"]
Ended: TypeAlias = Callable[[Observation], "ArrayLike"]


@dataclass(frozen=True, repr=False)
class RolloutResult:
    """What rollouts were worth."""

    rewards: Array
    """(N,); −inf where the simulator failed; below −1 where a motion broke a limit."""
    solved: Flags | None
    """(N,), or None where the task has no such notion."""
    failures: list[str]
    """(N,) of the simulator, empty where none."""

    def __repr__(self) -> str:
        failed = sum(1 for text in self.failures if text)
        solved = "" if self.solved is None else f", {int(self.solved.sum())} solved"
        return f"RolloutResult({len(self.rewards)} rollouts{solved}, {failed} failed)"


class Rollouts:
    """Motions of a primitive in a simulator, many at once, and what they are worth.

    What one is worth depends neither on the others nor on the number of threads.
    """

    def __init__(
        self,
        simulator: Simulator | NativeSimulator,
        promp: Promp,
        *,
        task: Task | BallInCupTask | None = None,
        reward: Reward | None = None,
        ended: Ended | None = None,
        start: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        threads: int = 1,
    ) -> None:
        """Prepare rollouts; the simulator is copied.

        Args:
            simulator: the library's, or one that derives from :class:`Simulator`.
            promp: the primitive; names joints of the simulator, the others keep their start.
            task: says what rollouts are worth and when an episode is over.
            reward: in place of the task's: a function of whole rollouts, ``rollouts["ball_x"]``
                is (N, T), that returns (N,). Only rollouts that neither break a limit nor fail.
            ended: with ``reward``: a function of one look, ``observation["ball_x"]`` is (count,),
                that returns where the episode is over.
            start: q_0 (joints,) [rad]; default: 0.
            lower: limits (joints,) of desired positions [rad]; default: none.
            upper: the same.
            velocity: limits (joints,) of desired speeds [rad/s]; default: none.
            threads: of the simulator; functions in Python run one at a time.

        """
        if ended is not None and reward is None:
            raise Error("Rollouts: ended: a task says itself when an episode is over")
        n = len(simulator.joints)
        none = np.full(n, np.inf)
        self._adopt(
            _Rollouts(
                simulator,
                promp,
                task,
                ended,
                reward is not None,
                np.zeros(n) if start is None else start,
                -none if lower is None else lower,
                none if upper is None else upper,
                none if velocity is None else velocity,
                threads,
            ),
            reward,
        )

    def _adopt(self, rollouts: _Rollouts, reward: Reward | None) -> None:
        self._rollouts = rollouts
        self._reward = reward

    @classmethod
    def _of(cls, rollouts: _Rollouts, reward: Reward | None) -> Rollouts:
        out = cls.__new__(cls)
        out._adopt(rollouts, reward)
        return out

    @property
    def promp(self) -> Promp:
        """The primitive."""
        return self._rollouts.promp

    @property
    def channels(self) -> list[str]:
        """Of the simulator."""
        return self._rollouts.channels

    @property
    def count(self) -> int:
        """Rollouts executed so far."""
        return self._rollouts.count

    def run(self, theta: ArrayLike, seeds: Sequence[int] | None = None) -> RolloutResult:
        """Execute one rollout a row of ``theta`` (N, d); ``seeds`` (N,) of each world's noise."""
        if self._reward is None:
            return RolloutResult(*self._rollouts.run(theta, seeds))
        rewards, solved, failures, index, rows, values = self._rollouts.record(theta, seeds)
        if len(index):
            series = RolloutSeries(
                self.channels,
                values,
                rows,
                _float64(theta)[index],
                _float64(np.arange(values.shape[2]) * self._rollouts.period),
            )
            rewards[index] = self._judge(series)
        return RolloutResult(rewards, solved, failures)

    def _judge(self, series: RolloutSeries) -> Array:
        assert self._reward is not None
        found = _float64(self._reward(series))
        if found.shape != series.rows.shape:
            raise ShapeError(
                f"reward: it returned an array of shape {found.shape}, expected"
                f" {series.rows.shape}: one number a rollout"
            )
        return found

    def trace(self, theta: ArrayLike, seed: int = 0) -> RolloutTrace:
        """Execute one rollout, ``theta`` (d,), and keep all that was seen."""
        trace = RolloutTrace(*self._rollouts.trace(theta, seed))
        if self._reward is not None:
            result = self.run(_float64(theta)[None], [seed])
            trace.reward = float(result.rewards[0])
        return trace

    def __repr__(self) -> str:
        return f"Rollouts({self.promp!r}, {self.count} executed)"


def world_simulator(
    world: str,
    *,
    controller: Model | StrPath | None = None,
    seed: int = 0,
    lanes: int = 1,
    bandwidth: float = 25.0,
    kp: ArrayLike | None = None,
    kd: ArrayLike | None = None,
) -> NativeSimulator:
    """MuJoCo as a world for :class:`Rollouts`: ``mujoco:NAME[,key=value…]``, see :func:`worlds`.

    Args:
        world: the robot, which may differ from its description.
        controller: the model that the controller knows; default: the description itself.
        seed: of the perturbation; the world's own ``seed=`` comes first.
        lanes: worlds of a batch.
        bandwidth: of gains that are not given [rad/s].
        kp: gains (n,) [N·m/rad].
        kd: gains (n,) [N·m·s/rad].

    """
    name = _with_path(world)
    if controller is None:
        controller = load_model(_world_file(name))
    elif not isinstance(controller, Model):
        controller = load_model(controller)
    return _world_simulator(name, controller, seed, lanes, bandwidth, kp, kd)
