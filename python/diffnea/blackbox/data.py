"""What a network sees: the motion of the string's link and of the ball, on a grid of its own."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from .._core import Error, IdentifyResult, Model, Recording, frame_motion
from .._files import StrPath, load_model, read_recordings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]
    Recordings: TypeAlias = Recording | StrPath | Sequence[Recording | StrPath]

# Half-widths of the local polynomials [s]. A joint's encoder gives 30 samples in 60 ms at 500 Hz:
# noise of 0.1 mrad leaves 5 mrad/s. A camera of 100 Hz gives 20 in 0.2 s: noise of 1.5 mm leaves
# 10 mm/s, and what a cubic cannot follow of a ball that swings at 5 rad/s is below 1 mm/s.
_JOINT_WINDOW = 0.03
_BALL_WINDOW = 0.1
_DEGREE = 3

INPUTS = 18


@dataclass(frozen=True)
class Series:
    """One recording on a grid of constant step; everything in W, NaN where nothing is known."""

    step: float
    rotation: Array
    """(T, 3, 3), R_WL of the link that the string hangs on."""
    position: Array
    """(T, 3) of its origin [m]."""
    velocity: Array
    angular_velocity: Array
    ball: Array
    """(T, 3) smoothed [m]."""
    ball_velocity: Array
    ball_acceleration: Array
    seen: Array
    """(T, 3) as the camera had it."""
    knot: Array
    """(T, 3) of the string, as the model has it [m]: for figures alone, no network sees it."""
    length: float
    """Of the string, as the model has it [m]: for figures alone."""

    def __len__(self) -> int:
        return len(self.ball)

    def known(self) -> NDArray[np.bool_]:
        """(T,) rows of which everything smooth is known, and of the link at the next one too."""
        whole = np.concatenate(
            [self.position, self.angular_velocity, self.ball, self.ball_acceleration], axis=1
        )
        known: NDArray[np.bool_] = np.isfinite(whole).all(axis=1)
        known[:-1] &= known[1:]
        known[-1] = False
        return known

    def link_inputs(self) -> Array:
        """(T, 12): the inputs that do not depend on the ball, in L; NaN in the last row."""
        up = np.broadcast_to([0.0, 0.0, 1.0], self.position.shape)
        columns = (
            self.angular_velocity,
            _change(self.angular_velocity, self.step),
            _change(self.velocity, self.step),
            up,
        )
        return np.concatenate([to_link(self.rotation, x) for x in columns], axis=1)


def to_link(rotation: Array, x: Array) -> Array:
    """R_WLᵀ x, row by row."""
    return np.asarray(np.einsum("tij,ti->tj", rotation, x), dtype=np.float64)


def _change(x: Array, step: float) -> Array:
    """(x_k+1 − x_k) / h: over the step that begins at k."""
    out = np.full_like(x, np.nan)
    out[:-1] = np.diff(x, axis=0) / step
    return out


def model_of(model: Model | IdentifyResult | StrPath) -> Model:
    """Return it, a fit's, or one from a file."""
    if isinstance(model, IdentifyResult):
        return model.model
    return model if isinstance(model, Model) else load_model(model)


def recordings_of(data: Recordings) -> list[Recording]:
    """Return them all, from memory or from files."""
    out: list[Recording] = []
    for x in [data] if isinstance(data, Recording | str | os.PathLike) else data:
        out.extend([x] if isinstance(x, Recording) else read_recordings(x))
    return out


def series_of(recordings: Sequence[Recording], model: Model, step: float) -> list[Series]:
    """Every recording that has a ball, on the grid."""
    link, knot, length = _string(model)
    out = []
    for recording in recordings:
        if recording.ball is None:
            continue
        if list(recording.joint_names) != model.joint_names:
            raise Error(
                f"{recording.source}: its joints {recording.joint_names} are not those of the"
                f" model, {model.joint_names}"
            )
        out.append(_series(recording, model, link, knot, length, step))
    if not out:
        raise Error("blackbox: no recording has a ball (columns ball_x, ball_y, ball_z)")
    return out


def _string(model: Model) -> tuple[str, Array, float]:
    """Return the moving link that the string hangs on, the knot in it, and the string's length."""
    ball: dict[str, Any] = model.to_dict().get("ball") or {}
    if "string" not in ball:
        raise Error(f"{model.name}: its ball hangs on no string")
    links = {link.name: link for link in model.links}
    name = held = ball["string"]["link"]
    while name in links and links[name].type == "fixed":
        name = links[name].parent
    if name not in links:
        raise Error(f"{model.name}: its ball hangs on {held!r}, which does not move")
    zero = np.zeros(model.num_joints)
    X_WL = frame_motion(model, name, q=zero, qd=zero, qdd=zero).pose  # noqa: N806
    X_WH = frame_motion(model, held, q=zero, qd=zero, qdd=zero).pose  # noqa: N806
    knot = np.linalg.solve(X_WL, X_WH @ [*ball["string"]["attachment"], 1.0])[:3]
    return name, knot, float(ball["string"]["length"])


