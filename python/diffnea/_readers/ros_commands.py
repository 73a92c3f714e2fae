"""Commands of a ROS bag, which come on a topic of their own, each held until the next one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import DataError

JOINT_STATE = "sensor_msgs/msg/JointState"
#: Types whose messages command positions, by the name of each joint.
TYPES = (JOINT_STATE, "trajectory_msgs/msg/JointTrajectory")

#: Fields of a command beside positions, and the series that they are.
_BESIDE = {"velocity": "qdcmd", "velocities": "qdcmd", "effort": "taucmd"}

_SERIES = ("qdcmd", "taucmd")

#: Times [ns] and values by column.
Events = list[tuple[int, dict[str, float]]]


def collect(
    where: str, messages: Iterator[tuple[str, int, Any]], message_type: str, clock: str
) -> Events:
    """Return times [ns] and values by column (``qcmd_JOINT`` …), in the order of time."""
    events: Events = []
    for _, received, message in messages:
        stamp = message.header.stamp
        header = int(stamp.sec) * 10**9 + int(stamp.nanosec)
        at = header if clock == "header" and header else received
        if message_type == JOINT_STATE:
            events.append((at, _values(where, message.name, message, "position")))
            continue
        for point in message.points:
            later = int(point.time_from_start.sec) * 10**9 + int(point.time_from_start.nanosec)
            events.append((at + later, _values(where, message.joint_names, point, "positions")))
    if not events:
        raise DataError(f"{where}: holds no command")
    events.sort(key=lambda event: event[0])
    return events


def held(
    events: Events, joints: Sequence[str], stamps: NDArray[np.int64]
) -> dict[str, NDArray[np.float64]]:
    """Return, of each column of these joints, what stood at every stamp; NaN before the first."""
    out = {}
    for column in [f"{series}_{joint}" for joint in joints for series in ("qcmd", *_SERIES)]:
        of_column = [(at, values[column]) for at, values in events if column in values]
        if not of_column:
            continue
        if not column.startswith("qcmd_") and not any(value for _, value in of_column):
            continue  # drivers fill what they do not command with zeros
        times = np.array([at for at, _ in of_column], dtype=np.int64)
        values = np.array([np.nan, *(value for _, value in of_column)])
        out[column] = values[np.searchsorted(times, stamps, side="right")]
    return out


def _values(where: str, names: Sequence[str], message: Any, positions: str) -> dict[str, float]:
    out: dict[str, float] = {}
    for field, series in {positions: "qcmd", **_BESIDE}.items():
        array = np.asarray(getattr(message, field, ()), dtype=np.float64)
        if array.size not in (0, len(names)):
            raise DataError(
                f"{where}: a command names {len(names)} joints and has {array.size} values"
            )
        columns = [f"{series}_{name}" for name in names]
        out |= dict(zip(columns, array.tolist(), strict=False)) if array.size else {}
    return out
