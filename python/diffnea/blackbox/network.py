"""A trained network: its file, and what it does when it runs free."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from .._core import Error, IdentifyResult, Model, Recording, _BallNetwork
from .._files import StrPath
from .data import (
    Series,
    Window,
    blocks,
    model_of,
    recordings_of,
    series_of,
    to_link,
    windows,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .data import Recordings

    Array: TypeAlias = NDArray[np.float64]


class BallNetwork:
    """The ball's acceleration as a network has it, one network or the mean of several.

    Schema ``diffnea/ball-network/1``: numbers alone. ``diffnea.learn(ball_network=)`` learns in it.
    """

    def __init__(self, document: dict[str, Any], source: str = "") -> None:
        """From the file's content.

        Raises:
            ModelError: a key is missing, or sizes do not fit one another.

        """
        self._compiled = _BallNetwork(json.dumps(document), source or "a network in memory")

    @classmethod
    def load(cls, path: StrPath) -> BallNetwork:
        """Read a file.

        Raises:
            FileError: it cannot be read.
            ModelError: a key is missing, or sizes do not fit one another.

        """
        out = cls.__new__(cls)
        out._compiled = _BallNetwork.read(path)
        return out

    def save(self, path: StrPath) -> None:
        """Write the file: the same bytes that ``sha256`` is of."""
        self._compiled.save(path)

    def to_dict(self) -> dict[str, Any]:
        """Return the file's content."""
        document: dict[str, Any] = json.loads(self._compiled.text)
        return document

    @property
    def kind(self) -> str:
        """``ff`` or ``lstm``."""
        return str(self.to_dict()["kind"])

    @property
    def training(self) -> dict[str, Any]:
        """How it was trained: options, data, errors on what was held out."""
        return dict(self.to_dict().get("training") or {})

    @property
    def source(self) -> str:
        """File that it was read from."""
        return self._compiled.source

    @property
    def sha256(self) -> str:
        """Of the file."""
        return self._compiled.sha256

    @property
    def step(self) -> float:
        """Of time, at which it was trained and is integrated [s]."""
        return self._compiled.step

    @property
    def warm_up(self) -> float:
        """For which an LSTM sees the motion before the ball is its own [s]."""
        return self._compiled.warm_up

    def accelerations(self, inputs: Array, hidden: Array | None = None) -> tuple[Array, Array]:
        """Of the ball in L, (N, 3) [m/s²], and what an LSTM's cells then remember, (N, h).

        Args:
            inputs: (N, 18), in L: x_B − p_L, ẋ_B − ṗ_L, ω_L, ω̇_L, p̈_L, e_z.
            hidden: (N, h), as it was returned for the step before; None: nothing.

        Raises:
            ShapeError: inputs or hidden have other sizes.

        """
        return self._compiled.evaluate(inputs, hidden)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, BallNetwork) and self.sha256 == other.sha256

    def __hash__(self) -> int:
        return hash(self.sha256)

    def __repr__(self) -> str:
        document = self.to_dict()
        members, count = document["members"], 0
        for member in members:
            for layer in member["cells"] + member["layers"]:
                count += len(layer["bias"]) * (len(layer["weights"][0]) + 1)
        return f"BallNetwork({document['kind']}: {len(members)} × {count // len(members)} numbers)"


@dataclass(frozen=True)
class FreeRun:
    """How far a network's ball is off, over the time for which it ran free."""

    time: Array
    """(T,) since it is free [s]."""
    position_error: Array
    """(W, T) of W windows, ‖x_B − measured x_B‖ [m]; NaN where the camera saw nothing."""
    length_error: Array
    """(W, T), ‖x_B − x_S‖ − r, x_S and r the model's knot and string [m]: what a string that
    is taut would hold at 0."""

    def at(self, time: float) -> dict[str, float]:
        """Medians over the windows at a time [s], of absolute values [m].

        The camera is slower than the steps: a position counts where it was seen last; NaN where it
        was not seen until then.
        """
        k = int(np.argmin(np.abs(self.time - time)))
        seen = np.flatnonzero(np.isfinite(self.position_error[:, : k + 1]).any(axis=0))
        return {
            "time": float(self.time[k]),
            "position_error": float(np.nanmedian(self.position_error[:, seen[-1]]))
            if len(seen)
            else float("nan"),
            "length_error": float(np.median(np.abs(self.length_error[:, k]))),
        }

    def __repr__(self) -> str:
        end = self.at(float(self.time[-1]))
        return (
            f"FreeRun({len(self.length_error)} windows of {end['time']:.2g} s: at the end the ball"
            f" is {1e3 * end['position_error']:.0f} mm off, {1e3 * end['length_error']:.0f} mm of"
            " the string)"
        )


def free_run(
    network: BallNetwork,
    recordings: Recordings,
    model: Model | IdentifyResult | StrPath,
    *,
    seconds: float = 2.0,
    every: float = 0.5,
) -> FreeRun:
    """Run the network's ball along recorded motions of the arm, from what the camera saw.

    Args:
        network: that moves the ball.
        recordings: with a ball, or their files.
        model: whose kinematics tell where the link is.
        seconds: of each window [s].
        every: a window begins, on what was recorded [s].

    Raises:
        Error: no recording has a ball, joints are not the model's, its ball hangs on no string, or
            there is no stretch as long as a window.

    """
    series = series_of(recordings_of(recordings), model_of(model), network.step)
    train, held_out = blocks(series, 1e9)
    return run_windows(network, series, train + held_out, seconds, every)


def run_windows(
    network: BallNetwork,
    series: Sequence[Series],
    within: Sequence[Window],
    seconds: float,
    every: float,
) -> FreeRun:
    """Run it free in all windows of blocks of time."""
    h = network.step
    warm, rows = round(network.warm_up / h), round(seconds / h)
    chosen = windows(within, warm + rows, max(1, round(every / h)))
    if not chosen:
        raise Error(f"blackbox: no stretch of {seconds + network.warm_up:.3g} s has arm and ball")
    inputs = [x.link_inputs() for x in series]

    def at(name: str, k: int) -> Array:
        return np.stack([getattr(series[w.series], name)[w.begin + k] for w in chosen])

    x, v = at("ball", 0), at("ball_velocity", 0)
    hidden: Array | None = None
    position: list[Array] = []
    length: list[Array] = []
    lengths = np.array([series[w.series].length for w in chosen])
    for k in range(warm + rows):
        if k <= warm:
            x, v = at("ball", k), at("ball_velocity", k)
        if k >= warm:
            position.append(_norm(x - at("seen", k)))
            length.append(_norm(x - at("knot", k)) - lengths)
        rotation = at("rotation", k)
        relative = [
            to_link(rotation, x - at("position", k)),
            to_link(rotation, v - at("velocity", k)),
        ]
        link = np.stack([inputs[w.series][w.begin + k] for w in chosen])
        a, hidden = network.accelerations(np.concatenate([*relative, link], axis=1), hidden)
        v = v + h * np.einsum("tij,tj->ti", rotation, a)
        x = x + h * v
    return FreeRun(
        h * np.arange(rows, dtype=np.float64), np.stack(position, axis=1), np.stack(length, axis=1)
    )


def _norm(x: Array) -> Array:
    return np.asarray(np.linalg.norm(x, axis=1), dtype=np.float64)


def names_of(recordings: Sequence[Recording]) -> list[str]:
    """Return the files' names, without folders."""
    return [Path(x.source).name for x in recordings]
