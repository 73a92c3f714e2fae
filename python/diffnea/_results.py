"""How results look: tables and plots."""

from __future__ import annotations

import html as text
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from ._core import (
    AuditReport,
    Cause,
    ConstrainedFit,
    Error,
    Finding,
    IdentifyResult,
    ParameterEstimate,
    ResidualSeries,
    TorqueSeries,
)
from ._files import import_pandas
from .style import new_figure

if TYPE_CHECKING:
    from typing import SupportsIndex

    import pandas as pd
    from matplotlib.figure import Figure


class Parameters(list[ParameterEstimate]):
    """Fitted parameters, by position or by name: ``result.parameters["forearm.mass"]``."""

    @overload
    def __getitem__(self, key: SupportsIndex | str) -> ParameterEstimate: ...
    @overload
    def __getitem__(self, key: slice) -> list[ParameterEstimate]: ...
    def __getitem__(
        self, key: SupportsIndex | str | slice
    ) -> ParameterEstimate | list[ParameterEstimate]:
        if not isinstance(key, str):
            return super().__getitem__(key)
        for parameter in self:
            if parameter.name == key:
                return parameter
        raise KeyError(f"there is no parameter {key!r}; names: {', '.join(p.name for p in self)}")

    def to_frame(self) -> pd.DataFrame:
        """Return a data frame, one row a parameter, the name as index."""
        fields = ("value", "std", "unit", "prior", "identifiable", "fixed", "at_bound")
        rows = [{"name": p.name} | {field: getattr(p, field) for field in fields} for p in self]
        columns = ["name", *fields]
        pandas = import_pandas("Parameters.to_frame")
        frame: pd.DataFrame = pandas.DataFrame(rows, columns=columns).set_index("name")
        return frame


def constrained_fit_text(fit: ConstrainedFit) -> str:
    """Implement ``__repr__`` of a constrained fit: a line a number and a line a constraint."""
    end = "converged" if fit.converged else f"not converged, {fit.termination},"
    lines = [
        f"ConstrainedFit: {end} after {fit.iterations} steps, {fit.samples} samples, "
        f"chi2 {fit.chi2:.4g}"
    ]
    width = max(len(p.name) for p in fit.parameters)
    for p in fit.parameters:
        error = f" ± {p.std:.2g}" if p.identifiable else ""
        line = f"  {p.name:{width}}  {p.value:.6g}{error} {p.unit}".rstrip()
        lines.append(line if p.identifiable else f"{line}, not told by this motion")
    lines += [f"  {e.name}: g is {e.over_noise:.2g} of its noise (rms)" for e in fit.errors]
    return "\n".join(lines)


