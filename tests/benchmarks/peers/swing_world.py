# ruff: noqa: E501
"""The world of the rollouts: a WAM swings a ball on a string, with the same controller and motions in every simulator.

u = g(q) + kp (q* − q) + kd (q̇* − q̇). MuJoCo's position actuator with the command q* + kd/kp q̇*, and `gravcomp` of the
arm's bodies, are the same law.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from cases import MODELS
from signals import Array

KP, KD = (200.0, 300.0, 100.0, 100.0), (7.0, 15.0, 5.0, 2.5)
HOME = (0.0, 0.6, 0.0, 1.25)
JOINTS = ("joint1", "joint2", "joint3", "joint4")
PERIOD, EPISODE, MOVE = 0.002, 2.5, 1.5  # s
WORLD = MODELS / "wam4_ball.xml"
RK4, EULER = mujoco.mjtIntegrator.mjINT_RK4, mujoco.mjtIntegrator.mjINT_EULER
WORLD_NOTE = (
    "the tendon of models/wam4_ball.xml; position actuators and gravcomp are the controller"
)


def mujoco_world(
    step: float, integrator: int, contacts: bool = True, ball: bool = True
) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_file(str(WORLD))
    spec.option.timestep, spec.option.integrator = step, integrator
    for name, kp, kd in zip(JOINTS, KP, KD, strict=True):
        actuator = spec.actuator(name)
        limit = list(actuator.ctrlrange)
        actuator.set_to_position(kp=kp, kv=kd)
        actuator.ctrllimited, actuator.forcelimited, actuator.forcerange = 0, 1, limit
    for body in spec.bodies:
        if body.name not in ("world", "ball"):
            body.gravcomp = 1.0
    if not contacts:
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    if not ball:
        for key in list(spec.keys):
            spec.delete(key)
        for tendon in list(spec.tendons):
            spec.delete(tendon)
        spec.delete(spec.body("ball"))
        for geom in list(spec.geoms):
            geom.contype = geom.conaffinity = 0
    return spec.compile()


def commands(promp: object, theta: Array, step: float, seconds: float = EPISODE) -> Array:
    """(N, steps, 4) commands of MuJoCo's actuators for motions of diffnea's primitive."""
    times = np.arange(round(seconds / PERIOD)) * PERIOD
    out = np.tile(np.asarray(HOME), (len(theta), len(times), 1))
    at = [JOINTS.index(name) for name in promp.joints]  # type: ignore[attr-defined]
    for k, row in enumerate(theta):
        q, qd = promp.motion(row, times)  # type: ignore[attr-defined]
        for column, j in enumerate(at):
            out[k, :, j] += q[:, column] + KD[j] / KP[j] * qd[:, column]
    return np.repeat(out, round(PERIOD / step), axis=1)


def start_state(model: mujoco.MjModel) -> Array:
    """At home, the ball hanging below the hand."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    out = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, out, kind)
    return out


def ball_path(model: mujoco.MjModel, state: Array) -> tuple[Array, Array]:
    """(T, 3) ball of a rollout's states, and (T,) length of its string."""
    data = mujoco.MjData(model)
    ball, length = [], []
    for row in state:
        mujoco.mj_setState(model, data, row, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_kinematics(model, data)
        ball.append(data.site("ball").xpos.copy())
        length.append(np.linalg.norm(ball[-1] - data.site("string_anchor").xpos))
    return np.array(ball), np.array(length)


def xml_path() -> Path:
    return WORLD
