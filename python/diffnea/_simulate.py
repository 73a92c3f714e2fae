"""Recordings of simulated robots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import models
from ._core import FileError, Model, Simulation, Trajectory, _simulate, _worlds, read_trajectory
from ._files import StrPath, load_model

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def simulate(
    model: Model | StrPath,
    trajectory: Trajectory | StrPath,
    *,
    world: str | None = None,
    seed: int | None = None,
    noise: float | None = None,
    rate: float = 500.0,
    kp: ArrayLike | None = None,
    kd: ArrayLike | None = None,
    bandwidth: float = 16.0,
    damping: float = 0.7,
    gravity_compensation: bool = True,
    period: float | None = None,
    flight: float = 2.0,
) -> Simulation:
    """Follow a desired motion with a controller that knows the model, and record.

    A robot that floats is thrown up in a MuJoCo world, once for each ``flight`` of the motion:
    ``Simulation.recordings`` has its flights, with the pose of its base.

    Args:
        model: what the controller knows of the robot, or the path of its description.
        trajectory: the desired motion, or the path of its file; its first row is the start, at
            rest. Of a model whose constraints close loops that of the joints with a motor; with
            those of all joints, it says how the loop is assembled.
        world: the robot: ``mujoco:NAME[,key=value…]`` (see :func:`worlds`), which may differ from
            the model and has noisy sensors. Default: the model itself, without noise.
        seed: of the noise and the perturbation; the world's own ``seed=`` comes first.
        noise: factor on the sensors' noise. Default: 0 for the model itself, the world's
            otherwise.
        rate: of the control and of the rows [Hz].
        kp: gains (n,) [N·m/rad] or [N/m]; default: from the model by ``bandwidth`` [rad/s] and
            ``damping``, raised where a joint would miss its motion by more than 10 %. Loops are
            controlled by computed torque if neither ``kp`` nor ``kd`` is given.
        kd: gains (n,) [N·m·s/rad] or [N·s/m].
        bandwidth: of the gains that are derived [rad/s].
        damping: of the gains that are derived.
        gravity_compensation: by the model, at the measured position.
        period: of the desired motion, if it has one [s].
        flight: of a robot that floats, duration of each flight [s].

    Raises:
        DataError: a loop does not close along the motion, or is not held (with the time).
        ModelError: constraints leave more motions than there are drives; the base floats, and
            there is no ``world``, or that of one of both alone does.

    """
    if not isinstance(model, Model):
        model = load_model(model)
    if not isinstance(trajectory, Trajectory):
        trajectory = read_trajectory(trajectory)
    if world is not None:
        world = _with_path(world)
    return _simulate(
        model,
        trajectory,
        world,
        seed,
        noise,
        rate,
        kp,
        kd,
        bandwidth,
        damping,
        gravity_compensation,
        period,
        flight,
    )


def worlds() -> dict[str, Any]:
    """Worlds that :func:`simulate` knows by name, and their keys: schema ``diffnea/worlds/1``."""
    found: dict[str, Any] = _worlds()
    found["worlds"] = [
        {"world": f"mujoco:{name}", "file": str(path)}
        for name in models.names()
        if (path := models.path(name)).suffix == ".xml"
    ] or found["worlds"]
    return found


def _with_path(world: str) -> str:
    """Name this installation's own description, which the compiled part cannot find by itself."""
    kind, colon, rest = world.partition(":")
    name, comma, keys = rest.partition(",")
    if not colon or not name or "." in name or "/" in name:
        return world
    try:
        return f"{kind}:{models.path(f'{name}.xml')}{comma}{keys}"
    except FileError:
        return world  # the compiled part lists what there is
