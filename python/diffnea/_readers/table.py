"""Columns of a recording, on their way to the reader of CSV files."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import DataError

_OF_JOINTS = ("q", "qd", "qdd", "qcmd", "qdcmd", "taucmd", "tau")
# Series with axes in place of joints: the prefix of their columns, and the axes.
OF_AXES = {
    "ball": ("ball", ("x", "y", "z")),
    "spin": ("spin", ("x", "y", "z")),
    "base": ("base", ("x", "y", "z", "qx", "qy", "qz", "qw")),
    "base_twist": ("base", ("wx", "wy", "wz", "vx", "vy", "vz")),
    "base_wrench": ("base", ("tx", "ty", "tz", "fx", "fy", "fz")),
}


@dataclass(frozen=True)
class Selection:
    """What to take of a file that holds more than one recording: of the messages in a bag."""

    topic: str | None = None
    clock: str = "header"
    joints: Sequence[str] = ()
    command_topic: str | None = None

    def refuse(self, path: Path, format_name: str) -> None:
        """Raise DataError if something was selected that the format does not have."""
        given = {
            "topic": self.topic,
            "command_topic": self.command_topic,
            "joints": self.joints,
        }
        asked = [name for name, value in given.items() if value]
        asked += ["clock"] if self.clock != "header" else []
        if asked:
            raise DataError(
                f"{path}: {', '.join(asked)}: only ROS bags have them; this is {format_name}"
            )


@dataclass(frozen=True)
class Table:
    """A recording as a CSV file would hold it, and what reading it brought up."""

    write: Callable[[Path], None]
    notes: list[str] = field(default_factory=list)


def table_of_columns(
    where: object, columns: Mapping[str, NDArray[Any]], notes: Sequence[str] = ()
) -> Table:
    """Make a table of columns (N,); NaN is a gap. Raises DataError if their lengths differ."""
    lengths = {key: len(values) for key, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise DataError(f"{where}: arrays of different lengths: {lengths}")

    def write(file: Path) -> None:
        with file.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(columns)
            for row in zip(*(values.tolist() for values in columns.values()), strict=True):
                writer.writerow("" if x != x else x for x in row)

    return Table(write, list(notes))


def table_of_arrays(where: object, arrays: Mapping[str, Any]) -> Table:
    """Make a table of ``time`` (N,), ``q``, ``tau``, … (N, n) and ``joint_names``.

    Or of columns (N,) by their names in a recording file; what else there is, is left out with a
    note.
    """
    if "time" not in arrays:
        there = ", ".join(arrays) or "nothing"
        raise DataError(
            f"{where}: holds no time; expected arrays time, q, tau and joint_names, or the columns "
            f"of a recording file by name. There is: {there}"
        )
    arrays = dict(arrays)
    time = arrays["time"] = _vector(where, "time", arrays["time"])
    if "joint_names" not in arrays:
        for key in _OF_JOINTS:
            if key in arrays:
                raise DataError(
                    f"{where}: {key}: whose columns they are is not said; add joint_names"
                )
    names = [str(name) for name in np.ravel(arrays.pop("joint_names", []))]
    columns: dict[str, NDArray[Any]] = {"time": time}
    left_out = []
    for key, values in arrays.items():
        prefix, axes = OF_AXES.get(key, (key, names))
        if key == "time":
            continue
        if key in _OF_JOINTS or key in OF_AXES:
            columns |= _split(where, key, prefix, np.asarray(values), axes, len(time))
        elif np.size(values) == len(time) and np.ndim(values) <= 2:
            columns[key] = _vector(where, key, values)
        elif np.ndim(values) == 1 and not isinstance(values, list):
            columns[key] = np.asarray(values)
        else:
            left_out.append(key)
    notes = [f"left out, since it is no column: {', '.join(left_out)}"] if left_out else []
    return table_of_columns(where, columns, notes)


def _vector(where: object, key: str, values: Any) -> NDArray[Any]:
    array = np.asarray(values)
    if array.size != max(array.shape, default=0) or array.dtype.kind not in "biuf":
        raise DataError(
            f"{where}: {key} has shape {array.shape} and type {array.dtype}, "
            "expected a column of numbers"
        )
    return array.reshape(-1)


def _split(
    where: object, key: str, prefix: str, values: NDArray[Any], labels: Sequence[str], rows: int
) -> dict[str, NDArray[Any]]:
    if len(labels) == 1 and values.size == rows:
        values = values.reshape(rows, 1)
    if values.shape != (rows, len(labels)) or values.dtype.kind not in "biuf":
        raise DataError(
            f"{where}: {key} has shape {values.shape} and type {values.dtype}, "
            f"expected numbers of shape {(rows, len(labels))}: a row for each time, "
            f"a column for each of {', '.join(labels)}"
        )
    return {f"{prefix}_{label}": values[:, j] for j, label in enumerate(labels)}
