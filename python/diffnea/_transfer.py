"""`transfer`: learned movements in a world that is not the model."""

from __future__ import annotations

import html
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ._core import (
    _BALL_IN_CUP_WORLD,
    Error,
    Model,
    Policy,
    Recording,
    _World,
    _world_differences,
    _world_file,
    frame_pose,
)
from ._files import StrPath, load_model
from ._learn_result import LearnResult
from ._readers.packages import import_package
from ._results import _table
from ._rollouts import RolloutTrace
from ._simulate import _with_path
from ._tables import table
from .style import new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    Array: TypeAlias = NDArray[np.float64]

IMAGINED, OBTAINED = "C1", "C0"


@dataclass(frozen=True, repr=False)
class Execution:
    """A policy's mean executed once."""

    seed: int
    """Of the world's noise."""
    outcome: str
    """``in_cup``, ``late``, ``fell_out``, ``rim``, ``beside``, ``missed``; or ``failed``."""
    text: str
    """One clause: when, and by how much."""
    reward: float
    """Of what happened, at the dipole's ε that was learned with."""
    reward_wide: float
    """At ε = 0.055 m², which gives rewards of the paper's size."""
    failure: str
    """Of the world's solver, or the limit that the motion breaks; empty if none."""
    trace: RolloutTrace
    """All that was seen."""

    @property
    def success(self) -> bool:
        """The ball is in the cup throughout the last half second."""
        return self.outcome == "in_cup"

    def __repr__(self) -> str:
        return f"Execution({self.outcome}: {self.text or self.failure}; reward {self.reward:.3f})"


@dataclass(frozen=True, repr=False)
class TransferResult:
    """What became of policies in a world: every one once, the best again and again."""

    world: str
    """As it was named."""
    controller: Model
    """What the controller knew."""
    policies: list[Policy]
    """That were executed."""
    executions: list[Execution]
    """One a policy, without noise."""
    repetitions: list[Execution]
    """Of the best policy, with noise."""
    imagined: list[RolloutTrace]
    """Of every policy in the model; empty where the model was not given."""
    recordings: list[Recording] = field(default_factory=list)
    """What sensors saw of every executed policy, where :func:`transfer` was asked to record."""
    differences: list[str] = field(default_factory=list)
    """Clauses on how the world may differ from its description; empty: it is its description."""

    @property
    def best(self) -> int:
        """Number of the policy that was repeated: success first, then reward."""
        usable = [k for k, e in enumerate(self.executions) if not e.failure]
        if not usable:
            raise Error("transfer: every execution failed")
        return max(usable, key=lambda k: (self.executions[k].success, self.executions[k].reward))

    @property
    def outcomes(self) -> list[str]:
        """Of the executions, one a policy."""
        return [execution.outcome for execution in self.executions]

    @property
    def success(self) -> float:
        """Share of the policies that succeed."""
        return _share(self.executions)

    @property
    def repeatability(self) -> float:
        """Share of the best policy's repetitions that succeed; NaN without any."""
        return _share(self.repetitions)

    def plot(self, policy: int | None = None) -> Figure:
        """Draw the ball's path as the model had it and as it was, of a policy (default: best)."""
        figure = new_figure("TransferResult.plot", 11, 5)
        k = self.best if policy is None else policy
        panels: Any = figure.subplot_mosaic(
            [["space", "height"], ["space", "across"]],
            per_subplot_kw={"space": {"projection": "3d"}},
        )
        obtained = self.executions[k].trace
        lines = [(obtained, "obtained", OBTAINED, 1.5)]
        if self.imagined:
            lines.insert(0, (self.imagined[k], "imagined", IMAGINED, 1.5))
        for repetition in self.repetitions if k == self.best else []:
            lines.insert(0, (repetition.trace, "", "0.8", 0.6))
        for trace, label, color, width in lines:
            style = {"color": color, "linewidth": width, "label": label or None}
            panels["space"].plot(*trace.points("ball").T, **style)
            height, across = _in_cup(trace)
            panels["height"].plot(trace.time, 100 * height, **style)
            panels["across"].plot(trace.time, 100 * across, **style)
        cup = self.controller.to_dict().get("cup", {})
        if {"rim", "inner_radius"} <= cup.keys():
            panels["height"].axhline(100 * cup["rim"], color="0.4", linestyle=":")
            panels["across"].axhline(100 * cup["inner_radius"], color="0.4", linestyle=":")
        _cube(panels["space"], np.concatenate([line[0].points("ball") for line in lines]))
        panels["height"].set_ylabel("height in the cup [cm]")
        panels["across"].set(xlabel="time [s]", ylabel="from its axis [cm]")
        figure.legend(*panels["height"].get_legend_handles_labels(), loc="outside lower center")
        figure.suptitle(f"policy {k}: {self.executions[k].text or self.executions[k].failure}")
        return figure

    def animate(
        self,
        path: StrPath,
        *,
        policy: int | None = None,
        repetition: int | None = None,
        fps: int = 25,
    ) -> None:
        """Write a film of an execution: ``.gif`` (Pillow) or ``.mp4`` (ffmpeg).

        ``policy``: number of the execution, default: the best; ``repetition``: number of one of
        the best policy's repetitions instead. Real time at ``fps`` pictures a second.
        """
        k = self.best if policy is None else policy
        shown = self.executions[k] if repetition is None else self.repetitions[repetition]
        imagined = self.imagined[k] if self.imagined and repetition is None else None
        animate(shown.trace, self.controller, path, fps=fps, imagined=imagined)

    def to_frame(self) -> pd.DataFrame:
        """Return a data frame, a row an execution.

        ``policy`` counts the policies, ``repetition`` the executions of the best with noise; it is
        missing for those that each policy had without.
        """
        rows: list[tuple[int, int | None, Execution]]
        rows = [(k, None, e) for k, e in enumerate(self.executions)]
        rows += [(self.best, k, e) for k, e in enumerate(self.repetitions)]
        frame = table(
            [
                {"policy": policy, "repetition": repetition, "success": e.success}
                | {
                    name: getattr(e, name)
                    for name in ("seed", "outcome", "text", "reward", "reward_wide", "failure")
                }
                for policy, repetition, e in rows
            ],
            index=False,
        )
        return frame.astype({"repetition": "Int64"}) if rows else frame

    def to_dict(self) -> dict[str, Any]:
        """Outcomes and rewards as plain data."""

        def row(execution: Execution) -> dict[str, Any]:
            names = ("seed", "outcome", "text", "reward", "reward_wide", "failure", "success")
            return {name: getattr(execution, name) for name in names}

        return {
            "world": self.world,
            "differences": self.differences,
            "success": self.success,
            "repeatability": self.repeatability,
            "policies": [policy.seed for policy in self.policies],
            "best": self.best if any(not e.failure for e in self.executions) else None,
            "executions": [row(execution) for execution in self.executions],
            "repetitions": [row(execution) for execution in self.repetitions],
        }

    def __repr__(self) -> str:
        return (
            f"TransferResult({self.world!r}: {_count(self.executions)} policies succeed"
            + (f", the best in {_count(self.repetitions)}" if self.repetitions else "")
            + ")"
        )

    def _repr_html_(self) -> str:
        rows = [
            [str(policy.seed), e.outcome, e.text or e.failure, f"{e.reward:.3f}"]
            for policy, e in zip(self.policies, self.executions, strict=True)
        ]
        head = ["seed", "outcome", "", "reward"]
        world = "; ".join(self.differences) or "the world is as its description says"
        return f"<p>{html.escape(repr(self))}<br>{html.escape(world)}</p>" + _table(head, rows)


