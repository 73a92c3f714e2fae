"""Pictures of the page, as SVG; matplotlib draws them."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .._core import Model, frame_pose
from .._readers.packages import import_package
from ..style import BLUE, GREEN, ORANGE, PURPLE, SVG, new_figure
from .jobs import Json, Result, Results
from .table1 import SIMULATION, TITLES, Row
from .traces import PERIOD, Movement, across, arm_points, length_errors
from .work import IN_CUP

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = {"lstm": PURPLE, "ff-nn": GREEN, "nominal": ORANGE, "diffnea": BLUE}
IMAGINED, OBTAINED, ARM = "#efb04a", BLUE, "#556677"
FRAMES = 6


def svg(figure: Figure) -> str:
    """Return the drawing as a document."""
    matplotlib = import_package("matplotlib", "reproduce: the page", "plots")
    stream = io.StringIO()
    with matplotlib.rc_context(SVG):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return stream.getvalue()


def scatter(rows: Sequence[Row], results: Results) -> Figure:
    """Draw expected against obtained reward: a panel a system and string, a point a policy."""
    panels = list(dict.fromkeys((row.system, row.length) for row in rows))
    columns = min(4, len(panels))
    lines = -(-len(panels) // columns)
    figure = new_figure("reproduce: the page", 3.2 * columns + 0.4, 3.2 * lines + 0.5)
    axes: Any = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    for k, panel in enumerate(axes.flat):
        if k >= len(panels):
            panel.set_visible(False)
            continue
        system, length = panels[k]
        panel.axline((0, 0), slope=1, color="0.8", linewidth=1)
        for row in rows:
            if (row.system, row.length) != panels[k]:
                continue
            policies = [
                p
                for unit in row.units
                for job in unit.transfers
                if results.has(job)
                for p in results.read(job).data["policies"]
                if p["reward_wide"] is not None and p["expected_wide"] is not None
            ]
            for won, face in ((True, COLORS[row.kind]), (False, "none")):
                chosen = [p for p in policies if bool(p["success"]) == won]
                panel.scatter(
                    [p["expected_wide"] for p in chosen],
                    [p["reward_wide"] for p in chosen],
                    s=16,
                    facecolors=face,
                    edgecolors=COLORS[row.kind],
                    linewidths=0.8,
                    rasterized=len(policies) > 300,
                )
        name = system if system == SIMULATION else f"surrogate {system}"
        panel.set_title(f"{name}, {100 * length:.0f} cm", fontsize=10)
    figure.supxlabel("reward in the model", fontsize=10)
    figure.supylabel("reward obtained", fontsize=10)
    return figure


def film_strip(model: Model, movement: Movement) -> Figure:
    """Draw instants of a movement from the side, with both balls' paths until then."""
    figure = new_figure("reproduce: the page", 11, 1.9)
    axes: Any = figure.subplots(1, FRAMES, sharex=True, sharey=True)
    ball, imagined = movement.obtained["ball"], movement.imagined["ball"]
    x = across(ball)
    arm = arm_points(model, movement.obtained["q"])
    cup, axis = movement.obtained["cup"], movement.obtained["axis"]
    caught = np.flatnonzero(np.isin(movement.imagined["phase"][:, 0], IN_CUP))
    last = min(len(ball) - 1, (int(caught[0]) if len(caught) else len(ball)) + 20)
    low, high = _view(arm, ball[: last + 1], x)
    for panel, row in zip(axes, np.linspace(0, last, FRAMES).astype(int), strict=True):
        panel.plot(arm[row] @ x, arm[row, :, 2], color=ARM, linewidth=3, solid_capstyle="round")
        side = x - np.dot(x, axis[row]) * axis[row]
        side /= np.linalg.norm(side) or 1.0
        mouth = [
            (s * 0.04) * side + h * axis[row] for s, h in ((-1, 0.095), (-1, 0), (1, 0), (1, 0.095))
        ]
        rim = cup[row] + np.array(mouth)
        panel.plot(rim @ x, rim[:, 2], color="#223", linewidth=1.5)
        tied = np.stack([cup[row], ball[row]])
        panel.plot(tied @ x, tied[:, 2], color="0.6", linewidth=0.7)
        seen = min(row, len(imagined) - 1)
        inside = np.abs(imagined).max(axis=1) < 5.0
        path = np.where(inside[:, None], imagined, np.nan)[: seen + 1]
        panel.plot(path @ x, path[:, 2], color=IMAGINED, linewidth=2.5, alpha=0.7)
        panel.plot(ball[: row + 1] @ x, ball[: row + 1, 2], color=OBTAINED, linewidth=1)
        panel.plot(*_dot(imagined[seen], x), "o", color=IMAGINED, markersize=7)
        panel.plot(*_dot(ball[row], x), "o", color=OBTAINED, markersize=5)
        panel.set_title(f"{row * PERIOD:.2f} s", fontsize=8)
        panel.set(
            xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xticks=[], yticks=[]
        )
        for edge in panel.spines.values():
            edge.set_color("0.85")
    return figure


