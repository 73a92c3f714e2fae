# ruff: noqa: E501
"""A pendulum behind a position servo, many runs and many candidate laws at once, in NumPy.

    J q̈ = K clip(s (c(t - d) - q), ±r) - B q̇ - b q̇ - F_c sign(q̇) - offset - m g l sin q,   |ċ| ≤ v

K, r, B and v act while the drive is on; s is the run's gain. Dry friction is a stop: it takes all momentum of a step, up
to F_c dt (true sticking). Semi-implicit Euler, viscous terms implicit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
from signals import Array

GRAVITY = 9.81  # m/s²
BEGINNING = 0.1  # s, whose parabola gives a run's first state


@dataclass(frozen=True)
class Law:
    """The parameters of a servo that are fitted."""

    stiffness: float  # K [N·m/rad] of a gain of 1
    reach: float  # r, an error times gain [rad]
    damping: float  # B [N·m·s/rad], while the drive is on
    viscous: float  # b [N·m·s/rad]
    coulomb: float  # F_c [N·m]
    armature: float  # inertia of the rotor [kg·m²]
    offset: float  # N·m, against positive motion
    delay: float  # d [s]
    speed: float = np.inf  # v of the setpoint [rad/s]


@dataclass(frozen=True)
class Pendulum:
    """The load, which all know; q = 0 hangs down."""

    mass: float  # kg
    length: float  # m, from the axis to the center of mass
    about_com: float  # kg·m²

    @property
    def inertia(self) -> float:
        return self.mass * self.length**2 + self.about_com

    @property
    def weight(self) -> float:
        """Torque when horizontal [N·m]."""
        return self.mass * GRAVITY * self.length


@dataclass(frozen=True)
class Run:
    """One recording, rows of any spacing, from time 0; NaN where a position was not read."""

    name: str
    time: Array
    command: Array
    on: Array  # 1 while the drive is on, else 0
    q: Array
    gain: float
    pendulum: Pendulum

    def grid(self, step: float) -> Array:
        return np.asarray(step * np.arange(int(self.time[-1] / step) + 1))

    def positions(self, time: Array) -> Array:
        read = np.isfinite(self.q)
        return np.interp(time, self.time[read], self.q[read])

    def enabled(self, time: Array) -> Array:
        """Switch of the drive, held from row to row."""
        rows = np.searchsorted(self.time, time + 1e-9, side="right") - 1
        return np.asarray(self.on[np.maximum(rows, 0)])

    def commands(self, time: Array, held: bool) -> Array:
        """Held from row to row, or on the line between rows, which has a derivative by the delay."""
        if held:
            rows = np.searchsorted(self.time, time + 1e-9, side="right") - 1
            return np.asarray(self.command[np.maximum(rows, 0)])
        return np.interp(time, self.time, self.command)

    def first_state(self) -> tuple[float, float]:
        read = (self.time < BEGINNING) & np.isfinite(self.q)
        _, slope, start = np.polyfit(self.time[read], self.q[read], 2)
        return float(start), float(slope)

    def error(self, time: Array, simulated: Array) -> float:
        """Mean |simulated - measured| over the rows that were read [rad]."""
        read = np.isfinite(self.q)
        return float(np.mean(np.abs(np.interp(self.time, time, simulated) - self.q)[read]))


class Bench:
    """Runs on a common grid of time, ready to be simulated under many laws."""

    def __init__(self, runs: Sequence[Run], step: float, held: bool = False):
        self.runs, self.step, self.held = runs, step, held
        self.time = max((r.grid(step) for r in runs), key=len)
        self.on = np.stack([r.enabled(self.time) for r in runs], axis=1)
        self.gain = np.array([r.gain for r in runs])
        self.inertia = np.array([r.pendulum.inertia for r in runs])
        self.weight = np.array([r.pendulum.weight for r in runs])
        self.first = np.array([r.first_state() for r in runs]).T
        self.q = np.stack(
            [np.where(self.time <= r.time[-1], r.positions(self.time), np.nan) for r in runs], axis=1
        )  # fmt: skip

    def simulate(self, laws: Array) -> Array:
        """Positions (time, laws, runs) of laws (laws, 9) in the order of `Law`."""
        k, reach, brake, viscous, dry, rotor, offset, delay, speed = (x[:, None] for x in laws.T)
        h = self.step
        late = np.unique(delay)
        told = {
            d: np.stack([r.commands(self.time - d, self.held) for r in self.runs], axis=1) for d in late
        }  # fmt: skip
        command = np.stack([told[d] for d in delay[:, 0]], axis=1)
        # All torques as changes of velocity in a step.
        per_step = h / (self.inertia + rotor)
        slope, bound = k * self.gain * per_step, k * reach * per_step
        weight, push, stop = self.weight * per_step, offset * per_step, dry * per_step
        free = 1.0 / (1.0 + viscous * per_step)
        braked = 1.0 / (1.0 + (viscous + brake) * per_step) - free
        fastest = h * speed if np.isfinite(speed).any() else None
        q, v = np.empty_like(bound), np.empty_like(bound)
        q[:], v[:] = self.first[0], self.first[1]
        out, setpoint = np.empty((len(self.time), *q.shape)), command[0]
        for row in range(len(self.time)):
            out[row] = q
            told_now = command[row]
            if fastest is not None:
                setpoint = setpoint + np.minimum(np.maximum(told_now - setpoint, -fastest), fastest)
                told_now = setpoint
            drive = told_now - q
            drive *= slope
            np.minimum(drive, bound, out=drive)
            np.maximum(drive, -bound, out=drive)
            drive *= self.on[row]
            v += drive
            v -= weight * np.sin(q)
            v -= push
            v -= np.minimum(np.maximum(v, -stop), stop)
            v *= free + braked * self.on[row]
            q += h * v
        return out

    def scores(self, laws: Array) -> Array:
        """Mean absolute error of each law [rad], the mean over runs; BAM's objective."""
        miss = np.abs(self.simulate(laws) - self.q[:, None, :])
        return np.asarray(np.nanmean(miss, axis=0).mean(axis=1))


def errors(runs: Sequence[Run], law: Law, step: float, held: bool) -> list[float]:
    """Mean absolute error of each run at the rows that were read [rad]."""
    bench = Bench(runs, step, held)
    simulated = bench.simulate(np.array([astuple(law)]))[:, 0, :]
    return [r.error(bench.time, q) for r, q in zip(runs, simulated.T, strict=True)]
