"""Pictures of a ball's path: in space, the string's length, the error over its directions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._core import BallSeries, Error
from .style import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

BEFORE, AFTER, MEASURED = "C1", "C0", "0.7"
MOST_WINDOWS = 4  # that are drawn in space; more are a tangle
CELLS = 21  # of the sphere's map, from side to side
LEAST_ROWS = 3  # that a cell's mean needs, where there are many
MANY_ROWS = 400


def to_dict(ball: BallSeries) -> dict[str, Any]:
    """Implement :meth:`BallSeries.to_dict`."""
    names: tuple[str, ...] = (
        "held_out",
        "has_string",
        "run",
        "window",
        "time",
        "measured",
        "base",
        "extended",
    )
    names += ("anchor", "taut", "length", "sigma", "base_rms", "extended_rms")
    flagged = [
        {name: getattr(flag, name) for name in ("run", "time", "channel", "reason")}
        for flag in ball.flagged
    ]
    return {name: getattr(ball, name) for name in names} | {"flagged": flagged}


def plot_result(ball: BallSeries | None, names: tuple[str, str], purpose: str) -> Figure:
    """Implement ``plot_ball`` of the results. ``names``: of the models before and after."""
    if ball is None:
        raise Error(
            f"{purpose}: no ball was fitted; the model needs one (in an MJCF, a free body 'ball'),"
            " and a recording its positions ball_x, ball_y, ball_z"
        )
    return plot(ball, *names)


def plot(ball: BallSeries, before: str, after: str) -> Figure:
    """Implement :meth:`BallSeries.plot`."""
    if len(ball) == 0:
        raise Error("plot: the series has no rows: the ball was never seen for long enough")
    figure = new_figure("BallSeries.plot", 13, 11 if ball.has_string else 8)
    rows: Any = [["space", "space", "x"], ["space", "space", "y"], ["space", "space", "z"]]
    if ball.has_string:
        rows += [["length", "length", "length"], ["before", "after", "along"]]
    per_panel: Any = {"space": {"projection": "3d"}}
    panels: Any = figure.subplot_mosaic(
        rows, per_subplot_kw=per_panel, height_ratios=[1, 1, 1, 1.2, 2.4][: len(rows)]
    )
    time, starts = _one_axis(ball)
    both = ((ball.base, before, BEFORE), (ball.extended, after, AFTER))
    models = [m for m in both if np.isfinite(m[0]).any()]
    _draw_space(panels["space"], ball, models)
    for axis, name in enumerate("xyz"):
        panel = panels[name]
        panel.axhspan(-2e3 * ball.sigma, 2e3 * ball.sigma, color="0.9", label="± 2 σ of the noise")
        for points, label, color in models:
            error = 1e3 * (ball.measured - points)[:, axis]
            panel.plot(*_broken(time, error, starts), color=color, linewidth=0.8, label=label)
        panel.set_ylabel(f"{name} error [mm]", fontsize="small")
        _mark(panel, ball, time)
    panels["x"].set_title("measured − model; grey: ± 2 σ of the noise", fontsize="small")
    panels["z"].set_xlabel("time [s]")
    if ball.has_string:
        _draw_length(panels["length"], ball, models, time, starts)
        _draw_sphere(figure, panels, ball, models)
    known = ((before, ball.base_rms), (after, ball.extended_rms))
    shown = {label for _, label, _ in models}
    rms = [f"{label} {1e3 * x:.3g} mm" for label, x in known if label in shown]
    figure.suptitle(
        f"ball, {'held-out data' if ball.held_out else 'data of the fit'}: rms along one axis "
        f"{', '.join(rms)}; noise σ {1e3 * ball.sigma:.3g} mm"
    )
    handles, labels = panels["space"].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _one_axis(ball: BallSeries) -> tuple[Array, NDArray[np.intp]]:
    """Return times with runs one after the other, and where windows begin."""
    time = ball.time.copy()
    new_run = np.flatnonzero(np.diff(ball.run)) + 1
    for begin in new_run:
        span = time[begin - 1] - time[0]
        time[begin:] += time[begin - 1] + 0.04 * span - time[begin]
    starts = np.flatnonzero(np.diff(ball.window) | np.diff(ball.run)) + 1
    return time, starts


def _broken(time: Array, values: Array, starts: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return a line that ends where a window does."""
    return np.insert(time, starts, np.nan), np.insert(values, starts, np.nan, axis=0)


def _mark(panel: Any, ball: BallSeries, time: Array) -> None:
    """Ticks at the top where rows were flagged."""
    at = []
    for flag in ball.flagged:
        rows = np.flatnonzero(ball.run == flag.run)
        if len(rows):
            at.append(flag.time + time[rows[0]] - ball.time[rows[0]])
    if at:
        panel.plot(
            at, np.ones(len(at)), "v", color="C3", ms=4, transform=panel.get_xaxis_transform()
        )


