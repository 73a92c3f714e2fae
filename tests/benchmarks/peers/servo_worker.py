# ruff: noqa: E501
"""Common parts of the servo fits: one process each, so that its time is its own."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from servo_cases import ServoCase, load_servo_case
from servo_pendulum import Law
from signals import Array
from worker import arguments, cpu_seconds, peak_megabytes

TIME_LIMIT = 150.0  # s of processor time, all threads, of a peer's fit


class TimeOverError(Exception):
    """The time limit passed between two evaluations."""


@dataclass
class Fit:
    law: Law
    held: bool = False  # simulates with commands held from row to row, not on the line between
    settings: str = ""
    notes: list[str] = field(default_factory=list)
    extra: dict[str, Any] = field(default_factory=dict)


@dataclass
class Progress:
    """Evaluations, processor time, and when the score was first that good."""

    began: float = field(default_factory=cpu_seconds)
    evaluations: int = 0
    best: float = np.inf
    falls: list[tuple[float, int, float]] = field(default_factory=list)  # time, evaluations, score

    def saw(self, score: float, evaluations: int = 1) -> bool:
        """Note a score, after so many more `evaluations`; return if it is the best so far."""
        self.evaluations += evaluations
        better = score < self.best
        if better:
            self.best = score
            self.falls.append((self.seconds(), self.evaluations, score))
        return better

    def seconds(self) -> float:
        return cpu_seconds() - self.began

    def over(self) -> bool:
        return self.seconds() > TIME_LIMIT

    def summary(self) -> dict[str, Any]:
        """Among others when the score came within 1 % of its last."""
        near = next((f for f in self.falls if f[2] <= 1.01 * self.best), (0.0, 0, 0.0))
        return {
            "evaluations": self.evaluations,
            "best": self.best,
            "near_seconds": near[0],
            "near_evaluations": near[1],
        }


class Scale:
    """Laws as vectors in [0, 1] between a case's bounds: sizes of unknown order by their logarithm."""

    LOGARITHMIC = ("stiffness", "reach", "armature", "speed")

    def __init__(self, case: ServoCase):
        self.start, self.low, self.high = case.start()
        names = [f.name for f in fields(Law)]
        self.names = names if case.setpoint else names[:-1]

    def unit(self, name: str, value: float) -> float:
        a, b = getattr(self.low, name), getattr(self.high, name)
        if name in self.LOGARITHMIC:
            return float(np.log(value / a) / np.log(b / a))
        return (value - a) / (b - a)

    def value(self, name: str, x: Array) -> Array:
        a, b = getattr(self.low, name), getattr(self.high, name)
        return np.asarray(a * (b / a) ** x if name in self.LOGARITHMIC else a + (b - a) * x)

    def first(self) -> Array:
        return np.array([self.unit(n, getattr(self.start, n)) for n in self.names])

    def table(self, x: Array) -> Array:
        """Laws (laws, 9) of (laws, names) in [0, 1]; what is not fitted is as in the start."""
        columns = [
            self.value(f.name, x[:, self.names.index(f.name)])
            if f.name in self.names
            else np.full(len(x), getattr(self.start, f.name))
            for f in fields(Law)
        ]
        return np.stack(columns, axis=1)

    def law(self, x: Array) -> Law:
        return Law(*map(float, self.table(x[None, :])[0]))


def main(fits: dict[str, Callable[[ServoCase, Path], Fit]]) -> None:
    """`identify_servo_TOOL CASE.json VARIANT OUT`: fit, write OUT.json; files of its own go to OUT as a folder."""
    args = arguments(fits)
    case = load_servo_case(args.case)
    wall, cpu = time.perf_counter(), cpu_seconds()
    fit = fits[args.variant](case, args.out)
    result = {
        "wall": time.perf_counter() - wall,
        "cpu": cpu_seconds() - cpu,
        "peak_mb": peak_megabytes(),
        "law": asdict(fit.law),
        "held": fit.held,
        "settings": fit.settings,
        "notes": fit.notes,
        **fit.extra,
    }
    Path(f"{args.out}.json").write_text(json.dumps(result, indent=1), encoding="utf-8")
