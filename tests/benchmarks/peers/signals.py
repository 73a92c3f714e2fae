# ruff: noqa: E501
"""The signals that all identifications are given and judged by: one recipe, none of diffnea's code.

q is resampled to a uniform grid and low-passed without phase (Butterworth, order 4, forward and backward); velocity and
acceleration are central differences of it. Torques go through the same filter, and so does every torque that is
predicted and every column of a regressor: a filtered measurement is compared with a filtered prediction.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.signal import butter, sosfiltfilt

Array = NDArray[np.float64]
EDGE = 3.0  # periods of the cutoff that the filter's ends spoil: left out on both sides
MOVING = 0.02  # share of a joint's largest speed below which it counts as at rest


@dataclass(frozen=True)
class Signals:
    """One recording, (T, n), at a uniform rate; the ends that filters spoil are still there."""

    time: Array
    q: Array
    qd: Array
    qdd: Array
    tau: Array  # low-passed like q
    raw_q: Array  # resampled, not filtered
    raw_tau: Array  # as recorded, resampled: held from its row to the next where `held` is true
    cutoff: float

    @property
    def rate(self) -> float:
        return 1.0 / (self.time[1] - self.time[0])

    def smooth(self, x: Array) -> Array:
        """The low-pass of q, on columns."""
        return low_pass(x, self.cutoff, self.rate)

    def rows(self, factor: int = 1) -> NDArray[np.int_]:
        """Rows that the filter's ends do not spoil, every `factor`-th."""
        edge = int(EDGE * self.rate / self.cutoff)
        return np.arange(edge, len(self.time) - edge, factor)

    @property
    def decimation(self) -> int:
        """Rows a fit needs: eight a period of the cutoff."""
        return max(1, int(self.rate / (8.0 * self.cutoff)))

    def moving(self) -> NDArray[np.bool_]:
        speed = np.abs(self.qd)
        return np.asarray(speed > MOVING * speed.max(axis=0))


def low_pass(x: Array, cutoff: float, rate: float) -> Array:
    sos = butter(4, cutoff, fs=rate, output="sos")
    return np.asarray(sosfiltfilt(sos, x, axis=0))


def read_columns(path: Path, joints: list[str]) -> tuple[Array, Array, Array]:
    with path.open(encoding="utf-8") as f:
        header = next(csv.reader(f))
    table = np.loadtxt(path, delimiter=",", skiprows=1, dtype=np.float64)
    column = {name: table[:, k] for k, name in enumerate(header)}
    q = np.stack([column[f"q_{j}"] for j in joints], axis=1)
    tau = np.stack([column[f"tau_{j}"] for j in joints], axis=1)
    return column["time"], q, tau


def read_signals(path: Path, joints: list[str], cutoff: float, held: bool) -> Signals:
    """`held`: a row's torque acts until the next row, so that at the row it is the mean of both sides."""
    t, q, tau = read_columns(path, joints)
    step = float(np.median(np.diff(t)))
    time = np.arange(t[0], t[-1], step)
    raw_q = np.asarray(PchipInterpolator(t, q, axis=0)(time))
    raw_tau = np.stack([np.interp(time, t, x) for x in tau.T], axis=1)
    at_row = raw_tau.copy()
    if held:
        at_row[1:] = 0.5 * (raw_tau[1:] + raw_tau[:-1])
    smooth = low_pass(raw_q, cutoff, 1.0 / step)
    qd = np.gradient(smooth, step, axis=0)
    qdd = np.gradient(qd, step, axis=0)
    return Signals(
        time, smooth, qd, qdd, low_pass(at_row, cutoff, 1.0 / step), raw_q, raw_tau, cutoff
    )


def errors(signals: Signals, predicted: Array) -> dict[str, list[float]]:
    """Root mean square torque error of each joint [N·m, N], of all rows and of those that move."""
    rows = signals.rows(signals.decimation)
    miss = (signals.tau - signals.smooth(predicted))[rows]
    moves = signals.moving()[rows]
    torque = signals.tau[rows]
    return {
        "all": np.sqrt(np.mean(miss**2, axis=0)).tolist(),
        "moving": np.sqrt(np.sum(miss**2 * moves, axis=0) / moves.sum(axis=0)).tolist(),
        "torque": np.sqrt(np.mean(torque**2, axis=0)).tolist(),
    }
