"""ROS bags: the messages of one topic of joint states, as columns.

Of ROS 2 a folder with its ``metadata.yaml``, or a single ``.mcap`` or ``.db3``; of ROS 1 a
``.bag``. Message definitions that a file brings along are not used: they would be turned into code.
Commands may come on a topic of their own (:mod:`.ros_commands`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import DataError, Error, FileError
from . import ros_commands
from .packages import import_package
from .table import Selection, Table, table_of_columns

JOINT_STATE = "sensor_msgs/msg/JointState"
CLOCKS = ("header", "receive")
_FIELDS = {"q": "position", "qd": "velocity", "tau": "effort"}
#: Characters that the name of a column cannot hold.
_NO_COLUMN = frozenset(',"[]\r\n')
#: A row that lacks joints is of no use; where most do, several senders took turns.
_LEAST_COMPLETE = 0.5


@dataclass
class Messages:
    """Joint states as they came: per message its stamp [ns], names, and values by name."""

    stamps: list[int] = field(default_factory=list)
    names: list[tuple[str, ...]] = field(default_factory=list)
    values: list[dict[str, NDArray[np.float64]]] = field(default_factory=list)
    senders: list[str] = field(default_factory=list)
    skipped: int = 0


def topics(path: Path) -> dict[str, int]:
    """Topics of joint states and how many messages each has."""
    with _Bag(path) as bag:
        return bag.topics()


def read(path: Path, selection: Selection) -> Table:
    """Read the joint states of a bag."""
    if selection.clock not in CLOCKS:
        raise DataError(f"clock: got {selection.clock!r}; choices: {', '.join(CLOCKS)}")
    with _Bag(path) as bag:
        commands = _commands(path, bag, selection)
        states = bag.topics()
        if selection.command_topic is not None:
            states.pop(selection.command_topic, None)
        topic = _choose(path, states, selection.topic)
        where = f"{path}: topic {topic}"
        messages = _collect(where, bag.messages(topic), selection)
    return _table(where, messages, selection, commands)


def _commands(path: Path, bag: _Bag, selection: Selection) -> list[tuple[int, dict[str, float]]]:
    """Return the commands of the topic that was asked for; none if none was."""
    asked = selection.command_topic
    if asked is None:
        return []
    there = bag.topics(ros_commands.TYPES)
    if asked not in there:
        listed = ", ".join(f"{name} ({count} messages)" for name, count in there.items())
        raise DataError(
            f"{path}: command_topic: got {asked!r}; topics of commands: {listed or 'none'}"
        )
    message_type = bag.type_of(asked)
    return ros_commands.collect(
        f"{path}: topic {asked}", bag.messages(asked, message_type), message_type, selection.clock
    )


def _choose(path: Path, there: dict[str, int], asked: str | None) -> str:
    listed = ", ".join(f"{name} ({count} messages)" for name, count in there.items())
    if not there:
        raise DataError(f"{path}: holds no topic of type {JOINT_STATE}")
    if asked is not None and asked not in there:
        raise DataError(f"{path}: topic: got {asked!r}; topics of joint states: {listed}")
    if asked is None and len(there) > 1:
        raise DataError(
            f"{path}: has several topics of joint states: {listed}; choose with topic= (--topic), "
            "and command_topic= (--command-topic) if one of them holds the commands"
        )
    return asked or next(iter(there))


def _collect(where: str, source: Iterator[tuple[str, int, Any]], selection: Selection) -> Messages:
    out = Messages()
    for sender, received, message in source:
        names = tuple(message.name)
        if not len(message.position):
            out.skipped += 1
            continue
        values = {}
        for key, name in _FIELDS.items():
            array = np.asarray(getattr(message, name), dtype=np.float64)
            if array.size not in (0, len(names)):
                raise DataError(
                    f"{where}: message {len(out.stamps)} has {len(names)} names and "
                    f"{array.size} values of {name}; expected as many, or none"
                )
            values[key] = array if array.size else np.full(len(names), np.nan)
        stamp = message.header.stamp
        header = int(stamp.sec) * 10**9 + int(stamp.nanosec)
        out.stamps.append(header if selection.clock == "header" else received)
        out.names.append(names)
        out.values.append(values)
        out.senders.append(sender)
    if not out.stamps:
        raise DataError(f"{where}: holds no message with a position")
    return out


def _table(
    where: str,
    messages: Messages,
    selection: Selection,
    commands: list[tuple[int, dict[str, float]]],
) -> Table:
    joints = _joints(where, messages, selection)
    _refuse_rivals(where, messages, joints)
    column = {joint: j for j, joint in enumerate(joints)}
    shape = (len(messages.stamps), len(joints))
    series = {key: np.full(shape, np.nan) for key in _FIELDS}
    present = np.zeros(shape, dtype=bool)
    for i, (names, values) in enumerate(zip(messages.names, messages.values, strict=True)):
        pairs = [(k, column[name]) for k, name in enumerate(names) if name in column]
        for k, j in pairs:
            present[i, j] = True
            for key in _FIELDS:
                series[key][i, j] = values[key][k]
    stamps = np.array(messages.stamps, dtype=np.int64)
    rows = np.flatnonzero(present.any(axis=1))
    if not stamps[rows].any():
        raise DataError(
            f"{where}: {', '.join(joints)}: every header stamp is 0; clock='receive' takes the "
            "times at which the messages were recorded"
        )
    if len(set(map(frozenset, messages.names))) > 1:  # several senders: in order, then together
        rows = rows[np.argsort(stamps[rows], kind="stable")]
        rows = _merge(rows, stamps, present, series)
    complete = present[rows].all(axis=1)
    if complete.mean() < _LEAST_COMPLETE:
        sets = Counter(tuple(j for j in names if j in column) for names in messages.names)
        listed = "; ".join(f"{', '.join(s)} ({n} messages)" for s, n in sets.most_common() if s)
        raise DataError(
            f"{where}: only {complete.sum()} of {len(rows)} rows hold all joints, since messages "
            f"hold different ones at different times: {listed}. Nothing is interpolated: choose "
            "those of one sender with joints="
        )
    first = int(stamps[rows][stamps[rows] != 0][0])
    columns = {"time": (stamps[rows] - first) * 1e-9}
    silent = []
    for joint, j in column.items():
        for key, measured in series.items():
            if key == "q" or np.isfinite(measured[rows, j]).any():
                columns[f"{key}_{joint}"] = measured[rows, j]
            elif key == "tau":
                silent.append(joint)
    desired = ros_commands.held(commands, joints, stamps[rows])
    columns |= desired
    notes = [
        f"{where}: {len(rows)} rows of {len(messages.stamps)} messages; time 0 is "
        f"{first // 10**9}.{first % 10**9:09d} s of the {selection.clock}'s clock"
    ]
    if messages.skipped:
        notes.append(f"{messages.skipped} messages without a position are left out")
    if commands:
        without = [joint for joint in joints if f"qcmd_{joint}" not in desired]
        notes.append(
            f"{len(commands)} commands of topic {selection.command_topic}, each held until the next"
            + (f"; none is of {', '.join(without)}" if without else "")
        )
    if silent:
        notes.append(f"no effort is given of {', '.join(silent)}: prescribed, with unknown torque")
    return table_of_columns(where, columns, notes)


def _joints(where: str, messages: Messages, selection: Selection) -> list[str]:
    """Names in the order of their first message; of those selected, in that order."""
    there = list(dict.fromkeys(name for names in messages.names for name in names))
    for names in set(messages.names):
        if len(set(names)) < len(names):
            raise DataError(f"{where}: a message names a joint twice: {', '.join(names)}")
    if unknown := [joint for joint in selection.joints if joint not in there]:
        raise DataError(f"{where}: joints: got {', '.join(unknown)}; there are: {', '.join(there)}")
    chosen = list(selection.joints) or there
    for joint in chosen:
        if not joint or _NO_COLUMN & set(joint):
            raise DataError(f"{where}: a joint is named {joint!r}, which cannot name a column")
    return chosen


def _refuse_rivals(where: str, messages: Messages, joints: list[str]) -> None:
    """Two publishers of one joint contradict each other; only ROS 1 records who sent what."""
    of_joint: dict[str, Counter[str]] = {joint: Counter() for joint in joints}
    for names, sender in zip(messages.names, messages.senders, strict=True):
        for name in names:
            if name in of_joint:
                of_joint[name][sender] += 1
    for joint, counts in of_joint.items():
        if len(counts) > 1:
            listed = ", ".join(f"{sender} ({n} messages)" for sender, n in counts.items())
            raise DataError(
                f"{where}: joint {joint} comes from several publishers: {listed}; "
                "record one of them, or leave the joint out with joints="
            )


def _merge(
    rows: NDArray[np.intp],
    stamps: NDArray[np.int64],
    present: NDArray[np.bool_],
    series: dict[str, NDArray[np.float64]],
) -> NDArray[np.intp]:
    """Join neighbours of one stamp that hold different joints into one row."""
    kept = [rows[0]]
    for row in rows[1:]:
        last = kept[-1]
        if stamps[row] != stamps[last] or (present[row] & present[last]).any():
            kept.append(row)
            continue
        for values in series.values():
            values[last, present[row]] = values[row, present[row]]
        present[last] |= present[row]
    return np.array(kept)


class _Bag:
    """A bag of either ROS, as far as joint states go."""

    def __init__(self, path: Path) -> None:
        self.path = path
        purpose = f"{path}: reading a ROS bag"
        self.is_ros1 = path.suffix == ".bag" and not path.is_dir()
        module = "rosbags.rosbag1" if self.is_ros1 else "rosbags.rosbag2"
        reader = import_package(module, purpose, "ros").Reader
        typesys = import_package("rosbags.typesys", purpose, "ros")
        stores = typesys.Stores
        self.types = typesys.get_typestore(
            stores.ROS1_NOETIC if self.is_ros1 else stores.ROS2_HUMBLE
        )
        try:
            self.reader = reader(path)
            self.reader.open()
        except Exception as error:  # rosbags raises whatever a broken file leads it to
            raise self._broken(error) from error

    def __enter__(self) -> _Bag:
        return self

    def __exit__(self, *_: object) -> None:
        self.reader.close()

    def _broken(self, error: Exception) -> FileError:
        return FileError(f"{self.path}: cannot be read as a ROS bag ({error})")

    def topics(self, types: Sequence[str] = (JOINT_STATE,)) -> dict[str, int]:
        out: Counter[str] = Counter()
        for connection in self.reader.connections:
            if connection.msgtype in types:
                out[connection.topic] += connection.msgcount
        return dict(sorted(out.items()))

    def type_of(self, topic: str) -> str:
        """Type of a topic's messages."""
        return str(next(c.msgtype for c in self.reader.connections if c.topic == topic))

    def messages(
        self, topic: str, message_type: str = JOINT_STATE
    ) -> Iterator[tuple[str, int, Any]]:
        """Sender (empty where it is not known), time of reception [ns], message."""
        wanted = [
            c for c in self.reader.connections if c.topic == topic and c.msgtype == message_type
        ]
        decode = self.types.deserialize_ros1 if self.is_ros1 else self.types.deserialize_cdr
        try:
            for connection, received, raw in self.reader.messages(wanted):
                sender = getattr(connection.ext, "callerid", None) or ""
                yield sender, received, decode(raw, message_type)
        except Error:
            raise
        except Exception as error:
            raise self._broken(error) from error
