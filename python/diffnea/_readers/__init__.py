"""Recordings in foreign formats, one module a format; CSV itself is read by the C++ reader.

A reader turns a file into a :class:`Table` whose columns are those of a recording file. Whatever it
is, the table goes through the reader of CSV files, so that units, gaps, runs and every check are
the same. A new format is a module with a ``read`` and a line in :data:`READERS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from .._core import FileError
from . import bam, lerobot, matlab, npz, parquet, ros
from .table import Selection, Table

__all__ = ["READERS", "Reader", "Selection", "Table", "is_foreign", "read_table"]

#: What is read as CSV.
TEXT = (".csv", ".txt", ".dat", "")


@dataclass(frozen=True)
class Reader:
    """How one format is read."""

    name: str
    read: Callable[[Path, Selection], Table]


READERS = {
    ".parquet": Reader("Parquet", parquet.read),
    ".npz": Reader("NPZ", npz.read),
    ".mat": Reader("MATLAB", matlab.read),
    ".mcap": Reader("ROS 2 bag", ros.read),
    ".db3": Reader("ROS 2 bag", ros.read),
    ".bag": Reader("ROS 1 bag", ros.read),
    ".json": Reader("BAM log", bam.read),
}
BAG_FOLDER = Reader("ROS 2 bag", ros.read)
DATA_SET = Reader("LeRobot data set", lerobot.read)


def is_foreign(path: Path) -> bool:
    """Whether a file is not for the reader of CSV files, or is a folder."""
    return path.suffix not in TEXT or path.is_dir()


def _reader_of(path: Path) -> Reader | None:
    if path.is_dir():
        return DATA_SET if lerobot.is_data_set(path) else BAG_FOLDER
    if path.suffix == ".json" and path.is_file() and not bam.is_log(path):
        return None
    return READERS.get(path.suffix)


def read_table(path: Path, selection: Selection) -> Table:
    """Read a file that :func:`is_foreign`.

    Raises:
        FileError: if it is not there, of no known format, or broken.
        DataError: if it holds no recording, or several.
        ImportError: if the package that reads it is missing; the message says how to install it.

    """
    reader = _reader_of(path)
    if reader is None:
        raise FileError(
            f"{path}: {path.suffix} files are not read; choices: .csv, {', '.join(READERS)} "
            "(of BAM), the folder of a ROS 2 bag or of a LeRobot data set, or a pandas data frame"
        )
    if not path.exists():
        raise FileError(f"{path}: there is no such file")
    if reader.read is not ros.read:
        selection.refuse(path, reader.name)
    return reader.read(path, selection)
