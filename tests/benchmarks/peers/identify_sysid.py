# ruff: noqa: E501
"""MuJoCo's own identification, `mujoco.sysid`: rollouts under the recorded torques against the recorded motion.

    friction   damping, frictionloss, armature and an offset of every joint (as its SO-101 example, plus the offset)
    full       the same and ten inertial parameters of every link (`InertiaType.Pseudo`, its default bounds)

Windows of 0.5 s that start from the common signals' state: open loop, a rollout over a whole recording drifts away.
Positions and velocities are compared, the optimizer is its default (`optimizer="mujoco"`) with its default settings, or
`_scaled`: with x_scale='jac', which its warning about ill-conditioned problems advises.
A drive's offset is the actuator's bias, set by a modifier as its manual shows for own parameters.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from cases import Case
from mujoco import sysid
from signals import Array, Signals
from worker import Outcome, main

WINDOW = 0.5  # s
TIME_LIMIT = 600.0  # s of processor time, all threads: fair on a machine that is shared
Json = dict[str, Any]


class TimeOverError(Exception):
    """The time limit passed between two evaluations."""


def specification(case: Case, step: float) -> mujoco.MjSpec:
    """The robot with a motor, a position and a velocity sensor at every joint."""
    # Through MJCF, whatever the description was.
    read = mujoco.MjSpec.from_file(case.model)
    read.compile()
    spec = mujoco.MjSpec.from_string(read.to_xml())
    spec.option.timestep = step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags |= (
        mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    )
    spec.compiler.autolimits = 1
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for key in list(spec.keys):
        spec.delete(key)
    for joint in case.joints:
        motor = spec.add_actuator(
            name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT, ctrllimited=0
        )
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        spec.joint(joint).actfrclimited = 0
    for kind, sensor in (
        ("pos", mujoco.mjtSensor.mjSENS_JOINTPOS),
        ("vel", mujoco.mjtSensor.mjSENS_JOINTVEL),
    ):
        for joint in case.joints:
            spec.add_sensor(
                name=f"{joint}_{kind}",
                type=sensor,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                objname=joint,
            )
    return spec


def setter(joint: str, field: str) -> Callable[[mujoco.MjSpec, sysid.Parameter], None]:
    def modify(spec: mujoco.MjSpec, p: sysid.Parameter) -> None:
        value = getattr(spec.joint(joint), field)
        if np.ndim(value):  # polynomial in newer versions
            value[0] = p.value[0]
        else:
            setattr(spec.joint(joint), field, p.value[0])

    return modify


def offset_setter(joint: str) -> Callable[[mujoco.MjSpec, sysid.Parameter], None]:
    def modify(spec: mujoco.MjSpec, p: sysid.Parameter) -> None:
        spec.actuator(joint).biasprm[0] = p.value[0]

    return modify


def inertia_setter(body: str) -> Callable[[mujoco.MjSpec, sysid.Parameter], None]:
    """In place of sysid's own: in MuJoCo 3.17 and 4.0 that fails as soon as two bodies have such parameters.

    ("mass and inertia of moving bodies must be larger than mjMINVAL", also with the arm of its own tests.)
    """

    def modify(spec: mujoco.MjSpec, p: sysid.Parameter) -> None:
        pi = sysid.model_modifier.pi_from_theta(p.value)
        target, c = spec.body(body), pi[1:4] / pi[0]
        about_com = pi[4:].reshape(3, 3) - pi[0] * (c @ c * np.eye(3) - np.outer(c, c))
        moments, axes = np.linalg.eigh(about_com)
        if np.linalg.det(axes) < 0.0:
            axes[:, 0] *= -1.0
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, axes.flatten())
        target.mass, target.ipos, target.inertia, target.iquat = pi[0], c, moments, quat

    return modify


def parameters(
    case: Case, spec: mujoco.MjSpec, torque: Array, inertias: bool
) -> sysid.ParameterDict:
    """Bounds of friction: up to what the drive was seen to give; starts: small."""
    model = spec.compile()
    out = sysid.ParameterDict()
    for j, name in enumerate(case.joints):
        scale = float(np.abs(torque[:, j]).max())
        armature = float(model.dof_armature[j])
        for field, start, high in (
            ("damping", 0.02 * scale, 20.0 * scale),
            ("frictionloss", 0.02 * scale, scale),
            ("armature", max(armature, 0.01), 5.0),
        ):
            out.add(
                sysid.Parameter(f"{name}_{field}", start, 0.0, high, modifier=setter(name, field))
            )
        # With the drive's sign: motion needs what is commanded less the offset.
        out.add(sysid.Parameter(f"{name}_offset", 0.0, -scale, scale, modifier=offset_setter(name)))
    if inertias:
        for i in range(1, model.nbody):
            if model.body_dofnum[i]:
                out.add(
                    sysid.body_inertia_param(
                        spec,
                        model,
                        model.body(i).name,
                        inertia_type=sysid.InertiaType.Pseudo,
                        modifier=inertia_setter(model.body(i).name),
                    )
                )
    return out.move_off_bounds()  # as its warning about starts at a bound advises


def sequences(case: Case, spec: mujoco.MjSpec, s: Signals) -> sysid.ModelSequences:
    model = spec.compile()
    length = int(WINDOW * s.rate) + 1
    rows = s.rows()
    names, states, controls, sensors = [], [], [], []
    for first in range(rows[0], rows[-1] - length, length - 1):
        k = slice(first, first + length)
        t = s.time[k] - s.time[first]
        names.append(f"window_{first}")
        states.append(sysid.create_initial_state(model, s.q[first], s.qd[first]))
        controls.append(sysid.TimeSeries(t, s.raw_tau[k]))
        # rollout returns the state after each control: rows 1 and later.
        measured = np.concatenate([s.q[k], s.qd[k]], axis=1)
        sensors.append(sysid.TimeSeries.from_names(t, measured, model))
    return sysid.ModelSequences(case.name, spec, names, states, controls, sensors)


def inverse(spec: mujoco.MjSpec, case: Case) -> Callable[[Array, Array, Array], Array]:
    """Torques of the fitted model; dry friction by the sign of the speed, as it acts while a joint moves."""
    model = spec.compile()
    loss = model.dof_frictionloss.copy()
    offset = np.array([model.actuator(j).biasprm[0] for j in case.joints])
    model.dof_frictionloss[:] = 0.0
    data = mujoco.MjData(model)

    def predict(q: Array, qd: Array, qdd: Array) -> Array:
        out = np.empty_like(q)
        for k in range(len(q)):
            data.qpos[:], data.qvel[:], data.qacc[:] = q[k], qd[k], qdd[k]
            mujoco.mj_inverse(model, data)
            out[k] = data.qfrc_inverse
        return np.asarray(out + loss * np.sign(qd) - offset)

    return predict


def link_inertias(spec: mujoco.MjSpec) -> Array:
    model = spec.compile()
    out = []
    for i in range(1, model.nbody):
        if not model.body_dofnum[i]:
            continue
        m, c = model.body_mass[i], model.body_ipos[i]
        axes = np.empty(9)
        mujoco.mju_quat2Mat(axes, model.body_iquat[i])
        axes = axes.reshape(3, 3)
        about_com = axes @ np.diag(model.body_inertia[i]) @ axes.T
        about = about_com + m * (c @ c * np.eye(3) - np.outer(c, c))
        out.append(
            [
                m,
                *(m * c),
                about[0, 0],
                about[0, 1],
                about[0, 2],
                about[1, 1],
                about[1, 2],
                about[2, 2],
            ]
        )
    return np.array(out)


def fit(case: Case, inertias: bool, scaled: bool) -> Outcome:
    logging.disable(logging.INFO)
    s = case.signals("train")
    # MuJoCo's step divides the recording's; steps above 2 ms are too coarse for it.
    step = 1.0 / s.rate
    step /= max(1, round(step / 0.002))
    spec = specification(case, step)
    start = parameters(case, spec, s.tau, inertias)
    data = sequences(case, spec, s)
    residual = sysid.build_residual_fn(models_sequences=[data])
    began, calls = time.process_time(), 0
    best: Json = {"cost": np.inf, "x": start.as_vector(), "cost0": None}

    def watched(x: Array, p: sysid.ParameterDict, **kwargs: Any) -> Any:
        nonlocal calls
        out = residual(x, p, **kwargs)
        calls += 1
        if x.ndim == 1 or x.shape[1] == 1:
            cost = float(sum(np.sum(r**2) for r in out[0]))
            if best["cost0"] is None:
                best["cost0"] = cost
            if cost < best["cost"]:
                best.update(cost=cost, x=np.ravel(x).copy())
        if time.process_time() - began > TIME_LIMIT:
            raise TimeOverError
        return out

    notes = []
    try:
        options = {"x_scale": "jac"} if scaled else {}
        found, _ = sysid.optimize(
            initial_params=start, residual_fn=watched, verbose=False, **options
        )
    except TimeOverError:
        notes.append(
            f"not finished after {TIME_LIMIT:.0f} s of processor time: the best parameters until then"
        )
        found = start.copy()
        found.update_from_vector(best["x"])
    fitted = specification(case, step)
    for p in found.values():
        p.apply_modifier(fitted)
    low, high = found.get_bounds()
    x = found.as_vector()
    width = high - low
    stuck = int(np.sum((x - low < 1e-3 * width) | (high - x < 1e-3 * width)))
    return Outcome(
        inverse(fitted, case),
        link_inertias(fitted),
        settings=f"{start.size} parameters, {len(data.sequence_name)} windows of {WINDOW} s, "
        f"implicitfast {1e3 * step:g} ms, optimizer mujoco, "
        + ("x_scale='jac'" if scaled else "its defaults"),
        says=f"parameters at a bound ({stuck} here), covariances, overlaid signals, a video; no cause",
        notes=notes,
        extra={
            "parameters": start.size,
            "evaluations": calls,
            "cost_before": best["cost0"],
            "cost_after": best["cost"],
        },
    )


if __name__ == "__main__":
    main(
        {
            "friction": lambda c: fit(c, False, False),
            "friction_scaled": lambda c: fit(c, False, True),
            "full": lambda c: fit(c, True, False),
            "full_scaled": lambda c: fit(c, True, True),
        }
    )