def _draw_space(panel: Any, ball: BallSeries, models: Any) -> None:
    windows = np.split(np.arange(len(ball)), _one_axis(ball)[1])
    most = min(MOST_WINDOWS, len(windows))
    shown = [windows[(2 * i + 1) * len(windows) // (2 * most)] for i in range(most)]
    lines = [(ball.measured, "measured", MEASURED, 2.5)]
    lines += [(points, label, color, 0.9) for points, label, color in models]
    if ball.has_string:
        lines.append((ball.anchor, "where the string is tied", "0.2", 0.9))
    for points, label, color, width in lines:
        for k, rows in enumerate(shown):
            name = label if k == 0 else None
            panel.plot(*points[rows].T, color=color, linewidth=width, label=name)
    panel.set_aspect("equal")
    panel.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    panel.locator_params(nbins=4)
    panel.set_title(f"{most} of {len(windows)} windows", fontsize="small")


def _draw_length(
    panel: Any, ball: BallSeries, models: Any, time: Array, starts: NDArray[np.intp]
) -> None:
    def distance(points: Array) -> Array:
        length: Array = np.linalg.norm(points - ball.anchor, axis=1)
        return length

    taut = ball.taut
    panel.fill_between(
        *_broken(time, np.ones(len(time)), starts),
        where=np.insert(taut, starts, False),
        transform=panel.get_xaxis_transform(),
        color="#eaf3fa",
        label="taut",
    )
    panel.plot(*_broken(time, distance(ball.measured), starts), color=MEASURED, linewidth=2.5)
    for points, _, color in models:
        panel.plot(*_broken(time, distance(points), starts), color=color, linewidth=0.8)
    panel.axhline(ball.length, color=AFTER, linestyle="--", linewidth=1)
    panel.set_ylabel("distance from\nthe anchor [m]", fontsize="small")
    panel.set_title(f"taut where shaded; dashed: the string, {ball.length:.4g} m", fontsize="small")
    panel.set_xlabel("time [s]")
    _mark(panel, ball, time)


def _map(direction: Array) -> Array:
    """Lambert's equal-area map of unit vectors, straight down in the middle."""
    scale = np.sqrt(2 / np.maximum(1 - direction[:, 2:], 1e-9))
    out: Array = direction[:, :2] * scale
    return out


def _draw_sphere(figure: Figure, panels: Any, ball: BallSeries, models: Any) -> None:
    delta = ball.measured - ball.anchor
    with np.errstate(invalid="ignore"):
        direction = delta / np.linalg.norm(delta, axis=1, keepdims=True)
    at = _map(direction)
    known = np.isfinite(at).all(axis=1)
    radius = 1.05 * np.hypot(*at[known].T).max() if known.any() else 1.0
    edges = np.linspace(-radius, radius, CELLS + 1)
    means = []
    for points, label, color in models:
        error = ball.measured - points
        along = np.sum(direction * error, axis=1)
        across = error - along[:, None] * direction
        size = np.linalg.norm(across, axis=1)
        use = known & np.isfinite(size)
        # Its direction in the map, by a small step.
        step = direction + 1e-4 * across / np.maximum(size, 1e-12)[:, None]
        arrow = _map(step / np.linalg.norm(step, axis=1, keepdims=True)) - at
        arrow *= (size / np.maximum(np.hypot(*arrow.T), 1e-12))[:, None]

        def mean(values: Array, use: NDArray[np.bool_] = use) -> Array:
            x, y = at[use].T
            n = np.histogram2d(x, y, bins=(edges, edges))[0]
            total = np.histogram2d(x, y, bins=(edges, edges), weights=values[use])[0]
            least = LEAST_ROWS if use.sum() >= MANY_ROWS else 1
            out: Array = np.where(n >= least, total / np.maximum(n, 1), np.nan)
            return out

        cells = [1e3 * mean(v) for v in (along, arrow[:, 0], arrow[:, 1])]
        means.append((label, color, cells))
        panels["along"].hist(
            1e3 * along[use & ball.taut], bins=60, histtype="step", color=color, label=label
        )
    panels["along"].set_xlabel("error along the string while taut [mm]")
    panels["along"].set_ylabel("rows")
    finite = np.concatenate([np.abs(cells[0][np.isfinite(cells[0])]) for _, _, cells in means])
    sizes = np.concatenate([np.hypot(x, y)[np.isfinite(x)] for _, _, (_, x, y) in means])
    long = float(np.quantile(sizes, 0.95)) if sizes.size else 1.0
    arrows: Any = {"angles": "xy", "scale_units": "xy", "pivot": "mid", "width": 0.004}
    arrows["scale"] = max(long, 1e-9) / (1.5 * (edges[1] - edges[0]))
    full = float(np.quantile(finite, 0.95)) if finite.size else 1.0
    centre = (edges[1:] + edges[:-1]) / 2
    grid_x, grid_y = np.meshgrid(centre, centre, indexing="ij")
    names = ("before", "after") if len(means) > 1 else ("after",)
    for name in {"before", "after"} - set(names):
        panels[name].set_axis_off()
    for name, (label, _, (along, x, y)) in zip(names, means, strict=True):
        panel = panels[name]
        colors = panel.pcolormesh(
            edges, edges, along.T, cmap="RdBu_r", vmin=-full, vmax=full, rasterized=True
        )
        drawn = panel.quiver(grid_x, grid_y, x, y, **arrows)
        panel.quiverkey(drawn, 0.85, 0.04, long, f"{long:.2g} mm across", labelpos="N")
        for degrees in (15, 30, 45, 60, 90, 120, 150):
            if (r := 2 * np.sin(np.radians(degrees) / 2)) < radius:
                around = np.linspace(0, 2 * np.pi, 90)
                panel.plot(r * np.cos(around), r * np.sin(around), ":", color="0.6", linewidth=0.7)
                panel.annotate(f"{degrees}°", (0.71 * r, 0.71 * r), fontsize="x-small", color="0.4")
        panel.set(xlim=(-radius, radius), ylim=(-radius, radius), aspect="equal")
        panel.set(xticks=[], yticks=[], xlabel="x, seen from above", ylabel="y")
        panel.set_title(f"{label}: over the string's direction", fontsize="small")
    figure.colorbar(
        colors, ax=panels["after"], label="mean error along the string [mm]", shrink=0.8
    )