def _share(executions: Sequence[Execution]) -> float:
    return float(np.mean([e.success for e in executions])) if executions else float("nan")


def _count(executions: Sequence[Execution]) -> str:
    return f"{sum(e.success for e in executions)} of {len(executions)}"


def _in_cup(trace: RolloutTrace) -> tuple[Array, Array]:
    """Height of the ball along the cup's axis, and its distance from it."""
    delta, axis = trace.points("ball") - trace.points("cup"), trace.points("axis")
    height: Array = np.sum(delta * axis, axis=1)
    across: Array = np.linalg.norm(delta - height[:, None] * axis, axis=1)
    return height, across


def _cube(panel: Any, points: Array) -> None:
    """Show a cube about the points, so that lengths are equal along all axes."""
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    middle, half = (low + high) / 2, 0.55 * (high - low).max()
    for axis, centre in zip("xyz", middle, strict=True):
        limits = (centre - half, centre + half)
        panel.set(**{f"{axis}lim": limits, f"{axis}label": f"{axis} [m]"})
    panel.locator_params(nbins=5)


def transfer(
    policies: LearnResult | Policy | Sequence[Policy],
    world: str = _BALL_IN_CUP_WORLD,
    *,
    controller: Model | StrPath | None = None,
    repetitions: int = 10,
    torque_noise: float = 0.1,
    posture_noise: float = 1e-3,
    position_noise: float = 0.0,
    seed: int = 0,
    threads: int = 1,
    record: bool = False,
) -> TransferResult:
    """Execute learned policies in a world that is not the model they were learned in.

    Every policy once, without noise; the best of them again with noise.

    Args:
        policies: what :func:`learn` gave, or policies.
        world: ``mujoco:NAME[,key=value…]`` with a ball and a cup, see :func:`worlds`; default:
            the WAM of ``diffnea experiment``, which differs from its description.
        controller: model that the controller compensates gravity with; default: that of
            ``policies``, or the description that the world is named after.
        repetitions: of the best policy, with noise.
        torque_noise: of the drives in repetitions [N·m].
        posture_noise: of the posture in repetitions, constant through one [rad].
        position_noise: of every position that the controller reads in repetitions [rad].
        seed: of the world, where it has none of its own; repetitions are seeded from it.
        threads: executions side by side; the result does not depend on it.
        record: every policy once more, before the robot's sensors and their noise, for
            :func:`identify` and :func:`diagnose`.

    Raises:
        DataError: a policy starts beyond the robot's range.

    """
    name, string = _with_path(world), None
    imagined: list[RolloutTrace] = []
    if isinstance(policies, LearnResult):
        string = policies.string
        imagined = [policies.imagine(policy) for policy in policies.policies]
        if controller is None:
            controller = policies.controller
        policies = policies.policies
    elif isinstance(policies, Policy):
        policies = [policies]
    if not policies:
        raise Error("transfer: policies: there are none")
    if controller is None:
        controller = _world_file(name)
    if not isinstance(controller, Model):
        controller = load_model(controller)
    noises = (position_noise, torque_noise, posture_noise)
    worlds: dict[Any, _World] = {}

    def world_of(policy: Policy) -> _World:
        """Policies of one controller share a world."""
        values = policy.controller.items()
        key = tuple((k, x.tobytes() if isinstance(x, np.ndarray) else x) for k, x in values)
        if key not in worlds:
            worlds[key] = _World(name, controller, policy, string, seed, *noises)
        return worlds[key]

    def execute(policy: Policy, noisy: bool, noise_seed: int) -> Execution:
        found = world_of(policy).execute(policy, noisy, noise_seed)
        return Execution(*found[:6], RolloutTrace(*found[6]))

    for policy in policies:
        world_of(policy)
    with ThreadPoolExecutor(threads) as pool:
        executions = list(pool.map(lambda policy: execute(policy, False, seed), policies))
        first = TransferResult(world, controller, list(policies), executions, [], imagined)
        repeated: list[Execution] = []
        if repetitions and any(not e.failure for e in executions):
            best = policies[first.best]
            jobs = range(seed + 1, seed + 1 + repetitions)
            repeated = list(pool.map(lambda job: execute(best, True, job), jobs))
        recordings: list[Recording] = []
        if record:
            executed = [p for p, e in zip(policies, executions, strict=True) if len(e.trace.time)]
            recordings = list(pool.map(lambda policy: world_of(policy).record(policy), executed))
    return TransferResult(
        world,
        controller,
        list(policies),
        executions,
        repeated,
        imagined,
        recordings,
        _world_differences(name),
    )