def length_error(rows: Sequence[Row], results: Results) -> Figure | None:
    """Draw how far balls leave the sphere of their string, in the models and in the worlds."""
    figure = new_figure("reproduce: the page", 10, 3.4)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    by_kind: dict[str, list[dict[str, np.ndarray]]] = {}
    for row in rows:
        by_kind.setdefault(row.kind, []).append(length_errors(row, results))
    drawn = False
    for panel, which in ((left, "imagined"), (right, "obtained")):
        for kind, parts in by_kind.items():
            found = [part[which] for part in parts if part[which].size]
            if not found:
                continue
            longest = max(errors.shape[1] for errors in found)
            missing = [((0, 0), (0, longest - errors.shape[1])) for errors in found]
            errors = np.concatenate(
                [
                    np.pad(errors, width, constant_values=np.nan)
                    for errors, width in zip(found, missing, strict=True)
                ]
            )
            enough = np.isfinite(errors).sum(axis=0) >= max(1, len(errors) // 4)
            errors = np.maximum(errors[:, enough], 1e-5)
            time = np.flatnonzero(enough) * PERIOD
            middle, high = np.nanquantile(errors, (0.5, 0.9), axis=0)
            panel.plot(time, 100 * middle, color=COLORS[kind], label=TITLES[kind])
            panel.fill_between(time, 100 * middle, 100 * high, color=COLORS[kind], alpha=0.15)
            drawn = True
        panel.set(yscale="log", xlabel="time [s]", title=f"ball's path {which}")
        panel.title.set_fontsize(10)
    left.set_ylabel("beyond the string [cm]")
    if drawn:
        left.legend(fontsize=8)
    return figure if drawn else None


def first_figure(identified: Result, recorded: Result, home: Sequence[float]) -> Figure:
    """Draw the paper's Figure 1: the arm before and after, and the data that it is known from."""
    figure = new_figure("reproduce: the page", 11, 5.2)
    panels: Any = figure.subplot_mosaic(
        [["arm", "q"], ["arm", "slow"], ["arm", "ball"]], width_ratios=(1, 1.6)
    )
    drawn = (
        ("begin", "#e69f00", "before"),
        ("model", OBTAINED, "identified"),
    )
    for key, color, label in drawn:
        _draw_arm(panels["arm"], identified.data[key], np.asarray(home, float), color, label)
    panels["arm"].set(aspect="equal", xlabel="x [m]", ylabel="z [m]")
    panels["arm"].legend(fontsize=8, loc="lower right")
    arrays = recorded.arrays
    joints = recorded.data["arm"]["joints"]
    for key, name, title in (
        ("q", "arm", "arm, fast [rad]"),
        ("slow", "ball", "under the ball, slow [rad]"),
    ):
        step = max(1, len(arrays[f"{name}_time"]) // 2000)
        for j, joint in enumerate(joints):
            panels[key].plot(
                arrays[f"{name}_time"][::step],
                arrays[f"{name}_q"][::step, j],
                linewidth=0.7,
                label=joint,
            )
        panels[key].set_title(title, fontsize=9)
    panels["q"].legend(fontsize=7, ncol=len(joints), loc="upper right")
    ball, time = arrays["ball_ball"], arrays["ball_time"]
    seen = np.flatnonzero(np.isfinite(ball).all(axis=1))
    seen = seen[:: max(1, len(seen) // 2000)]
    for axis, values in zip("xyz", (ball[seen] - np.nanmean(ball, axis=0)).T, strict=True):
        panels["ball"].plot(time[seen], values, linewidth=0.7, label=axis)
    panels["ball"].set_title("ball, about its mean [m]", fontsize=9)
    panels["ball"].legend(fontsize=7, ncol=3, loc="upper right")
    panels["ball"].set_xlabel("time [s]")
    for key in ("q", "slow", "ball"):
        panels[key].tick_params(labelsize=7)
    return figure


def _draw_arm(panel: Any, content: Json, home: np.ndarray, color: str, label: str) -> None:
    """Links as sticks; at centres of mass the ellipse of the solid with mass and inertia."""
    from matplotlib.patches import Ellipse

    model = Model.from_dict(content)
    sticks = arm_points(model, home[None])[0]
    panel.plot(sticks[:, 0], sticks[:, 2], color=ARM, linewidth=2.5, solid_capstyle="round")
    for link in content["links"]:
        inertia = link.get("inertia")
        if not inertia or link["parent"] is None or inertia["mass"] <= 0:
            continue
        pose = frame_pose(model, link["name"], q=home[None])[0]
        mass = inertia["mass"]
        centre = np.array(inertia["first_moment"]) / mass
        xx, xy, xz, yy, yz, zz = inertia["about_origin"]
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        about = about - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        # Second moments of the mass; a solid ellipsoid's half axes are √(5 s).
        second = (0.5 * np.trace(about) * np.eye(3) - about) / mass
        turned = pose[:3, :3] @ second @ pose[:3, :3].T
        values, vectors = np.linalg.eigh(turned[np.ix_((0, 2), (0, 2))])
        width, height = 2 * np.sqrt(5 * np.maximum(values, 0.0))
        at = (pose[:3, :3] @ centre + pose[:3, 3])[[0, 2]]
        angle = float(np.degrees(np.arctan2(vectors[1, 0], vectors[0, 0])))
        panel.add_patch(
            Ellipse(at, width, height, angle=angle, fill=False, color=color, linewidth=1)
        )
        panel.plot(*at, "+", color=color, markersize=7)
    string = content["ball"]["string"]
    pose = frame_pose(model, string["link"], q=home[None])[0]
    knot = pose[:3, :3] @ np.array(string["attachment"]) + pose[:3, 3]
    below = knot[2] - string["length"]
    label = f"{label}: string {100 * string['length']:.2f} cm"
    panel.plot([knot[0], knot[0]], [knot[2], below], color=color, linewidth=1, label=label)
    panel.plot(knot[0], below, "o", color=color, markersize=6, fillstyle="none")


def _dot(point: np.ndarray, x: np.ndarray) -> tuple[list[float], list[float]]:
    return [float(point @ x)], [float(point[2])]


def _view(arm: np.ndarray, ball: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    moving = np.concatenate([arm[:, 2:].reshape(-1, 3), ball])
    points = np.stack([moving @ x, moving[:, 2]], axis=1)
    return points.min(axis=0) - 0.06, points.max(axis=0) + 0.06
