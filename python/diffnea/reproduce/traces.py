"""What policies did, from the result files: imagined in the model, obtained in the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._core import Model, frame_pose
from .jobs import Arrays, Json, Results
from .table1 import Row, Unit

PERIOD = 0.01  # of the stored traces [s]


@dataclass(frozen=True)
class Movement:
    """One policy: arrays (rows, …); an episode that was over has fewer rows."""

    policy: Json
    imagined: Arrays
    obtained: Arrays

    @property
    def rows(self) -> int:
        """Of what was obtained."""
        return len(self.obtained["ball"])


def movements(unit: Unit, results: Results) -> list[Movement]:
    """All policies of a unit that were executed."""
    out = []
    for learned, transfer in zip(unit.learned, unit.transfers, strict=True):
        if not (results.has(learned) and results.has(transfer)):
            continue
        imagined, found = results.read(learned).arrays, results.read(transfer)
        for k, policy in enumerate(found.data["policies"]):
            out.append(
                Movement(policy, _one(imagined, "imagined_", k), _one(found.arrays, "obtained_", k))
            )
    return out


def shown(row: Row, results: Results) -> Movement | None:
    """Return the policy to draw: of the first unit with any, the best that was obtained."""
    for unit in row.units:
        found = [m for m in movements(unit, results) if m.rows and len(m.imagined["ball"])]
        if found:
            return max(found, key=_success_then_reward)
    return None


def _success_then_reward(movement: Movement) -> tuple[bool, float]:
    reward = movement.policy["reward_wide"]
    return bool(movement.policy["success"]), -np.inf if reward is None else reward


def length_errors(row: Row, results: Results) -> dict[str, np.ndarray]:
    """By how much balls are further from the knot than they hung at first [m].

    ``imagined`` and ``obtained``, (policies, rows) each, NaN after an episode's end.
    """
    found: dict[str, list[np.ndarray]] = {"imagined": [], "obtained": []}
    for unit in row.units:
        for movement in movements(unit, results):
            for which, errors in found.items():
                trace: Arrays = getattr(movement, which)
                distance = np.linalg.norm(trace["ball"] - trace["cup"], axis=1)
                errors.append(np.maximum(0.0, distance - distance[:1]))
    return {which: _in_rows(errors) for which, errors in found.items()}


def _in_rows(series: list[np.ndarray]) -> np.ndarray:
    """(series, the longest), filled up with NaN."""
    out = np.full((len(series), max(map(len, series), default=0)), np.nan)
    for k, values in enumerate(series):
        out[k, : len(values)] = values
    return out


def arm_points(model: Model, q: np.ndarray) -> np.ndarray:
    """(rows, points, 3): the foot, the joints, the cup's frame."""
    frames = [link.name for link in model.links if link.joint or not link.parent]
    frames.append("cup")
    points = [frame_pose(model, frame, q=np.ascontiguousarray(q))[:, :3, 3] for frame in frames]
    out: np.ndarray = np.stack(points, axis=1)
    foot = out[:, 0].copy()
    foot[:, 2] = 0.0
    return np.concatenate((foot[:, None], out), axis=1)


def across(ball: np.ndarray) -> np.ndarray:
    """Horizontal unit vector (3) along which the ball moves most: x of the side view."""
    flat = ball[np.isfinite(ball).all(axis=1), :2]
    _, _, axes = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)
    x, y = axes[0]
    main = x if abs(x) > abs(y) else y
    out: np.ndarray = np.array([x, y, 0.0]) * np.sign(main or 1.0)
    return out


def _one(arrays: Arrays, prefix: str, k: int) -> dict[str, Any]:
    own = {n.removeprefix(prefix): v[k] for n, v in arrays.items() if n.startswith(prefix)}
    rows = int(np.isfinite(own["ball"]).all(axis=1).sum()) if own else 0
    return {name: values[:rows] for name, values in own.items()}