def animate(
    trace: RolloutTrace,
    model: Model,
    path: StrPath,
    *,
    fps: int = 25,
    imagined: RolloutTrace | None = None,
) -> None:
    """Write a film of a rollout with the robot as a stick figure; ``imagined``: a second ball."""
    import_package("matplotlib", "animate", "plots")
    from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter

    kind = Path(path).suffix.lower()
    if kind not in (".gif", ".mp4"):
        raise Error(f"animate: path: got {os.fspath(path)!r}; choices: .gif, .mp4")
    if kind == ".mp4" and not FFMpegWriter.isAvailable():
        raise Error("animate: path: .mp4 needs ffmpeg, which is not on PATH; write a .gif")
    if not len(trace.time):
        raise Error(f"animate: the rollout has no rows: {trace.failure}")
    writer: AbstractMovieWriter = (FFMpegWriter if kind == ".mp4" else PillowWriter)(fps=fps)
    times = np.arange(trace.time[0], trace.time[-1], 1 / fps)
    if not len(times):  # it ended where it began
        times = trace.time[:1]
    rows = np.searchsorted(trace.time, times)
    q = np.stack([trace[f"q_{joint}"] for joint in model.joint_names], axis=1)[rows]
    frames = [link.name for link in model.links if link.joint or not link.parent]
    arm = np.stack([frame_pose(model, frame, q=q)[:, :3, 3] for frame in frames], axis=1)
    cup, ball = trace.points("cup")[rows], trace.points("ball")[rows]
    arm = np.concatenate([arm, cup[:, None]], axis=1)

    figure = new_figure("animate", 5, 5)
    panel: Any = figure.add_subplot(projection="3d")
    everything = np.concatenate([arm.reshape(-1, 3), ball])
    _cube(panel, everything)
    (links,) = panel.plot([], [], [], "o-", color="0.3", linewidth=3, markersize=4)
    (string,) = panel.plot([], [], [], color="0.6", linewidth=1)
    (path_line,) = panel.plot([], [], [], color=OBTAINED, linewidth=0.8)
    (dot,) = panel.plot([], [], [], "o", color=OBTAINED, markersize=7)
    (ghost,) = panel.plot([], [], [], "o", color=IMAGINED, markersize=7, alpha=0.6)
    with writer.saving(figure, os.fspath(path), dpi=80):
        for k, row in enumerate(rows):
            links.set_data_3d(*arm[k].T)
            string.set_data_3d(*np.stack([cup[k], ball[k]], axis=1))
            path_line.set_data_3d(*ball[: k + 1].T)
            dot.set_data_3d(*ball[k : k + 1].T)
            if imagined is not None and len(imagined.time):
                at = min(int(row), len(imagined.time) - 1)
                ghost.set_data_3d(*imagined.points("ball")[at : at + 1].T)
            panel.set_title(f"{trace.time[row]:.2f} s")
            writer.grab_frame()
