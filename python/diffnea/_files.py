"""Files and data frames in, files out. One reader knows the format of recordings: the C++ one."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from . import models
from ._core import (
    DataError,
    FileError,
    Model,
    ReadReport,
    Recording,
    _check_sidecar,
    _read_model,
    _read_recordings,
    _write_recordings,
    _write_sidecar,
)
from ._readers import Selection, Table, is_foreign, read_table
from ._readers.packages import import_package
from ._readers.parquet import table_of_frame

if TYPE_CHECKING:
    import pandas as pd

StrPath: TypeAlias = "str | os.PathLike[str]"


class Recordings(list[Recording]):
    """The runs of a file or data frame, and what reading them brought up."""

    def __init__(self, runs: Iterable[Recording], report: ReadReport) -> None:
        super().__init__(runs)
        self.report = report


def load_model(
    path: StrPath,
    *,
    fix_base: bool = False,
    free_base: bool = False,
    open_loops: bool = False,
    allow_outside: bool = False,
) -> Model:
    """Read a robot description: URDF, MJCF or the project's JSON; the content decides.

    A name without a file of that name is looked up among the models that come with diffnea:
    ``load_model("wam4")``. Of the folder of a run it is the model that was fitted or extended.

    Args:
        path: a file, a name, or the folder of a run.
        fix_base: fix a floating base where the file has it, as if the robot hung there.
        free_base: let the root of a URDF or JSON float, which most descriptions of legged robots
            leave to the user.
        open_loops: leave out an MJCF's equality constraints and a URDF's mimic tags: coupled
            joints move alone, and the forces of the coupling are missing.
        allow_outside: let an MJCF name files outside its folder.

    """
    name = os.fspath(path)
    if not Path(name).exists() and os.sep not in name:
        path = models.path(name)
    return _read_model(
        Path(path),
        fix_base=fix_base,
        free_base=free_base,
        open_loops=open_loops,
        allow_outside=allow_outside,
    )


def import_pandas(purpose: str) -> Any:
    """Pandas, or an error that says what needs it."""
    return import_package("pandas", purpose, "pandas")


def read_recordings(
    source: StrPath | pd.DataFrame,
    *,
    torque_side: str | None = None,
    torque_sampling: str | None = None,
    passive: Sequence[str] = (),
    period: float | None = None,
    topic: str | None = None,
    clock: str = "header",
    joints: Sequence[str] = (),
    command_topic: str | None = None,
    columns: Mapping[str, str] | str = "",
) -> Recordings:
    """Read all runs of a recording: a list of :class:`Recording` with a ``report``.

    Args:
        source: a file, the folder of a ROS 2 bag or of a LeRobot data set, or a data frame with the
            columns of a recording file. Files are CSV, Parquet (``.parquet``), NPZ, MATLAB
            (``.mat``), BAM's ``.json``, or ROS bags (``.mcap``, ``.db3``, ``.bag``) with messages
            of type ``sensor_msgs/JointState``.
        torque_side: ``motor`` or ``link``. This and the next three are what columns cannot hold:
            they go before the JSON file beside the recording, which is read, too.
        torque_sampling: ``hold`` or ``instant``.
        passive: joints whose torque is known to be zero.
        period: of a periodic motion [s].
        topic: of a ROS bag: which one, where several have joint states.
        clock: of a ROS bag: ``header`` takes the stamps of the messages, ``receive`` the times at
            which they were recorded.
        joints: of a ROS bag: only these, in this order.
        command_topic: of a ROS bag: the topic of the desired positions (``JointState`` or
            ``JointTrajectory``); each is held until the next.
        columns: columns by other names, ``{"gripper.pos": "q_gripper [deg]"}``, an empty name
            leaves one out; or the text or JSON file of the command's ``--map``.

    Raises:
        FileError, DataError: where the file is at fault; the message says what to do.
        ImportError: if the package that reads a format is missing; the message says which.

    """
    selection = Selection(topic, clock, joints, command_topic)
    names = columns if isinstance(columns, str) else list(columns.items())
    asked = (torque_side, torque_sampling, list(passive), period, names)
    if not isinstance(source, str | os.PathLike):
        if not hasattr(source, "to_csv"):
            raise TypeError(f"got {type(source).__name__}, expected a path or a pandas data frame")
        return _through_csv(table_of_frame(source), "data frame", None, *asked)
    path = Path(source)
    if is_foreign(path):
        return _through_csv(read_table(path, selection), str(path), path, *asked)
    selection.refuse(path, "CSV")
    return Recordings(*_read_recordings(path, str(path), path, *asked, []))


def read_recording(
    source: StrPath | pd.DataFrame,
    *,
    torque_side: str | None = None,
    torque_sampling: str | None = None,
    passive: Sequence[str] = (),
    period: float | None = None,
    topic: str | None = None,
    clock: str = "header",
    joints: Sequence[str] = (),
    command_topic: str | None = None,
    columns: Mapping[str, str] | str = "",
) -> Recording:
    """Read a recording of one run; the arguments are those of :func:`read_recordings`."""
    runs = read_recordings(
        source,
        torque_side=torque_side,
        torque_sampling=torque_sampling,
        passive=passive,
        period=period,
        topic=topic,
        clock=clock,
        joints=joints,
        command_topic=command_topic,
        columns=columns,
    )
    if len(runs) != 1:
        raise DataError(
            f"{runs.report.source}: holds {len(runs)} runs; read_recordings returns all of them"
        )
    return runs[0]


def recording_from_frame(frame: pd.DataFrame, **options: Any) -> Recording:
    """Implement :meth:`Recording.from_frame`."""
    return read_recording(frame, **options)


def write_recording(recording: Recording | Sequence[Recording], path: StrPath) -> None:
    """Write one recording, or several as runs of one file, and what columns cannot hold beside it.

    ``.csv``: numbers come back bit by bit. ``.parquet`` needs pandas and pyarrow.

    Raises:
        DataError: runs of one file differ in what columns cannot hold, which is there once.
        FileError: the file cannot be written, or a JSON file of its name is something else.

    """
    runs = [recording] if isinstance(recording, Recording) else list(recording)
    if not runs:
        raise DataError("write_recording: got no recording")
    path = Path(path)
    if path.suffix == ".csv":
        _write_recordings(runs, path)
        return
    if path.suffix != ".parquet":
        raise FileError(
            f"{path}: recordings are not written as {path.suffix}; choices: .csv, .parquet"
        )
    pandas = import_pandas(f"{path}: writing Parquet")
    _check_sidecar(runs, path)
    frames = [run.to_frame() for run in runs]
    if len(runs) > 1:
        for number, frame in enumerate(frames):
            frame["run"] = number
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".diffnea-") as folder:
        file = Path(folder) / path.name
        pandas.concat(frames).to_parquet(file, index=False)
        file.replace(path)
    _write_sidecar(runs[0], path)


def _through_csv(
    table: Table,
    name: str,
    described_by: Path | None,
    torque_side: str | None,
    torque_sampling: str | None,
    passive: list[str],
    period: float | None,
    names: str | list[tuple[str, str]],
) -> Recordings:
    """Through the CSV reader, so that units, gaps, runs and every check are those of a file."""
    with tempfile.TemporaryDirectory(prefix="diffnea-") as folder:
        path = Path(folder) / "table.csv"
        table.write(path)
        try:
            runs, report = _read_recordings(
                path,
                name,
                described_by or path,
                torque_side,
                torque_sampling,
                passive,
                period,
                names,
                table.notes,
            )
        except (DataError, FileError) as error:
            raise type(error)(str(error).replace(str(path), name)) from None
    return Recordings(runs, report)
