"""Shares and means of policies that are not independent: those of one model share its faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

DRAWS = 4000
Z95 = 1.959964


@dataclass(frozen=True)
class Interval:
    """A figure, and its 95 % interval."""

    value: float
    low: float
    high: float

    def to_dict(self) -> dict[str, float]:
        """Plain values."""
        return {"value": self.value, "low": self.low, "high": self.high}


def wilson(k: int, n: int) -> Interval:
    """Share k of n that are independent (Wilson 1927)."""
    if n == 0:
        return Interval(float("nan"), 0.0, 1.0)
    p, zz = k / n, Z95**2
    middle = (p + zz / (2 * n)) / (1 + zz / n)
    half = Z95 / (1 + zz / n) * np.sqrt(p * (1 - p) / n + zz / (4 * n * n))
    return Interval(p, max(0.0, middle - half), min(1.0, middle + half))


def bootstrap(groups: Sequence[Sequence[float]], seed: int = 0) -> Interval:
    """Mean of all values; whole groups are drawn anew, and then values in each of them.

    With one group the interval knows nothing of what another would have given.
    """
    arrays = [np.asarray(group, dtype=np.float64) for group in groups if len(group)]
    if not arrays:
        return Interval(float("nan"), float("nan"), float("nan"))
    rng = np.random.default_rng(seed)
    chosen = rng.integers(len(arrays), size=(DRAWS, len(arrays)))
    low, high = np.quantile(_means(arrays, chosen, rng), (0.025, 0.975))
    return Interval(float(np.concatenate(arrays).mean()), float(low), float(high))


def difference(
    before: Sequence[Sequence[float]], after: Sequence[Sequence[float]], seed: int = 0
) -> Interval:
    """Mean of all values after less that of all before; the groups are the same, values are not.

    Groups are drawn anew together, and then values in each of them.
    """
    if not before:
        return Interval(float("nan"), float("nan"), float("nan"))
    rng = np.random.default_rng(seed)
    chosen = rng.integers(len(before), size=(DRAWS, len(before)))
    arrays = [[np.asarray(g, dtype=np.float64) for g in groups] for groups in (before, after)]
    value = np.concatenate(arrays[1]).mean() - np.concatenate(arrays[0]).mean()
    gains = _means(arrays[1], chosen, rng) - _means(arrays[0], chosen, rng)
    low, high = np.quantile(gains, (0.025, 0.975))
    return Interval(float(value), float(low), float(high))


def _means(
    arrays: Sequence[np.ndarray], chosen: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """(draws,) of the chosen groups (draws, groups), values of each drawn anew."""
    sums, counts = np.zeros(chosen.shape), np.zeros(chosen.shape)
    for g, values in enumerate(arrays):
        here = chosen == g
        drawn = rng.integers(len(values), size=(int(here.sum()), len(values)))
        sums[here] = values[drawn].sum(axis=1)
        counts[here] = len(values)
    means: np.ndarray = sums.sum(axis=1) / counts.sum(axis=1)
    return means


def share(groups: Sequence[Sequence[bool]]) -> Interval:
    """Share of all; the wider of the bootstrap over groups and of Wilson's.

    Where all succeed, or none, a bootstrap has no width.
    """
    flat = [bool(value) for group in groups for value in group]
    simple = wilson(sum(flat), len(flat))
    if not flat:
        return simple
    grouped = bootstrap([[float(v) for v in group] for group in groups])
    return Interval(simple.value, min(simple.low, grouped.low), max(simple.high, grouped.high))


def best(rows: Sequence[dict[str, object]], by: str, count: int = 10) -> list[dict[str, object]]:
    """Return the rows of one model that have most of ``by``; those that lack it come last."""

    def value(row: dict[str, object]) -> float:
        found = row[by]
        return float(found) if isinstance(found, int | float) else -np.inf

    return sorted(rows, key=value, reverse=True)[:count]
