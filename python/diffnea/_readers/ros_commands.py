"""Commands of a ROS bag, which come on a topic of their own: q desired, held until the next one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import DataError

JOINT_STATE = "sensor_msgs/msg/JointState"
#: Types whose messages command positions, by the name of each joint.
TYPES = (JOINT_STATE, "trajectory_msgs/msg/JointTrajectory")

_Events = list[tuple[int, dict[str, float]]]


def collect(
    where: str, messages: Iterator[tuple[str, int, Any]], message_type: str, clock: str
) -> _Events:
    """Return times [ns] and positions by joint, in the order of time."""
    events: _Events = []
    for _, received, message in messages:
        stamp = message.header.stamp
        header = int(stamp.sec) * 10**9 + int(stamp.nanosec)
        at = header if clock == "header" and header else received
        if message_type == JOINT_STATE:
            events.append((at, _positions(where, message.name, message.position)))
            continue
        for point in message.points:
            later = int(point.time_from_start.sec) * 10**9 + int(point.time_from_start.nanosec)
            events.append((at + later, _positions(where, message.joint_names, point.positions)))
    if not events:
        raise DataError(f"{where}: holds no command")
    events.sort(key=lambda event: event[0])
    return events


def held(
    events: _Events, joints: Sequence[str], stamps: NDArray[np.int64]
) -> dict[str, NDArray[np.float64]]:
    """Return, of each commanded joint, the command that stood at every stamp; NaN before."""
    out = {}
    for joint in joints:
        of_joint = [(at, values[joint]) for at, values in events if joint in values]
        if not of_joint:
            continue
        times = np.array([at for at, _ in of_joint], dtype=np.int64)
        values = np.array([np.nan, *(value for _, value in of_joint)])
        out[joint] = values[np.searchsorted(times, stamps, side="right")]
    return out


def _positions(where: str, names: Sequence[str], values: Any) -> dict[str, float]:
    array = np.asarray(values, dtype=np.float64)
    if array.size not in (0, len(names)):
        raise DataError(f"{where}: a command names {len(names)} joints and has {array.size} values")
    return dict(zip(names, array.tolist(), strict=False)) if array.size else {}