def _number(x: float) -> str:
    return f"{x:.4g}" if math.isfinite(x) else "–"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    def line(tag: str, cells: Sequence[str]) -> str:
        return "<tr>" + "".join(f"<{tag}>{text.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    return "<table>" + line("th", head) + "".join(line("td", row) for row in rows) + "</table>"


def fields_html(rows: Sequence[tuple[str, float | str, str]]) -> str:
    """Implement ``_repr_html_`` of a value type: name, value and unit of its fields."""
    return _table(
        ["", "value", "unit"],
        [[name, x if isinstance(x, str) else _number(x), unit] for name, x, unit in rows],
    )


def html(result: IdentifyResult) -> str:
    """Implement ``_repr_html_``: what the data determine, and the error before and after."""
    held_out = any(math.isfinite(e.test) for e in result.errors)
    errors = [
        [
            e.joint,
            e.unit,
            _number(e.torque_rms),
            _number(e.nominal_test if held_out else e.nominal_train),
            _number(e.test if held_out else e.train),
        ]
        for e in result.errors
    ]
    known = [p for p in result.parameters if p.identifiable and not p.fixed]
    parameters = [
        [p.name, _number(p.value), _number(p.std), p.unit, _number(p.prior)] for p in known
    ]
    rest = len(result.parameters) - len(known)
    return (
        f"<p><b>{text.escape(result.model.name)}</b>: rms torque error, "
        f"{'held out' if held_out else 'on the data of the fit'}</p>"
        + _table(["joint", "unit", "torque", "before", "after"], errors)
        + _table(["parameter", "value", "± std", "unit", "prior"], parameters)
        + (
            f"<p>{rest} more that the data do not determine one by one, or that were held</p>"
            if rest
            else ""
        )
    )


def audit_html(report: AuditReport) -> str:
    """Implement ``_repr_html_`` of :class:`AuditReport`: every fault with its evidence."""

    def size(value: float, std: float, unit: str) -> str:
        error = f" ± {std:.2g}" if math.isfinite(std) else ""
        return f"{_number(value)}{error}{'' if unit == '1' else ' ' + unit}"

    rows = [
        [f.severity, f.fault, f.channel, size(f.value, f.std, f.unit), f.evidence]
        for f in report.faults
    ]
    unchecked = "".join(
        f"<p>not checked: {text.escape(c.name)}: {text.escape(c.text)}</p>"
        for c in report.checks
        if not c.done
    )
    if not rows:
        return f"<p>no channel fault in {report.rows} rows</p>" + unchecked
    return _table(["", "fault", "channel", "size", "evidence"], rows) + unchecked


def finding_html(finding: Finding) -> str:
    """Implement ``_repr_html_`` of :class:`Finding`: verdict, causes, held-out error per joint."""

    def values(cause: Cause) -> str:
        return ", ".join(
            f"{p.name} {_number(p.value)} ± {p.std:.2g}{'' if p.unit == '1' else ' ' + p.unit}"
            for p in cause.parameters
            if math.isfinite(p.std)
        )

    causes = [
        [
            c.effect,
            c.where,
            values(c),
            _number(c.delta_bic),
            f"{100 * c.gain.explained_share:.3g} %",
            ", ".join(f"{m.effect} at {m.where}" for m in c.members),
        ]
        for c in finding.causes
    ]
    joints = [
        [j.joint, j.unit, *map(_number, (j.torque_rms, j.base, j.extended, j.noise_floor))]
        for j in finding.joints
    ]
    head = ["cause", "where", "parameters ± std", "ΔBIC", "held-out error² explained", "or"]
    return (
        f"<p>{text.escape(finding.sentence)} <b>{finding.verdict}</b></p>"
        + (_table(head, causes) if causes else "")
        + f"<p>rms torque error, held out ({text.escape(finding.held_out)})</p>"
        + _table(["joint", "unit", "torque", "before", "after", "noise"], joints)
    )


def plot(result: IdentifyResult, of: str) -> Figure:
    """Implement :meth:`IdentifyResult.plot`."""
    choices = {"train": result.train_series, "test": result.test_series}
    choices["auto"] = choices["test"] or choices["train"]
    if of not in choices:
        raise Error(f"plot: of: got {of!r}; choices: {', '.join(sorted(choices))}")
    series: list[TorqueSeries] = choices[of]
    if not series:
        raise Error(f"plot: the result holds no {of} series")
    figure = new_figure("IdentifyResult.plot", 9, 1 + 1.8 * len(series))
    panels: Any = figure.subplots(len(series), 1, sharex=True, squeeze=False)[:, 0]
    for panel, s in zip(panels, series, strict=True):
        _draw_over_time(panel, s.time, s.measured, before=s.nominal, after=s.fitted)
        panel.set_ylabel(f"{s.joint} [{s.unit.replace('*', '·')}]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    panels[-1].set_xlabel("time [s]")
    return figure


def _draw_over_time(
    panel: Any,
    time: np.ndarray[Any, Any],
    measured: np.ndarray[Any, Any],
    *,
    before: np.ndarray[Any, Any],
    after: np.ndarray[Any, Any],
) -> None:
    gaps = _gaps(time)
    for values, label, color, width in (
        (measured, "measured", "0.7", 2.5),
        (before, "before", "C1", 0.8),
        (after, "after", "C0", 1.0),
    ):
        line = np.insert(values, gaps, np.nan)
        panel.plot(np.insert(time, gaps, np.nan), line, color=color, linewidth=width, label=label)


def plot_finding(finding: Finding, joints: Sequence[str] | None) -> Figure:
    """Implement :meth:`Finding.plot`."""
    names = [s.joint for s in finding.series]
    if joints is None:
        places = [c.where for c in finding.causes] + [w.where for w in finding.witness]
        named = {part.strip() for place in places for part in place.split(",")}
        joints = [name for name in names if name in named] or names  # the tip acts on all of them
    unknown = [name for name in joints if name not in names]
    if unknown or not joints:
        raise Error(f"plot: joints: got {unknown or joints!r}; choices: {', '.join(names)}")
    series: list[ResidualSeries] = [finding.series[names.index(name)] for name in joints]
    figure = new_figure("Finding.plot", 10, 1 + 2.4 * len(series))
    panels: Any = figure.subplots(len(series), 2, squeeze=False, width_ratios=(3, 2))
    for (over_time, over_velocity), s in zip(panels, series, strict=True):
        _draw_over_time(over_time, s.time, s.measured, before=s.base, after=s.extended)
        unit = s.unit.replace("*", "·")
        over_time.set_ylabel(f"{s.joint} [{unit}]")
        for values, color in ((s.base, "C1"), (s.extended, "C0")):
            over_velocity.plot(s.qd, s.measured - values, ".", color=color, markersize=2)
        over_velocity.set_ylabel(f"error [{unit}]")
        over_velocity.set_xlabel(f"velocity [{'m' if s.unit == 'N' else 'rad'}/s]")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    panels[-1, 0].set_xlabel("time [s]")
    return figure


def _gaps(time: np.ndarray) -> np.ndarray:
    """Where rows were left out: gaps in a line, no straight strokes."""
    step = np.diff(time)
    return 1 + np.flatnonzero(step > 1.5 * np.median(step)) if len(step) else np.arange(0)
