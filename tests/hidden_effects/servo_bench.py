"""A pendulum behind a position servo: commands and encoder counts, as a bus logs them, no torque.

Euler at 10 kHz with true sticking; nothing of the library. What is hidden is drawn from the effect
and the seed, the servo and the pendulum from the seed.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

STEP = 1e-4
"""Step of the simulation [s]."""
RATE = 100.0
"""Rate of the log, and of the commands, which the bus holds in between [Hz]."""
COUNTS = 4096
"""Counts of the encoder, a turn."""
NOISE = 0.3
"""Noise of the encoder [counts]."""
GRAVITY = 9.81

SIZES = {
    "none": 0.0,
    "quadratic_friction": 0.03,
    "stribeck_friction": 0.08,
    "asymmetric_viscous": 0.06,
    "load_friction": 0.2,
    "joint_spring": 0.6,
    "cogging": 0.06,
    "backlash": 0.03,
    "joint_elasticity": 60.0,
    "supply_sag": 1.0,
    "integral_action": 3.0,
}
"""Sizes of what can be hidden, in SI: one that a user would see, times 0.5 to 2. A voltage behind a
motor follows its supply by 1, whatever supply is called nominal."""

GEARS = ("backlash", "joint_elasticity")
"""Effects that hide the rotor: by a gap [rad], and by a spring [N·m/rad]."""
SWING = 0.05
"""Damping ratio of the spring."""
LATER = ("supply_sag", "integral_action")
"""Effects that came later: those before keep their draws."""
NOMINAL = 7.4
"""Supply of a bench where it is logged [V]."""
DROOP = 0.2
"""Sag of the supply by the drive's own torque [V/(N·m)]."""

URDF = """<robot name="bench">
  <link name="base"/>
  <link name="arm"><inertial><origin xyz="0 0 {com}"/><mass value="{mass}"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="servo" type="continuous"><parent link="base"/><child link="arm"/>
    <axis xyz="0 1 0"/></joint>
</robot>
"""


@dataclass(frozen=True)
class Bench:
    """A servo and what it carries."""

    mass: float
    com: float
    stiffness: float
    damping: float
    delay: float
    armature: float
    coulomb: float
    offset: float
    effect: str
    size: float
    at_motor: bool

    @property
    def inertia(self) -> float:
        return 0.001 + self.mass * self.com**2

    @property
    def weight(self) -> float:
        return self.mass * GRAVITY * self.com


def draw(effect: str, seed: int) -> Bench:
    """Draw a bench; its effect is of the size that SIZES says."""
    of_bench = np.random.default_rng(seed)
    families = sorted(set(SIZES) - {*GEARS, *LATER}) + [*GEARS, *LATER]
    of_effect = np.random.default_rng([seed, families.index(effect)])
    size = SIZES[effect]
    if effect != "supply_sag":
        size *= 2.0 ** of_effect.uniform(-1.0, 1.0)
    return Bench(
        mass=of_bench.uniform(0.3, 1.2),
        com=of_bench.uniform(0.08, 0.15),
        stiffness=of_bench.uniform(8.0, 25.0),
        damping=of_bench.uniform(0.2, 0.8),
        delay=of_bench.uniform(0.0, 0.03),
        armature=of_bench.uniform(0.01, 0.04),
        coulomb=of_bench.uniform(0.03, 0.1),
        offset=of_bench.uniform(-0.02, 0.02),
        effect=effect,
        size=size,
        at_motor=effect in GEARS and bool(of_effect.integers(2)),
    )


def meet(bench: Bench, side: float, rotor: float, link: float) -> tuple[float, float, bool]:
    """Let rigid teeth meet without a bounce, and the rotor's friction act in the same instant.

    Returns the velocities after that, and whether the teeth push.
    """
    both = bench.armature + bench.inertia
    free = (bench.armature * rotor + bench.inertia * link) / both
    stop = STEP * bench.coulomb / both
    together = 0.0 if abs(free) <= stop else free - np.copysign(stop, free)
    if side * (together - link) >= 0.0:
        return together, together, True
    return rotor, link, False


def record_gear(
    bench: Bench, command: np.ndarray, held: int, late: int, rng: np.random.Generator
) -> list[float]:
    """Two masses: the servo drives and brakes the rotor, where all friction is."""
    count = 2.0 * np.pi / COUNTS
    reduced = 1.0 / (1.0 / bench.armature + 1.0 / bench.inertia)
    damping = 2.0 * SWING * np.sqrt(bench.size * reduced)
    q = v = rotor = speed = 0.0
    seen = []
    for k in range(len(command)):
        read = rotor if bench.at_motor else q
        if k % held == 0:
            seen.append(count * np.round(read / count + rng.normal(0.0, NOISE)))
        tau = bench.stiffness * (command[max(k - late, 0)] - read) - bench.damping * speed
        tau += bench.offset
        pull = bench.weight * np.sin(q)
        wound, pushed = rotor - q, False
        if bench.effect == "joint_elasticity":
            gear = bench.size * wound + damping * (speed - v)
            tau -= gear
            pull -= gear
        v -= STEP * pull / bench.inertia
        free = speed + STEP * tau / bench.armature
        if bench.effect == "backlash" and abs(wound) >= 0.5 * bench.size:
            side = np.copysign(1.0, wound)
            if side * (free - v) > 0.0:
                speed, v, pushed = meet(bench, side, free, v)
        if not pushed:
            stop = STEP * bench.coulomb / bench.armature
            speed = 0.0 if abs(free) <= stop else free - np.copysign(stop, free)
        q += STEP * v
        rotor += STEP * speed
    return seen


