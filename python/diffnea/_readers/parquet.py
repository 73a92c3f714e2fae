"""Parquet files: a data frame with the columns of a recording file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .._core import FileError
from .packages import import_package
from .table import Selection, Table

if TYPE_CHECKING:
    import pandas as pd


def read(path: Path, _: Selection) -> Table:
    """Read a Parquet file with pandas and pyarrow."""
    pandas = import_package("pandas", f"{path}: reading Parquet", "parquet")
    import_package("pyarrow", f"{path}: reading Parquet", "parquet")
    try:
        frame: pd.DataFrame = pandas.read_parquet(path)
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read as Parquet ({error})") from error
    return table_of_frame(frame)


def table_of_frame(frame: pd.DataFrame) -> Table:
    """Make a table of a data frame; ``time`` may be its index."""
    if "time" not in frame.columns and frame.index.name == "time":
        frame = frame.reset_index()

    def write(path: Path) -> None:
        frame.to_csv(path, index=False)

    return Table(write)
