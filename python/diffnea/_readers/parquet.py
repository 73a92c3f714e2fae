"""Parquet files: a data frame with the columns of a recording file, or episodes of LeRobot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._core import FileError
from . import lerobot
from .packages import import_package
from .table import Selection, Table

if TYPE_CHECKING:
    import pandas as pd


def read(path: Path, selection: Selection) -> Table:
    """Read a Parquet file with pandas and pyarrow."""
    frame = read_frame(path)
    if lerobot.EPISODE in frame.columns:
        return lerobot.table_of_episodes(path, frame, lerobot.find_info(path))
    del selection
    return table_of_frame(frame)


def read_frame(path: Path) -> pd.DataFrame:
    """All columns but pictures: what a cell holds is a number, a text, or a list of numbers."""
    pandas = import_package("pandas", f"{path}: reading Parquet", "parquet")
    parquet = import_package("pyarrow.parquet", f"{path}: reading Parquet", "parquet")
    try:
        schema = parquet.read_schema(path)
        names = [f.name for f in schema if not str(f.type).startswith(("struct", "binary"))]
        frame: pd.DataFrame = pandas.read_parquet(path, columns=names)
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read as Parquet ({error})") from error
    return frame


def table_of_frame(frame: pd.DataFrame) -> Table:
    """Make a table of a data frame; ``time`` may be its index, a list of numbers is a vector."""
    if "time" not in frame.columns and frame.index.name == "time":
        frame = frame.reset_index()
    frame = with_vectors(frame)

    def write(path: Path) -> None:
        frame.to_csv(path, index=False)

    return Table(write)


def with_vectors(frame: pd.DataFrame) -> pd.DataFrame:
    """Give every entry of a vector a column of its own: ``action`` becomes ``action.0``, …."""
    vectors = [name for name in frame.columns if _is_vector(frame[name])]
    if not vectors:
        return frame
    pandas = import_package("pandas", "a column of vectors", "pandas")
    parts = {}
    for name in frame.columns:
        if name not in vectors:
            parts[name] = frame[name].to_numpy()
            continue
        values = np.stack(frame[name].to_numpy())
        parts |= {f"{name}.{k}": values[:, k] for k in range(values.shape[1])}
    return pandas.DataFrame(parts)


def _is_vector(column: pd.Series) -> bool:
    """Tell whether every cell is a list of as many numbers."""
    if column.dtype != object or not len(column):
        return False
    sizes = {np.size(x) if isinstance(x, np.ndarray | list | tuple) else -1 for x in column}
    return len(sizes) == 1 and sizes.pop() > 0
