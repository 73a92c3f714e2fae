"""Results as data frames: lists of named values, and series over time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ._core import (
    AuditReport,
    BallSeries,
    Cause,
    CauseParameter,
    Change,
    ChannelFault,
    Comparison,
    Error,
    Finding,
    IdentifyResult,
    Recording,
    ResidualSeries,
    SimulatedMotion,
    SimulatedSeries,
    TorqueSeries,
    Trajectory,
)
from ._files import import_pandas

if TYPE_CHECKING:
    import pandas as pd

_OVER_TIME = (TorqueSeries, ResidualSeries, SimulatedSeries)
#: What names a row, in the order of preference; all names of one of them are the index.
_INDEX = (("effect", "where", "parameter"), ("effect", "where"), ("name",), ("joint",), ("seed",))


def to_frame(data: Any) -> pd.DataFrame:
    """Return a result, or a list of what results hold, as a data frame.

        >>> diffnea.to_frame(result.errors)  # a row a joint
        >>> diffnea.to_frame(finding.candidates)  # a row a candidate
        >>> diffnea.to_frame(result.test_series)  # a row an instant of a joint

    A row is named by its index: parameter, joint, or effect and place. Series have a column
    ``time`` and columns of the quantities, in the units that ``frame.attrs`` names; several of them
    follow each other, told apart by a column ``joint``. What is no number, text or truth value is
    left out.

    Args:
        data: anything with a method ``to_frame``, or a list of values that results hold
            (``errors``, ``causes``, ``candidates``, ``joints``, ``faults``, ``base_parameters``,
            ``series``, …).

    Raises:
        Error: if it is neither.

    """
    import_pandas("to_frame")
    if not isinstance(data, list | tuple):
        if not hasattr(data, "to_frame"):
            raise Error(f"to_frame: got {type(data).__name__}, expected a result or a list of them")
        frame: pd.DataFrame = data.to_frame()
        return frame
    if data and all(isinstance(x, _OVER_TIME) for x in data):
        return _series_frame(data)
    if data and all(isinstance(x, Cause) for x in data):
        return _causes_frame(data)
    if data and all(isinstance(x, Recording | Trajectory) for x in data):
        raise Error("to_frame: a recording has its own to_frame(); call it for each")
    return table([scalars(x) for x in data])


def frame_of(result: Any) -> pd.DataFrame:
    """Implement ``to_frame`` of the compiled results."""
    import_pandas(f"{type(result).__name__}.to_frame")
    if isinstance(result, _OVER_TIME):
        return _series_frame([result]).drop(columns="joint")
    if isinstance(result, Finding):
        return _causes_frame(result.causes)
    if isinstance(result, IdentifyResult):
        return result.parameters.to_frame()
    if isinstance(result, Comparison):
        return table([scalars(x) for x in result.parameters], columns=fields_of(Change))
    if isinstance(result, AuditReport):
        faults = [scalars(fault) for fault in result.faults]
        return table(faults, columns=fields_of(ChannelFault), index=False)
    if isinstance(result, SimulatedMotion):
        return _series_frame(result.joints, ("time", "measured", "base", "extended"))
    if isinstance(result, BallSeries):
        return _ball_frame(result)
    raise Error(f"to_frame: got {type(result).__name__}, which is no table")


def scalars(value: Any) -> dict[str, Any]:
    """Numbers, texts and truth values among the fields of a value, in their order."""
    fields = fields_of(type(value))
    if not fields:
        raise Error(f"to_frame: got a list of {type(value).__name__}, expected values of a result")
    row = {name: getattr(value, name) for name in fields}
    return {name: x for name, x in row.items() if x is None or isinstance(x, str | int | float)}


def fields_of(kind: type) -> list[str]:
    """Names of the fields of a result's class, in their order."""
    return [
        name
        for base in kind.__mro__
        for name, member in vars(base).items()
        if isinstance(member, property) and not name.startswith("_")
    ]


def table(
    rows: Sequence[dict[str, Any]], *, columns: Sequence[str] | None = None, index: bool = True
) -> pd.DataFrame:
    """Make a frame of rows that have the same keys, indexed by what names them.

    ``columns`` are there also where no row is.
    """
    pandas = import_pandas("to_frame")
    frame: pd.DataFrame = pandas.DataFrame(list(rows), columns=columns)
    if not index:
        return frame
    for names in _INDEX:
        if set(names) <= set(frame.columns):
            return frame.set_index(list(names) if len(names) > 1 else names[0])
    return frame


def _causes_frame(causes: Iterable[Cause]) -> pd.DataFrame:
    """Make a row for each parameter of each cause; a cause without parameters has one."""
    rows = []
    for cause in causes:
        of_cause = scalars(cause) | {"explained_share": cause.gain.explained_share}
        place = {name: of_cause.pop(name) for name in ("effect", "where")}
        empty = {"parameter": "", "unit": "", "value": np.nan, "std": np.nan}
        found = [{"parameter": p.name} | scalars(p) for p in cause.parameters]
        for parameter in found or [empty | {"low": np.nan, "high": np.nan}]:
            parameter.pop("name", None)
            rows.append(place | parameter | of_cause)
    index = ["effect", "where", "parameter"]
    of_parameter = [name for name in fields_of(CauseParameter) if name != "name"]
    no_cells = {"effect", "where", "parameters", "members", "rivals", "gain"}
    of_each = [name for name in fields_of(Cause) if name not in no_cells]
    columns = [*index, *of_parameter, *of_each, "explained_share"]
    pandas = import_pandas("to_frame")
    frame: pd.DataFrame = pandas.DataFrame(rows, columns=columns)
    return frame.set_index(index)


def _series_frame(series: Sequence[Any], names: Sequence[str] = ()) -> pd.DataFrame:
    """``names``: of columns that are there also where no series is."""
    pandas = import_pandas("to_frame")
    frames = [] if series else [pandas.DataFrame(columns=["joint", *names])]
    for s in series:
        fields = {name: getattr(s, name) for name in _names_of_arrays(s)}
        frames.append(pandas.DataFrame({"joint": s.joint} | fields))
    frame: pd.DataFrame = pandas.concat(frames, ignore_index=True)
    frame.attrs["units"] = {s.joint: s.unit for s in series}
    return frame


def _names_of_arrays(series: Any) -> list[str]:
    length = len(series.time)
    return [
        name
        for name in fields_of(type(series))
        if isinstance(values := getattr(series, name), np.ndarray) and values.shape == (length,)
    ]


def _ball_frame(ball: BallSeries) -> pd.DataFrame:
    """Positions [m] as columns ``measured_x``, …, with run, window and whether it was taut."""
    pandas = import_pandas("to_frame")
    columns: dict[str, Any] = {"run": ball.run, "window": ball.window, "time": ball.time}
    for name in ("measured", "base", "extended", "anchor"):
        values = getattr(ball, name)
        if values.shape == (len(ball), 3):
            columns |= {f"{name}_{axis}": values[:, k] for k, axis in enumerate("xyz")}
    if len(ball.taut) == len(ball):
        columns["taut"] = ball.taut
    frame: pd.DataFrame = pandas.DataFrame(columns)
    return frame
