"""Files and data frames in, files out. One reader knows the format of recordings: the C++ one."""

from __future__ import annotations

import csv
import os
import tempfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from . import models
from ._core import (
    DataError,
    FileError,
    Model,
    ReadReport,
    Recording,
    _read_model,
    _read_recordings,
    _write_recordings,
    _write_sidecar,
)

if TYPE_CHECKING:
    import pandas as pd

StrPath: TypeAlias = "str | os.PathLike[str]"

_SERIES = ("q", "tau", "qd", "qdd", "qcmd", "ball", "spin")


class Recordings(list[Recording]):
    """The runs of a file or data frame, and what reading them brought up."""

    def __init__(self, runs: Iterable[Recording], report: ReadReport) -> None:
        super().__init__(runs)
        self.report = report


def load_model(path: StrPath) -> Model:
    """Read a robot description: URDF, MJCF or the project's JSON; the content decides.

    A name without a file of that name is looked up among the models that come with diffnea:
    ``load_model("wam4")``.
    """
    name = os.fspath(path)
    if not Path(name).exists() and os.sep not in name:
        path = models.path(name)
    return _read_model(Path(path))


def import_pandas(purpose: str) -> Any:
    """Pandas, or an error that says what needs it."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError(
            f"{purpose} needs pandas; install it with: pip install 'diffnea[pandas]'"
        ) from error
    return pandas


def read_recordings(
    source: StrPath | pd.DataFrame,
    *,
    torque_side: str | None = None,
    torque_sampling: str | None = None,
    passive: Sequence[str] = (),
    period: float | None = None,
) -> Recordings:
    """Read all runs of a recording: a list of :class:`Recording` with a ``report``.

    ``source``: a file (``.csv``; ``.parquet`` with pandas and pyarrow; ``.npz``) or a data frame
    with the columns of a recording file. What columns cannot hold comes from the JSON file beside
    it and, over that, from the arguments: ``torque_side`` (``motor`` or ``link``),
    ``torque_sampling`` (``hold`` or ``instant``), ``passive`` (joints whose torque is known to be
    zero), ``period`` [s].
    """
    asked = (torque_side, torque_sampling, list(passive), period)
    if not isinstance(source, str | os.PathLike):
        return _read_frame(source, "data frame", None, *asked)
    path = Path(source)
    if path.suffix == ".parquet":
        _require_file(path)
        pandas = import_pandas(f"{path}: reading Parquet")
        try:
            frame = pandas.read_parquet(path)
        except (OSError, ValueError) as error:
            raise FileError(f"{path}: cannot be read as Parquet ({error})") from error
        return _read_frame(frame, str(path), path, *asked)
    if path.suffix == ".npz":
        return _read_npz(path, *asked)
    if path.suffix not in (".csv", ".txt", ".dat", ""):
        raise FileError(
            f"{path}: {path.suffix} files are not read; "
            "choices: .csv, .parquet, .npz, or a pandas data frame"
        )
    return Recordings(*_read_recordings(path, str(path), path, *asked))


def read_recording(
    source: StrPath | pd.DataFrame,
    *,
    torque_side: str | None = None,
    torque_sampling: str | None = None,
    passive: Sequence[str] = (),
    period: float | None = None,
) -> Recording:
    """Read a recording of one run; the arguments are those of :func:`read_recordings`."""
    runs = read_recordings(
        source,
        torque_side=torque_side,
        torque_sampling=torque_sampling,
        passive=passive,
        period=period,
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
    frames = [run.to_frame() for run in runs]
    if len(runs) > 1:
        for number, frame in enumerate(frames):
            frame["run"] = number
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".diffnea-") as folder:
        file = Path(folder) / path.name
        pandas.concat(frames).to_parquet(file, index=False)
        file.replace(path)
    _write_sidecar(runs[0], path)


def _require_file(path: Path) -> None:
    if not path.is_file():
        raise FileError(f"{path}: there is no such file")


def _read_frame(
    frame: pd.DataFrame,
    name: str,
    described_by: Path | None,
    torque_side: str | None,
    torque_sampling: str | None,
    passive: list[str],
    period: float | None,
) -> Recordings:
    """Through the CSV reader, so that units, gaps, runs and every check are those of a file."""
    if not hasattr(frame, "to_csv"):
        raise TypeError(f"got {type(frame).__name__}, expected a path or a pandas data frame")
    if "time" not in frame.columns and frame.index.name == "time":
        frame = frame.reset_index()
    return _through_csv(
        lambda path: frame.to_csv(path, index=False),
        name,
        described_by,
        torque_side,
        torque_sampling,
        passive,
        period,
    )


def _through_csv(
    write: Callable[[Path], None],
    name: str,
    described_by: Path | None,
    torque_side: str | None,
    torque_sampling: str | None,
    passive: list[str],
    period: float | None,
) -> Recordings:
    with tempfile.TemporaryDirectory(prefix="diffnea-") as folder:
        path = Path(folder) / "frame.csv"
        write(path)
        try:
            return Recordings(
                *_read_recordings(
                    path, name, described_by or path, torque_side, torque_sampling, passive, period
                )
            )
        except (DataError, FileError) as error:
            raise type(error)(str(error).replace(str(path), name)) from None


def _read_npz(
    path: Path,
    torque_side: str | None,
    torque_sampling: str | None,
    passive: list[str],
    period: float | None,
) -> Recordings:
    """Columns of a recording file by name, or arrays ``time``, ``q``, ``joint_names``, …."""
    _require_file(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read as NPZ ({error})") from error
    if {"time", "q", "joint_names"} <= arrays.keys():
        columns = _columns_of_arrays(path, arrays)
    else:
        columns = {key: values for key, values in arrays.items() if values.ndim == 1}
    lengths = {key: len(values) for key, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise DataError(f"{path}: arrays of different lengths: {lengths}")

    def write(file: Path) -> None:
        with file.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(columns)
            for row in zip(*(values.tolist() for values in columns.values()), strict=True):
                writer.writerow("" if x != x else x for x in row)  # NaN is a gap

    return _through_csv(write, str(path), path, torque_side, torque_sampling, passive, period)


def _columns_of_arrays(path: Path, arrays: dict[str, Any]) -> dict[str, Any]:
    time, names = arrays["time"], [str(name) for name in np.ravel(arrays["joint_names"])]
    columns = {"time": time}
    for key in _SERIES:
        if key not in arrays:
            continue
        values, labels = arrays[key], list("xyz") if key in ("ball", "spin") else names
        if values.shape == time.shape and len(labels) == 1:
            values = values[:, np.newaxis]
        if values.shape != (len(time), len(labels)):
            raise DataError(
                f"{path}: {key} has shape {values.shape}, expected {(len(time), len(labels))}"
            )
        columns |= {f"{key}_{label}": values[:, j] for j, label in enumerate(labels)}
    return columns
