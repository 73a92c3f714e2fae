"""Drives of an identified model inside the loop of another simulator."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from ._core import Effect, Model, ModelError
from ._files import StrPath, load_model

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

_SERVO = "position_servo"
_SUPPLY, _INTEGRAL, _FED = "supply_sag", "integral_action", "feed_forward"
# Value of a speed that is no bound, as the effect has it.
_NO_BOUND = 1e3


class Drive:
    """Torques of a model's position servos, with all that robot descriptions have no place for.

    The law is that of the effect ``position_servo``: a setpoint that moves no faster than the
    drive's speed, a delay, a dead band, a derivative time, a reach, and the motor's braking; less
    the joint's
    ``torque_offset``, which acts in a drive that is off, too. With a ``supply_sag``, its torque
    follows the supply; with an ``integral_action``, it integrates its error from call to call;
    with a ``feed_forward``, it is told a velocity and a torque, too. A robot description holds
    stiffness, damping and the largest torque alone (``model.save("robot.xml")``).

        >>> drive = diffnea.Drive("run")
        >>> data.qfrc_applied[:] = drive(data.time, command, data.qpos, data.qvel)

    Arrays are ``(…, n)``, n the joints of ``joint_names``: leading axes are robots that run at
    once. A command holds, and counts, from the call that first gives it. A negative delay, which
    stamps of a log can leave, is none: nobody acts on what is not told yet.

    Args:
        model: the model, a file of it or a run that fitted it.
        joints: which joints, in the order of the arrays. Default: all that have a servo, in the
            model's order.
        gain: gain of the firmware in the unit of the recordings' sidecars, one or (n,).
        damping: whether the torque has the motor's braking beyond its reach. False where the
            simulator has it already, as joint damping of an exported description.

    Raises:
        ModelError: for a joint without a servo, or a model without one.
        ValueError: for a gain that is not above 0.

    """

    def __init__(
        self,
        model: Model | StrPath,
        joints: Sequence[str] | None = None,
        *,
        gain: ArrayLike = 1.0,
        damping: bool = True,
    ) -> None:
        if not isinstance(model, Model):
            model = load_model(model)
        effects = {(e.effect, e.where): e for e in model.effects}
        have = [name for name in model.joint_names if (_SERVO, name) in effects]
        if not have:
            raise ModelError(
                "Drive: the model has no position servo; `diffnea identify` fits them to logs of "
                "commands and positions"
            )
        #: Names of the joints, in the order of the arrays.
        self.joint_names: list[str] = have if joints is None else list(joints)
        missing = [name for name in self.joint_names if name not in have]
        if missing:
            raise ModelError(
                f"Drive: no position servo at {', '.join(missing)}; there are at {', '.join(have)}"
            )
        servos = [effects[_SERVO, name] for name in self.joint_names]

        def of(name: str) -> NDArray[np.float64]:
            return np.array([servo.parameters[name] for servo in servos])

        self._stiffness, self._reach, self._dead_band = of("stiffness"), of("reach"), of("dead_band")
        self._derivative_time = of("derivative_time")
        beyond = of("damping") - self._stiffness * self._derivative_time
        self._damping = beyond if damping else np.zeros(len(servos))
        speed = of("speed")
        self._speed = np.where(speed < _NO_BOUND, speed, np.inf)
        self._delay = np.maximum(of("delay"), 0.0)
        self._gain = np.broadcast_to(np.asarray(gain, float), (len(servos),))
        if not (self._gain > 0.0).all():
            raise ValueError(
                f"Drive: got gain {self._gain}, expected above 0; "
                "a drive that is off has commands of NaN"
            )
        offsets = [effects.get(("torque_offset", name)) for name in self.joint_names]
        self._offset = np.array([e.parameters["offset"] if e else 0.0 for e in offsets])
        sags = [effects.get((_SUPPLY, name)) for name in self.joint_names]
        self._share = np.array([e.parameters["share"] if e else 0.0 for e in sags])
        self._nominal = np.array([e.parameters["nominal"] if e else 1.0 for e in sags])
        integrals = [effects.get((_INTEGRAL, name)) for name in self.joint_names]
        self._rate = np.array([e.parameters["rate"] if e else 0.0 for e in integrals])
        feeds = [effects.get((_FED, name)) for name in self.joint_names]
        self._by_velocity = np.array([e.parameters["damping"] if e else 0.0 for e in feeds])
        self._by_torque = np.array([e.parameters["share"] if e else 0.0 for e in feeds])
        self._friction = [_Friction(effects, name) for name in self.joint_names]
        self.reset()

    def reset(self) -> None:
        """Forget the commands: the next call begins a run."""
        self._told = np.empty(0)
        self._commands: deque[tuple[float, NDArray[np.float64]]] = deque()
        self._last = np.inf
        self._integral = self._summed = np.zeros(len(self.joint_names))

    def __call__(
        self,
        time: float,
        command: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike,
        supply: ArrayLike | None = None,
        *,
        velocity: ArrayLike = 0.0,
        torque: ArrayLike = 0.0,
    ) -> NDArray[np.float64]:
        """Torque of the drives at one instant, (…, n) [N·m] or [N].

        Args:
            time: of the instant [s], not before that of the last call since ``reset``.
            command: positions (…, n) [rad] or [m]; NaN: the drive is off.
            q: positions (…, n) [rad] or [m].
            qd: velocities (…, n) [rad/s] or [m/s].
            supply: voltage of the drives now, one or (…, n) [V], for those with a ``supply_sag``.
                Default: the nominal one.
            velocity: told beside the position, (…, n) [rad/s] or [m/s], for drives with a
                ``feed_forward``.
            torque: told beside both, (…, n) [N·m] or [N], likewise. NaN: none.

        """
        wanted, q, qd, velocity, torque = np.broadcast_arrays(
            *(np.asarray(x, float) for x in (command, q, qd, velocity, torque))
        )
        if wanted.shape[-1:] != (len(self.joint_names),):
            raise ValueError(
                f"Drive: got arrays of shape {wanted.shape}, expected (…, "
                f"{len(self.joint_names)}): {', '.join(self.joint_names)}"
            )
        setpoint, velocity, torque = self._delayed(
            time, np.stack([self._led(time, wanted), np.nan_to_num(velocity), np.nan_to_num(torque)])
        )
        error = self._gain * (setpoint - q)
        self._integral = self._integral + self._summed * max(time - self._last, 0.0)
        asked = np.sign(error) * np.maximum(np.abs(error) - self._dead_band, 0.0)
        asked = asked + self._rate * self._integral
        # While these saturate it, nothing that would drive it on is summed up.
        held = np.isnan(wanted) | ((np.abs(asked) > self._reach) & (asked * error > 0.0))
        self._summed, self._last = np.where(held, 0.0, error), time
        error = np.clip(asked - self._derivative_time * qd, -self._reach, self._reach)
        pull = self._strength(supply) * self._stiffness * error - self._damping * qd
        pull = pull + self._by_velocity * velocity + self._by_torque * torque
        told: NDArray[np.float64] = np.where(np.isnan(wanted), 0.0, pull) - self._offset
        return told

    def frictionloss(self, qd: ArrayLike, load: ArrayLike = 0.0) -> NDArray[np.float64]:
        """Size of the joints' dry friction now, (…, n) [N·m] or [N].

        What a simulator that treats dry friction as a constraint takes anew in each step
        (``mujoco.MjModel.dof_frictionloss``): Coulomb friction, Stribeck's excess at low speed,
        and what grows with the load. Other friction of the model is not in it.

        Args:
            qd: velocities (…, n) [rad/s] or [m/s].
            load: torque that the joints transmit (…, n) [N·m] or [N], without rotor and friction.

        """
        qd, load = np.broadcast_arrays(np.asarray(qd, float), np.asarray(load, float))
        parts = [f(qd[..., j], load[..., j]) for j, f in enumerate(self._friction)]
        return np.stack(parts, axis=-1)

    def _strength(self, supply: ArrayLike | None) -> NDArray[np.float64]:
        """Torque over that at the nominal supply."""
        volts = self._nominal if supply is None else np.asarray(supply, float)
        strength: NDArray[np.float64] = 1.0 + self._share * (volts / self._nominal - 1.0)
        return strength

    def _led(self, time: float, wanted: NDArray[np.float64]) -> NDArray[np.float64]:
        """Setpoint now, which since the last call moved to what was told then."""
        if not self._commands:
            self._told = wanted
            return wanted
        last, before = self._commands[-1][0], self._commands[-1][1][0]
        if time < last:
            raise ValueError(
                f"Drive: got time {time} after {last}, expected it to ascend; reset() begins anew"
            )
        way = self._told - before
        at_once = np.isinf(self._speed)
        most = np.where(at_once, 0.0, self._speed) * (time - last)
        led = before + np.clip(way, -most, most)
        self._told = np.where(np.isnan(wanted), self._told, wanted)
        return np.where(at_once | np.isnan(before), self._told, led)

    def _delayed(self, time: float, commands: NDArray[np.float64]) -> NDArray[np.float64]:
        """Setpoints, velocities and torques of a delay ago, (3, …, n) as they are now."""
        if self._commands and self._commands[-1][0] == time:
            self._commands.pop()
        self._commands.append((time, commands))
        # One that is older than all delays stays: it is what holds there.
        while len(self._commands) > 1 and self._commands[1][0] <= time - self._delay.max():
            self._commands.popleft()
        times = np.array([t for t, _ in self._commands])
        at = np.maximum(np.searchsorted(times, time - self._delay + 1e-12, side="right") - 1, 0)
        return np.stack([self._commands[k][1][..., j] for j, k in enumerate(at)], axis=-1)


class _Friction:
    """Size of one joint's dry friction."""

    def __init__(self, effects: dict[tuple[str, str], Effect], joint: str) -> None:
        def of(effect: str, name: str, absent: float = 0.0) -> float:
            found = effects.get((effect, joint))
            return absent if found is None else found.parameters[name]

        self._coulomb = of("coulomb_friction", "coulomb")
        self._excess = of("stribeck_friction", "stiction_excess")
        self._speed = of("stribeck_friction", "stribeck_velocity", 1.0)
        self._mu = of("load_friction", "mu")
        self._braking = of("load_friction", "braking_ratio", 1.0)

    def __call__(self, qd: NDArray[np.float64], load: NDArray[np.float64]) -> NDArray[np.float64]:
        at_low_speed = self._excess * np.exp(-((qd / self._speed) ** 2))
        of_load = self._mu * np.abs(load) * np.where(load * qd < 0.0, self._braking, 1.0)
        return self._coulomb + at_low_speed + of_load
