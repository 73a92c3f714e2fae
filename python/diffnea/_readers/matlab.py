"""MATLAB files: ``time``, ``q``, ``tau``, ``joint_names`` as variables or fields of one struct.

Files of version 4 to 7.2 are read by scipy, those of version 7.3 by h5py. Objects (tables,
timeseries, function handles) are not read: only MATLAB knows what is in them.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from .._core import DataError, FileError
from .packages import import_package
from .table import Selection, Table, table_of_arrays

_SAVE = "save('log.mat', 'time', 'q', 'tau', 'joint_names')"
_NUMBERS = {"double", "single", "logical"} | {
    f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
}


def read(path: Path, _: Selection) -> Table:
    """Read a MATLAB file of any version."""
    with path.open("rb") as file:
        is_hdf5 = b"MATLAB 7.3" in file.read(128)
    try:
        arrays, objects = (_read_hdf5 if is_hdf5 else _read_scipy)(path)
    except (DataError, ImportError):
        raise
    except Exception as error:  # the libraries raise whatever a broken file leads them to
        raise FileError(f"{path}: cannot be read as a MATLAB file ({error})") from error
    structs = {key: x for key, x in arrays.items() if isinstance(x, dict)}
    with_time = [key for key, fields in structs.items() if "time" in fields]
    if "time" not in arrays and len(with_time) > 1:
        raise DataError(
            f"{path}: holds several recordings: {', '.join(with_time)}; save each in its own file"
        )
    if "time" not in arrays and with_time:
        arrays = structs[with_time[0]]
    elif "time" not in arrays and objects:
        raise DataError(
            f"{path}: {', '.join(objects)}: objects of MATLAB (tables, timeseries) are not read; "
            f"save arrays: {_SAVE}"
        )
    left_out = [key for key, x in arrays.items() if isinstance(x, dict)] + objects
    table = table_of_arrays(path, {k: x for k, x in arrays.items() if not isinstance(x, dict)})
    notes = [f"left out, since it is no array: {', '.join(left_out)}"] if left_out else []
    return Table(table.write, notes + table.notes)


def _read_scipy(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Variables: arrays, lists of names, structs as dictionaries; and the names of objects."""
    io = import_package("scipy.io", f"{path}: reading a MATLAB file", "matlab")
    known = _NUMBERS | {"char", "cell", "struct"}
    kinds = {name: kind for name, _, kind in io.whosmat(path)}
    wanted = [name for name, kind in kinds.items() if kind in known]
    found = io.loadmat(path, variable_names=wanted) if wanted else {}
    arrays = {name: _plain(found[name]) for name in wanted}
    return arrays, [name for name, kind in kinds.items() if kind not in known]


def _plain(value: Any) -> Any:
    if value.dtype.names is not None:  # a struct, or an array of structs
        if value.size != 1:
            return {}
        return {name: _plain(value.flat[0][name]) for name in value.dtype.names}
    if value.dtype == object:  # a cell array
        return _names(value.flat)
    if value.dtype.kind == "U":
        return [str(x).strip() for x in value.flat]
    return value


def _names(cells: Iterable[Any]) -> list[str] | dict[str, Any]:
    """Texts of a cell array; a dictionary, which is left out, if it holds anything else."""
    texts = [np.asarray(cell) for cell in cells]
    if any(x.dtype.kind != "U" or x.size > 1 for x in texts):
        return {}
    return ["".join(x.flat) for x in texts]


def _read_hdf5(path: Path) -> tuple[dict[str, Any], list[str]]:
    """Version 7.3, as :func:`_read_scipy`. Links to other files are not followed."""
    h5py = import_package("h5py", f"{path}: reading a MATLAB file of version 7.3", "matlab")
    objects: list[str] = []

    def member(group: Any, name: str) -> Any:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise DataError(f"{path}: {name}: is a link, which is not followed")
        return group[name]

    def text(data: Any) -> str:
        return "".join(map(chr, np.ravel(numbers(data))))

    def numbers(data: Any) -> Any:
        if data.external:
            raise DataError(f"{path}: {data.name}: lies in another file, which is not read")
        return data[()].T  # MATLAB's order is that of columns

    def plain(group: Any, name: str) -> Any:
        item = member(group, name)
        kind = item.attrs.get("MATLAB_class", b"").decode("ascii", "replace")
        if isinstance(item, h5py.Group):
            if kind != "struct" or group.name != "/":
                return {}
            return {field: plain(item, field) for field in item}
        if kind in _NUMBERS and not item.attrs.get("MATLAB_empty"):
            return numbers(item)
        if kind == "char":
            return ["".join(map(chr, row)).strip() for row in np.atleast_2d(numbers(item))]
        if kind == "cell" and item.dtype == h5py.ref_dtype:
            cells = [group.file[reference] for reference in numbers(item).flat]
            if all(cell.attrs.get("MATLAB_class") == b"char" for cell in cells):
                return [text(cell) for cell in cells]
        return {}

    arrays = {}
    with h5py.File(path, "r") as file:
        for name in file:
            if name.startswith("#"):  # #refs#, #subsystem#: MATLAB's own
                continue
            if "MATLAB_object_decode" in member(file, name).attrs:
                objects.append(name)
            else:
                arrays[name] = plain(file, name)
    return arrays, objects
