# ruff: noqa: E501
"""The common law as a MuJoCo model: the same servo, with MuJoCo's own dry friction, a soft constraint.

Actuators take gain x enabled x command, gain x enabled, and enabled as controls: so the drive can be switched off, and
runs of several gains share a model. A fixed tendon's largest force is the drive's.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco import rollout
from servo_pendulum import GRAVITY, Law, Pendulum, Run
from signals import Array

STEP = 0.002  # s, MuJoCo's default
FINE = 0.001  # s
COMMAND = 3  # the control that no force follows: the command, for delays


def specification(body: Pendulum, step: float) -> mujoco.MjSpec:
    return mujoco.MjSpec.from_string(
        f"""<mujoco>
<option timestep="{step}" integrator="implicitfast" gravity="0 0 {-GRAVITY}"/>
<worldbody><body><joint name="servo" axis="0 1 0"/>
<inertial pos="0 0 {-body.length}" mass="{body.mass}" diaginertia="{body.about_com} {body.about_com} 1e-7"/>
</body></worldbody>
<tendon><fixed name="gear" actuatorfrclimited="true" actuatorfrcrange="-1 1"><joint joint="servo" coef="1"/></fixed></tendon>
<actuator>
<general name="command" tendon="gear"/>
<general name="feedback" tendon="gear" gaintype="affine" gainprm="0"/>
<general name="brake" joint="servo" gaintype="affine" gainprm="0"/>
<general name="offset" joint="servo" gainprm="0" biastype="affine"/>
</actuator>
<sensor><jointpos name="servo" joint="servo"/></sensor>
</mujoco>"""
    )


def set_law(spec: mujoco.MjSpec, law: Law) -> None:
    joint = spec.joint("servo")
    for name, value in (
        ("damping", law.viscous),
        ("frictionloss", law.coulomb),
        ("armature", law.armature),
    ):
        if np.ndim(getattr(joint, name)):  # polynomial in newer versions
            getattr(joint, name)[0] = value
        else:
            setattr(joint, name, value)
    bound = law.stiffness * law.reach if np.isfinite(law.reach) else 1e6
    spec.tendon("gear").actfrcrange = [-bound, bound]
    spec.actuator("command").gainprm[0] = law.stiffness
    spec.actuator("feedback").gainprm[1] = -law.stiffness
    spec.actuator("brake").gainprm[2] = -law.damping
    spec.actuator("offset").biasprm[0] = -law.offset


def setpoint(command: Array, step: float, speed: float) -> Array:
    """The command at no more than a speed."""
    if not np.isfinite(speed):
        return command
    out, at = np.empty_like(command), command[0]
    for k, told in enumerate(command.tolist()):
        at += min(max(told - at, -speed * step), speed * step)
        out[k] = at
    return out


def controls(run: Run, time: Array) -> Array:
    """Controls (time, 4) without delay."""
    on = run.enabled(time)
    command = run.commands(time, held=False)
    return np.stack([run.gain * on * command, run.gain * on, on, command], axis=1)


def delayed(control: Array, time: Array, law: Law) -> Array:
    """Controls whose command is late by the delay, and limited in speed."""
    out = control.copy()
    command = np.interp(time - law.delay, time, control[:, COMMAND])
    out[:, 0] = control[:, 1] * setpoint(command, float(time[1] - time[0]), law.speed)
    return out


def simulate(run: Run, law: Law, held: bool, step: float) -> tuple[Array, Array]:
    """Times and positions of a whole run from its first state, never reset."""
    spec = specification(run.pendulum, step)
    set_law(spec, law)
    model = spec.compile()
    time = run.grid(step)
    control = controls(run, time)
    late = run.commands(time - law.delay, held)
    control[:, 0] = control[:, 1] * setpoint(late, step, law.speed)
    q, v = run.first_state()
    states, _ = rollout.rollout(model, mujoco.MjData(model), np.array([0.0, q, v]), control)
    return np.append(time, time[-1] + step), np.concatenate([[q], states[0, :, 1]])


def errors(runs: Sequence[Run], law: Law, held: bool, step: float) -> list[float]:
    """Mean absolute error of each run at the rows that were read [rad]."""
    return [run.error(*simulate(run, law, held, step)) for run in runs]
