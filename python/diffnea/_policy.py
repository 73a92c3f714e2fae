"""What derives from it: tasks and simulators of one's own."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from ._core import NativeSimulator

if TYPE_CHECKING:
    from typing import Self

    from numpy.typing import ArrayLike, NDArray

    Array: TypeAlias = NDArray[np.float64]
    Flags: TypeAlias = NDArray[np.bool_]


class SimulatorInfo(NamedTuple):
    """What a task is told of the simulator that it watches."""

    joints: tuple[str, ...]
    channels: tuple[str, ...]
    period: float
    lanes: int


class Channels(Mapping[str, "Array"]):
    """Arrays by channel."""

    __slots__ = ()

    def missing(self, channel: str) -> KeyError:
        """Return what to raise."""
        return KeyError(f"there is no channel {channel!r}; channels: {', '.join(self)}")


class Observation(Channels):
    """One look at worlds side by side: ``observation["ball_x"]`` is (count,)."""

    __slots__ = ("_rows", "array")

    def __init__(self, rows: dict[str, int], array: Array) -> None:
        self._rows = rows
        self.array = array
        """(channels, count)"""

    def __getitem__(self, channel: str) -> Array:
        row = self._rows.get(channel)
        if row is None:
            raise self.missing(channel)
        found: Array = self.array[row]
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)


class Task(ABC):
    """What motions are worth. Derive from it, or give :class:`Rollouts` a function of whole ones.

    Looks at a batch of worlds side by side, first at the start, then after every period. For
    several threads there are several copies, and Python lets one run at a time.
    """

    def begin(self, simulator: SimulatorInfo, count: int) -> None:  # noqa: B027
        """Before the first look at ``count`` worlds."""

    @abstractmethod
    def look(self, time: float, observation: Observation, ended: Flags) -> None:
        """See every world; set ``ended[i]`` where an episode is over, whose looks end there."""

    @abstractmethod
    def rewards(self) -> ArrayLike:
        """(count,) of the batch. −inf: never again; NaN is an error."""

    def solved(self) -> ArrayLike | None:
        """(count,) where the task was done; None where it has no such notion."""
        return None

    def clone(self) -> Self:
        """Return another one like it, for another thread."""
        return copy.deepcopy(self)


class Simulator(ABC):
    """A world that follows desired motions of its joints. Derive from it for one of your own.

    ``lanes`` worlds run side by side, one a column; what one does must not depend on the others.
    Set ``joints``, ``channels``, ``period`` [s] and ``lanes`` before use.
    """

    joints: Sequence[str]
    channels: Sequence[str]
    period: float
    lanes: int = 1

    @abstractmethod
    def reset(self, q: Array, seeds: NDArray[np.uint64]) -> None:
        """Begin at rest at ``q`` (joints, n), n ≤ lanes; ``seeds`` (n,) of each world's noise."""

    @abstractmethod
    def step(self, q: Array, qd: Array) -> None:
        """Move every world by one period; ``q``, ``qd`` (joints, lanes) are desired."""

    @abstractmethod
    def observe(self) -> ArrayLike:
        """(channels, lanes); lanes beyond the starts may hold anything."""

    def failures(self) -> Sequence[str]:
        """Why a lane cannot go on, or empty texts, (lanes); or nothing at all."""
        return ()

    def clone(self) -> Self:
        """Return another one like it, for another thread."""
        return copy.deepcopy(self)


Simulator.register(NativeSimulator)