def _series(
    recording: Recording, model: Model, link: str, knot: Array, length: float, step: float
) -> Series:
    time = recording.time
    at = time[0] + step * np.arange(int((time[-1] - time[0]) / step + 1e-6) + 1)
    q, qd, qdd = local_polynomial(time, recording.q, at, _JOINT_WINDOW)
    held = np.nan_to_num(np.stack([q, qd, qdd]))  # rows without data are made NaN below
    motion = frame_motion(model, link, q=held[0], qd=held[1], qdd=held[2])
    gap = ~np.isfinite(qd).all(axis=1)
    rotation, position = motion.pose[:, :3, :3].copy(), motion.pose[:, :3, 3].copy()
    velocity, turning = motion.velocity.copy(), motion.angular_velocity.copy()
    for x in (rotation, position, velocity, turning):
        x[gap] = np.nan
    measured = recording.ball
    assert measured is not None
    there = np.isfinite(measured).all(axis=1)
    ball = local_polynomial(time[there], measured[there], at, _BALL_WINDOW)
    seen = np.full((len(at), 3), np.nan)
    rows = np.rint((time[there] - time[0]) / step).astype(int)
    near = (np.abs(time[there] - time[0] - rows * step) < 0.1 * step) & (rows < len(at))
    seen[rows[near]] = measured[there][near]
    return Series(
        step=step,
        rotation=rotation,
        position=position,
        velocity=velocity,
        angular_velocity=turning,
        ball=ball[0],
        ball_velocity=ball[1],
        ball_acceleration=ball[2],
        seen=seen,
        knot=position + rotation @ knot,
        length=length,
    )


def local_polynomial(
    time: Array, values: Array, at: Array, half_width: float, degree: int = _DEGREE
) -> tuple[Array, Array, Array]:
    """Value, first and second derivative (T, n) at ``at`` (T,) of cubics fitted around each.

    What Savitzky and Golay (1964) do on an even grid, on samples with gaps. Ends are one-sided; NaN
    where the samples within ``half_width`` do not tell a polynomial, or lie to one side of a gap.
    """
    first = np.searchsorted(time, at - half_width, side="left")
    count = np.searchsorted(time, at + half_width, side="right") - first
    most = int(count.max(initial=0))
    out = [np.full((len(at), values.shape[1]), np.nan) for _ in range(3)]
    inner = (at >= time[0] + half_width) & (at <= time[-1] - half_width) if len(time) else at > at
    for begin in range(0, len(at), 2000):  # a few MB at a time
        rows = np.arange(begin, min(begin + 2000, len(at)))
        index = first[rows, None] + np.arange(most)
        used = np.arange(most) < count[rows, None]
        index = np.minimum(index, max(len(time) - 1, 0))
        t = np.where(used, (time[index] - at[rows, None]) / half_width, 0.0)
        enough = count[rows] > degree + 2
        spread = np.where(used, t, 0.0)
        inside = inner[rows]
        enough &= ~inside | (
            (spread.max(axis=1, initial=0.0) > 0.5) & (spread.min(axis=1, initial=0.0) < -0.5)
        )
        powers = np.where(used[:, :, None], t[:, :, None] ** np.arange(degree + 1), 0.0)
        rows, powers, index = rows[enough], powers[enough], index[enough]
        if not len(rows):
            continue
        normal = np.einsum("tki,tkj->tij", powers, powers)
        right = np.einsum("tki,tkn->tin", powers, values[index])
        c = np.linalg.solve(normal, right)
        for order, scale in ((0, 1.0), (1, 1.0 / half_width), (2, 2.0 / half_width**2)):
            out[order][rows] = c[:, order] * scale
    return out[0], out[1], out[2]


@dataclass(frozen=True)
class Window:
    """Rows of a series that follow one another, all of them known."""

    series: int
    begin: int
    end: int


def blocks(all_series: Sequence[Series], seconds: float) -> tuple[list[Window], list[Window]]:
    """Blocks of time for training, and every fifth, which training never sees."""
    train: list[Window] = []
    held_out: list[Window] = []
    for number, series in enumerate(all_series):
        rows = max(1, round(seconds / series.step))
        known = np.concatenate([[False], series.known(), [False]]).astype(int)
        begins, ends = np.flatnonzero(np.diff(known) == 1), np.flatnonzero(np.diff(known) == -1)
        for begin, end in zip(begins, ends, strict=True):
            for k, at in enumerate(range(int(begin), int(end), rows)):
                window = Window(number, at, min(at + rows, int(end)))
                (held_out if k % 5 == 4 else train).append(window)
    return train, held_out


def windows(within: Sequence[Window], rows: int, stride: int) -> list[Window]:
    """All of so many rows, a stride apart."""
    return [
        Window(block.series, at, at + rows)
        for block in within
        for at in range(block.begin, block.end - rows + 1, stride)
    ]