def draw_supply(time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw what a bus with other loads on it supplies without this one [V]: swings and steps."""
    volts = np.full_like(time, NOMINAL)
    for _ in range(3):
        swing, rate, phase = rng.uniform(0.1, 0.4), rng.uniform(0.5, 8.0), rng.uniform(0.0, 6.28)
        volts += swing * np.sin(rate * time + phase)
    steps = rng.uniform(-0.4, 0.0, int(time[-1]) + 1)
    return volts + steps[time.astype(int)]


def draw_swings(time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw commands that swing, each sine at a rate of its own [rad]."""
    command = np.zeros_like(time)
    for _ in range(4):
        amplitude, rate, phase = rng.uniform(0.2, 0.9), rng.uniform(0.7, 6.0), rng.uniform(0, 6.28)
        command += amplitude * np.sin(rate * time + phase)
    return (command - command[0]) * np.minimum(1.0, 2.0 * time)


def draw_steps(time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draw commands that step and wait, so that the servo comes to rest and sticks [rad]."""
    command, at = np.zeros_like(time), 0.3
    while at < time[-1]:
        command[time >= at] = rng.uniform(-0.8, 0.8)
        at += rng.uniform(0.3, 1.0)
    return command


def record(
    bench: Bench, seconds: float, rng: np.random.Generator, *, steps: bool = False
) -> np.ndarray:
    """Record one motion: rows of time, position, command, and supply where it is of interest."""
    held = round(1.0 / RATE / STEP)
    time = np.arange(round(seconds / STEP)) * STEP
    command = draw_steps(time, rng) if steps else draw_swings(time, rng)
    command = np.repeat(command[::held], held)[: len(time)]
    late = round(bench.delay / STEP)
    if bench.effect in GEARS:
        seen = record_gear(bench, command, held, late, rng)
        return np.column_stack([time[::held], seen, command[::held]])
    total = bench.inertia + bench.armature
    count = 2.0 * np.pi / COUNTS
    q = v = acceleration = pulled = summed = 0.0
    seen, supplied = [], []
    has_supply = bench.effect in ("none", "supply_sag")
    bus = draw_supply(time, np.random.default_rng(rng.bit_generator.seed_seq.spawn(1)[0]))
    for k in range(len(time)):
        volts = bus[k] - DROOP * abs(pulled)
        if k % held == 0:
            seen.append(count * np.round(q / count + rng.normal(0.0, NOISE)))
            supplied.append(np.round(volts, 1))
        pull = bench.weight * np.sin(q)
        pulled = bench.stiffness * (command[max(k - late, 0)] - q)
        if bench.effect == "integral_action":
            summed += STEP * (command[max(k - late, 0)] - q)
            pulled += bench.stiffness * bench.size * summed
        if bench.effect == "supply_sag":
            pulled *= 1.0 + bench.size * (volts / NOMINAL - 1.0)
        tau = pulled - bench.damping * v + bench.offset - pull
        dry = bench.coulomb
        if bench.effect == "quadratic_friction":
            tau -= bench.size * v * abs(v)
        elif bench.effect == "stribeck_friction":
            dry += bench.size * np.exp(-((v / 0.3) ** 2))
        elif bench.effect == "asymmetric_viscous":
            tau -= bench.size * abs(v)
        elif bench.effect == "load_friction":
            dry += bench.size * abs(pull + bench.inertia * acceleration)
        elif bench.effect == "joint_spring":
            tau -= bench.size * (q - 0.2)
        elif bench.effect == "cogging":
            tau -= bench.size * np.sin(6.0 * q + 0.4)
        free = v + STEP * tau / total
        stop = STEP * dry / total
        before, v = v, 0.0 if abs(free) <= stop else free - np.copysign(stop, free)
        # Friction that follows the load needs q̈, which it changes: over half a millisecond.
        acceleration += 0.2 * ((v - before) / STEP - acceleration)
        q += STEP * v
    rows = [time[::held], seen, command[::held]]
    return np.column_stack([*rows, supplied] if has_supply else rows)


def write_case(
    folder: Path, effect: str, seed: int, seconds: float = 10.0, *, steps: bool = False
) -> Bench:
    """Write `bench.urdf`, `train.csv`, `test.csv`, and `truth.json` for the judge."""
    bench = draw(effect, seed)
    rng = np.random.default_rng([seed, 1])
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("train", "test"):
        rows = record(bench, seconds, rng, steps=steps)
        np.savetxt(
            folder / f"{name}.csv",
            rows,
            delimiter=",",
            header=",".join(["time", "q_servo", "qcmd_servo", "voltage [V]"][: rows.shape[1]]),
            comments="",
            fmt="%.9g",
        )
    urdf = URDF.format(mass=bench.mass, com=-bench.com)
    (folder / "bench.urdf").write_text(urdf, encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps(asdict(bench)), encoding="utf-8")
    return bench
