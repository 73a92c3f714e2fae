"""Pictures of what each effect leaves in the error of a model that lacks it: NAME.svg each.

And overlap.svg, of how much of one another explains (overlap.py).

    python3 docs/figures/effect_signatures.py docs/_generated/effects [NAME …]

Joints: a robot with the effect follows a motion, simulated without noise; the picture shows its
logged torque less what the model without the effect predicts for the logged motion. Ball: its path
with the effect less the path without, the hand moving alike (ball_signatures.py). Takes some
seconds; needs the module and matplotlib, no network.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import ball_signatures
import numpy as np
from panels import Panel, save

import diffnea

RATE = 500.0  # of control and rows [Hz]
SHOWN = 4.0  # of the motion, in the panel over time [s]
WAM = diffnea.load_model("wam4")
JOINTS = WAM.joint_names


@dataclass(frozen=True)
class Motion:
    """A random motion of all joints that starts at rest."""

    seed: int = 3
    period: float = 10.0  # [s]
    harmonics: int = 5
    velocity: float = 2.0  # [rad/s]

    def __call__(self) -> diffnea.Trajectory:
        """Draw it: the same for the same numbers."""
        return diffnea.excite(
            WAM,
            duration=self.period,
            period=self.period,
            harmonics=self.harmonics,
            rate=RATE,
            seed=self.seed,
            velocity=self.velocity,
        )


SLOW = Motion(velocity=0.4)
USUAL = Motion()
FAST = Motion(period=5.0, harmonics=12, velocity=3.0)


@dataclass(frozen=True)
class Log:
    """A recording without noise, and what the model without the effect makes of it."""

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    predicted: np.ndarray
    error: np.ndarray
    logged_qd: np.ndarray | None


def recorded(effect: diffnea.Effect, motion: Motion, lacking: diffnea.Model = WAM) -> Log:
    """Simulate a robot with the effect; leave out the ends, where differences are one-sided."""
    robot = lacking.with_effects([*lacking.effects, effect])
    run = diffnea.simulate(robot, motion(), rate=RATE)
    assert not run.failure, run.failure
    r = run.recording
    q = np.asarray(r.q)
    qd = np.gradient(q, 1.0 / RATE, axis=0)
    qdd = np.gradient(qd, 1.0 / RATE, axis=0)
    predicted = diffnea.rnea(lacking, q=q, qd=qd, qdd=qdd, effects=bool(lacking.effects))
    tau = np.asarray(r.tau)
    # The torque is held from one sample to the next: at a sample it is the mean of both.
    tau = 0.5 * (tau + np.vstack([tau[:1], tau[:-1]]))
    inner = slice(10, -10)
    logged = None if r.qd is None else np.asarray(r.qd)[inner]
    return Log(
        np.asarray(r.time)[inner],
        q[inner],
        qd[inner],
        qdd[inner],
        predicted[inner],
        (tau - predicted)[inner],
        logged,
    )


def smooth(x: np.ndarray, rows: int = 5) -> np.ndarray:
    """Differences of positions are rough where friction jumps: a short mean."""
    return np.convolve(np.pad(x, rows // 2, mode="edge"), np.full(rows, 1.0 / rows), "valid")


@dataclass(frozen=True)
class Signature:
    """Which robot, which motion, and over what the error is drawn."""

    parameters: dict[str, float]
    against: str = "velocity"
    where: str = "joint4"
    shown: str = "joint4"  # whose error
    motion: Motion = USUAL
    over_joint: str = ""  # whose motion it is drawn over; empty: `shown`
    base: tuple[diffnea.Effect, ...] = field(default=())  # what the model has already

    def panels(self, name: str) -> list[Panel]:
        """Simulate, and draw the error over time and over its own variable."""
        lacking = WAM.with_effects([*WAM.effects, *self.base])
        effect = diffnea.Effect(name, self.where, self.parameters)
        log = recorded(effect, self.motion, lacking)
        return self.drawn(log.time, log, smooth(log.error[:, JOINTS.index(self.shown)]))

    def drawn(self, time: np.ndarray, log: Log, error: np.ndarray) -> list[Panel]:
        """Draw an error over time, the velocity behind it, and over its own variable."""
        j = JOINTS.index(self.over_joint or self.shown)
        x, label = AGAINST[self.against](log, j)
        label = f"{label} of {JOINTS[j]}" if j != JOINTS.index(self.shown) else label
        early = time - time[0] < SHOWN
        grey = log.qd[early, j]
        return [
            Panel(time[early], error[early], "time [s]", "error [N·m]", grey=grey),
            Panel(x, error, label, "error [N·m]", dots=True),
        ]


AGAINST: dict[str, Callable[[Log, int], tuple[np.ndarray, str]]] = {
    "velocity": lambda log, j: (log.qd[:, j], "velocity [rad/s]"),
    "position": lambda log, j: (log.q[:, j], "position [rad]"),
    "acceleration": lambda log, j: (smooth(log.qdd[:, j]), "acceleration [rad/s²]"),
    "torque": lambda log, j: (log.predicted[:, j], "torque of the model [N·m]"),
    "logged": lambda log, j: (log.predicted[:, j] + log.error[:, j], "logged torque [N·m]"),
    "torque rate": lambda log, j: (
        np.gradient(smooth(log.predicted[:, j]), 1.0 / RATE),
        "rate of the torque [N·m/s]",
    ),
    "second derivative": lambda log, j: (
        np.gradient(np.gradient(smooth(log.predicted[:, j], 15), 1.0 / RATE), 1.0 / RATE),
        "second derivative of the torque [N·m/s²]",
    ),
}

ROTOR = (diffnea.Effect("armature", "joint4", {"armature": 0.03}),)

SIGNATURES: dict[str, Signature] = {
    "coulomb_friction": Signature({"coulomb": 0.8}),
    "viscous_friction": Signature({"viscous": 0.5}),
    "quadratic_friction": Signature({"quadratic": 0.3}),
    "sublinear_friction": Signature({"sublinear": 0.6}),
    "stribeck_friction": Signature({"stiction_excess": 0.6, "stribeck_velocity": 0.1}, motion=SLOW),
    "asymmetric_coulomb": Signature({"coulomb_positive": 1.0, "coulomb_negative": 0.5}),
    "asymmetric_viscous": Signature({"viscous_positive": 0.7, "viscous_negative": 0.3}),
    "load_friction": Signature({"mu": 0.2, "braking_ratio": 0.6}),
    "presliding_dahl": Signature(
        {"coulomb": 0.8, "presliding": 0.05}, "position", motion=Motion(velocity=0.8)
    ),
    "presliding_lugre": Signature(
        {
            "stiffness": 30.0,
            "damping": 0.1,
            "coulomb": 0.6,
            "stiction": 1.0,
            "stribeck_velocity": 0.1,
        },
        "position",
        motion=Motion(velocity=0.8),
    ),
    "warm_up": Signature({"viscous": 0.8, "time_constant": 4.0}),
    "cable_differential_friction": Signature(
        {"coulomb": 0.4, "ratio": 1 / 1.68}, where="joint2,joint3", shown="joint2"
    ),
    "armature": Signature({"armature": 0.05}, "acceleration", motion=FAST),
    "transmission_coupling": Signature(
        {"armature": 0.02, "viscous": 0.2, "coulomb": 0.3, "ratio": 1.0},
        where="joint3,joint4",
        shown="joint3",
    ),
    "torque_gain": Signature({"gain_error": 0.1}, "torque"),
    "actuator_lag": Signature({"time_constant": 0.01}, "torque rate", motion=FAST),
    "actuator_delay": Signature({"delay": 0.01}, "torque rate", motion=FAST),
    "saturation": Signature({"limit": 2.7}, "logged"),
    "joint_elasticity": Signature(
        {"stiffness": 400.0, "damping": 0.8, "motor_inertia": 0.03},
        "second derivative",
        motion=FAST,
        base=ROTOR,
    ),
    "backlash": Signature(
        {"gap": 0.02, "motor_inertia": 0.03, "restitution": 0.3}, "torque", base=ROTOR
    ),
    "joint_spring": Signature({"stiffness": 1.0, "rest": 1.0}, "position"),
    "cogging": Signature({"sine": 0.3, "cosine": 0.1, "cycles": 12.0}, "position"),
    "torque_offset": Signature({"offset": 0.5}),
    "encoder_offset": Signature({"offset": 0.05}, "position", where="joint2", shown="joint2"),
    "encoder_scale": Signature({"scale_error": 0.05}, "position", where="joint2", shown="joint2"),
    "time_shift": Signature({"shift": 0.01}, "torque rate", where="all", motion=FAST),
    "payload": Signature({"mass": 0.3, "hx": 0.06, "hy": 0.06}, "position", where="tip"),
    "base_tilt": Signature(
        {"gravity_x": 0.3, "gravity_y": 0.2}, "position", where="base", shown="joint1"
    ),
    "tip_force": Signature(
        {"force_x": 1.0, "force_z": -1.0}, "position", where="tip", shown="joint2"
    ),
}


def session_offset(name: str) -> list[Panel]:
    """Draw two recordings, one after the other."""
    logs = [recorded(diffnea.Effect(name, "joint4", {"offset_0": c}), USUAL) for c in (0.5, -0.3)]
    time = np.concatenate([logs[0].time, logs[1].time + logs[0].time[-1]])
    error = np.concatenate([smooth(log.error[:, 3]) for log in logs])
    qd = np.concatenate([log.qd[:, 3] for log in logs])
    return [
        Panel(time, error, "time [s], two recordings", "error [N·m]", grey=qd),
        Panel(qd, error, "velocity [rad/s]", "error [N·m]", dots=True),
    ]


def velocity_filter_lag(name: str) -> list[Panel]:
    """Draw the logged velocity less that of the positions: it shows in no torque."""
    log = recorded(diffnea.Effect(name, "joint4", {"lag": 0.01}), FAST)
    assert log.logged_qd is not None
    error = log.logged_qd[:, 3] - log.qd[:, 3]
    early = log.time - log.time[0] < SHOWN
    label = "logged velocity − dq/dt [rad/s]"
    return [
        Panel(log.time[early], error[early], "time [s]", label, grey=log.qd[early, 3]),
        Panel(smooth(log.qdd[:, 3]), error, "acceleration [rad/s²]", label, dots=True),
    ]


def residual(name: str) -> list[Panel]:
    """Draw a table of two bumps over the position."""
    told = WAM.to_dict()
    told["effects"] = [
        {
            "effect": name,
            "where": "joint4",
            "parameters": [{"name": "scale", "value": 1.0}],
            "table": {
                "variables": ["q_joint4"],
                "centres": [1.0, 1.6],
                "widths": [0.2, 0.2],
                "weights": [0.4, -0.3],
                "bound": 0.5,
            },
        }
    ]
    effect = diffnea.Model.from_dict(told).effects[0]
    log = recorded(effect, USUAL)
    return Signature({}, "position").drawn(log.time, log, smooth(log.error[:, 3]))


def position_servo(_: str) -> list[Panel]:
    """Draw the law: setpoint over time, torque over error. No torque is logged."""
    stiffness, reach, dead_band, speed, delay = 10.0, 0.2, 0.02, 2.0, 0.1
    time = np.linspace(0.0, SHOWN, 801)
    command = np.where(time < 0.5, 0.0, np.where(time < 2.0, 1.0, 0.3))
    setpoint = np.zeros_like(time)
    most = speed * (time[1] - time[0])
    for k in range(1, len(time)):
        setpoint[k] = setpoint[k - 1] + np.clip(command[k] - setpoint[k - 1], -most, most)
    setpoint = np.interp(time - delay, time, setpoint)
    error = np.linspace(-0.4, 0.4, 401)
    beyond = np.sign(error) * np.maximum(np.abs(error) - dead_band, 0.0)
    torque = stiffness * np.clip(beyond, -reach, reach)
    return [
        Panel(time, setpoint, "time [s]", "setpoint [rad]", grey=command),
        Panel(error, torque, "error of the position [rad]", "torque [N·m]"),
    ]


def supply_sag(_: str) -> list[Panel]:
    """Draw the law: torque over error at three supplies, and over a supply that sags."""
    stiffness, reach, nominal = 10.0, 0.2, 7.4
    error = np.linspace(-0.4, 0.4, 401)
    pull = stiffness * np.clip(error, -reach, reach)
    time = np.linspace(0.0, SHOWN, 801)
    volts = nominal * (1.0 - 0.03 * time) - 1.0 * (np.sin(3.0 * time) > 0.0)
    return [
        Panel(time, volts / nominal * stiffness * reach, "time [s]", "largest torque [N·m]"),
        Panel(error, 0.8 * pull, "error of the position [rad]", "torque [N·m]", grey=pull),
    ]


def feed_forward(_: str) -> list[Panel]:
    """Draw what is told beside positions, and what a drive adds to its pull."""
    damping, share, delay = 0.5, 1.0, 0.1
    time = np.linspace(0.0, SHOWN, 801)
    velocity = np.cos(2.0 * time)
    torque = np.where(np.mod(time, 1.3) < 0.5, 0.8, -0.2)
    late = np.maximum(time - delay, 0.0)
    told = share * np.interp(late, time, torque)
    added = damping * np.interp(late, time, velocity) + told
    return [
        Panel(time, torque, "time [s]", "told: torque [N·m]", grey=velocity),
        Panel(time, added, "time [s]", "added torque [N·m]", grey=told),
    ]


def integral_action(_: str) -> list[Panel]:
    """Draw a step under a load that pulls back, without and with the integral."""
    stiffness, damping, inertia, load, rate, step = 10.0, 0.8, 0.03, 2.0, 3.0, 1e-3
    time = np.arange(0.0, SHOWN, step)
    moved = []
    for of_integral in (0.0, rate):
        q, v, integral, line = -load / stiffness, 0.0, 0.0, np.empty_like(time)
        for k, t in enumerate(time):
            error = (1.0 if t > 0.5 else 0.0) - q
            v += step * (stiffness * (error + of_integral * integral) - damping * v - load) / inertia
            q += step * v
            integral += step * error
            line[k] = q
        moved.append(line)
    without, with_it = moved
    return [
        Panel(time, with_it, "time [s]", "position [rad]", grey=without),
        Panel(time, np.where(time > 0.5, 1.0, 0.0) - with_it, "time [s]", "error [rad]"),
    ]


OTHERS: dict[str, Callable[[str], list[Panel]]] = {
    "session_offset": session_offset,
    "velocity_filter_lag": velocity_filter_lag,
    "position_servo": position_servo,
    "supply_sag": supply_sag,
    "feed_forward": feed_forward,
    "integral_action": integral_action,
    "residual": residual,
}


def panels(name: str) -> list[Panel]:
    """Return what is drawn of one effect."""
    if name in SIGNATURES:
        return SIGNATURES[name].panels(name)
    if name in OTHERS:
        return OTHERS[name](name)
    return ball_signatures.panels(name)


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    every = [e["effect"] for e in diffnea.effects()]
    parser.add_argument("names", nargs="*", help="effects; all if none is named")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for name in arguments.names or every:
        save(arguments.folder / f"{name}.svg", panels(name))
    if not arguments.names:
        import overlap  # of this module's signatures

        overlap.save(arguments.folder / "overlap.svg")


if __name__ == "__main__":
    main()
