"""NPZ files: arrays ``time``, ``q``, ``tau``, ``joint_names``, or columns by name."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

import numpy as np

from .._core import FileError
from .table import Selection, Table, table_of_arrays

# What NumPy and zipfile raise for files that are none, cut off, damaged, encrypted, or packed by a
# method that they do not know.
BROKEN = (
    OSError,
    ValueError,
    AttributeError,
    EOFError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
)


def read(path: Path, _: Selection) -> Table:
    """Read an NPZ file. Objects are refused: reading them would run what is in the file."""
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
    except BROKEN as error:
        raise FileError(f"{path}: cannot be read as NPZ ({error})") from error
    return table_of_arrays(path, arrays)
