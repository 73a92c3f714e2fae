"""What effects of a ball, its string and its camera change of the path that is seen.

The hand moves alike with the effect and without; the string hangs at rest at first. Simulated by
the model's simulator where that knows the effect; view, spin and table by their formulas.
"""

from collections.abc import Callable

import numpy as np
from panels import Panel

import diffnea

RATE = 500.0  # of rows [Hz]
GRAVITY = np.array([0.0, 0.0, -9.81])
BALL, CUP = diffnea.load_model("wam4_ball"), diffnea.load_model("wam4_ball_in_cup")
HOME = np.array([0.0, 0.6, 0.0, 1.25])
# Amplitude [rad] and frequency [Hz] of the joints: about a swing's own, below and far beyond it.
CALM = ((0.15, 0.55), (0.06, 0.70), (0.2, 0.45), (0.08, 0.65))
VIOLENT = ((0.1, 0.7), (0.30, 1.0), (0.0, 1.0), (0.45, 1.0))
Path = tuple[np.ndarray, np.ndarray, np.ndarray]  # time (N,), ball (N, 3), anchor (N, 3)


def commands(time: np.ndarray, joints: tuple[tuple[float, float], ...]) -> tuple:
    """Sines that grow over the first second, and their velocities."""
    amplitude, hz = (np.array(x)[:, None] for x in zip(*joints, strict=True))
    phase = 2.0 * np.pi * hz * time
    grow = np.minimum(time, 1.0) ** 2 * (3.0 - 2.0 * np.minimum(time, 1.0))
    q = HOME[:, None] + amplitude * grow * np.sin(phase)
    return q, np.gradient(q, 1.0 / RATE, axis=1)


def flown(
    effects: list[diffnea.Effect], joints: tuple, seconds: float, model: diffnea.Model = BALL
) -> Path:
    """Simulate the arm with its ball."""
    simulator = diffnea.model_simulator(model.with_effects([*model.effects, *effects]), rate=RATE)
    rows = {name: k for k, name in enumerate(simulator.channels)}
    time = np.arange(int(seconds * RATE)) / RATE
    q, qd = commands(time, joints)
    lanes = simulator.lanes
    simulator.reset(HOME[:, None], [0])
    seen = []
    for k in range(len(time)):
        seen.append(np.array(simulator.observe())[:, 0])
        simulator.step(np.tile(q[:, k : k + 1], lanes), np.tile(qd[:, k : k + 1], lanes))
    table = np.array(seen)
    ball = table[:, [rows[f"ball_{a}"] for a in "xyz"]]
    posture = table[:, [rows[f"q_{j}"] for j in model.joint_names]]
    return time, ball, anchors(model, posture)


def anchors(model: diffnea.Model, posture: np.ndarray) -> np.ndarray:
    """Where the string is tied, along a motion."""
    string = model.to_dict()["ball"]["string"]
    pose = diffnea.frame_pose(model, string["link"], q=posture)
    return pose[:, :3, :3] @ np.array(string["attachment"]) + pose[:, :3, 3]


def drawn(time: np.ndarray, error: np.ndarray, ball: np.ndarray, anchor: np.ndarray) -> list[Panel]:
    """Draw the error along the axes of the world, and along and across the string."""
    along = ball - anchor
    u = along / np.linalg.norm(along, axis=1, keepdims=True)
    mm = 1e3 * error
    axes = {a: mm[:, k] for k, a in enumerate("xyz")}
    pulled = np.sum(mm * u, axis=1)
    own = {
        "along the string": pulled,
        "across it, size": np.linalg.norm(mm - pulled[:, None] * u, axis=1),
    }
    return [
        Panel(time, axes, "time [s]", "error [mm]"),
        Panel(time, own, "time [s]", "error [mm]"),
    ]


def with_effect(name: str, parameters: dict[str, float], where: str, **how: object) -> list[Panel]:
    """Draw what an effect of the model's simulator changes."""
    joints = how.get("joints", CALM)
    seconds = how.get("seconds", 6.0)
    model = how.get("model", BALL)
    effect = diffnea.Effect(name, where, parameters)
    time, ball, anchor = flown([], joints, seconds, model)
    _, other, _ = flown([effect], joints, seconds, model)
    return drawn(time, other - ball, ball, anchor)


def viewed(view: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> list[Panel]:
    """Draw what a camera makes of the same path."""
    time, ball, anchor = flown([], CALM, 6.0)
    return drawn(time, view(time, ball) - ball, ball, anchor)


def late(time: np.ndarray, ball: np.ndarray) -> np.ndarray:
    """Return the path as it was 10 ms earlier."""
    return np.column_stack([np.interp(time - 0.01, time, ball[:, k]) for k in range(3)])


def extension() -> list[Panel]:
    """Draw the part that is seen at once: r + c (T − m g), 1 % under the ball's weight."""
    time, ball, anchor = flown([], ((0.0, 1.0), (0.15, 0.8), (0.0, 1.0), (0.2, 0.8)), 6.0)
    along = ball - anchor
    u = along / np.linalg.norm(along, axis=1, keepdims=True)
    a_anchor = np.gradient(np.gradient(anchor, 1 / RATE, axis=0), 1 / RATE, axis=0)
    v = np.gradient(along, 1 / RATE, axis=0)
    pull = np.sum(u * (GRAVITY - a_anchor), axis=1) + np.sum(v * v, axis=1) / 0.4
    stretch = 0.01 * 0.4 * (np.maximum(pull, 0.0) / 9.81 - 1.0)
    inner = slice(5, -5)
    return drawn(time[inner], (u * stretch[:, None])[inner], ball[inner], anchor[inner])


def flight(spin: np.ndarray, lift: float) -> np.ndarray:
    """Return the flight of a table tennis ball; explicit midpoint steps."""
    mass, radius, rho, dt = 0.0027, 0.02, 1.2, 1.0 / RATE
    per_unit = rho * np.pi * radius**3 / mass
    x, v = np.zeros(3), np.array([4.0, 0.0, 2.0])
    path = []
    for _ in range(int(0.4 * RATE)):
        path.append(x)
        half = v + 0.5 * dt * (GRAVITY + lift * per_unit * np.cross(spin, v))
        v = v + dt * (GRAVITY + lift * per_unit * np.cross(spin, half))
        x = x + dt * half
    return np.array(path)


def magnus() -> list[Panel]:
    """Draw what back spin and side spin of 300 rad/s do, C_M = 0.2."""
    out = []
    for words, spin in (("back spin", [0, -300.0, 0]), ("side spin", [0, 0, 300.0])):
        error = 1e3 * (flight(np.array(spin), 0.2) - flight(np.array(spin), 0.0))
        axes = {a: error[:, k] for k, a in enumerate("xyz")}
        time = np.arange(len(error)) / RATE
        out.append(Panel(time, axes, f"time [s], {words}", "error [mm]"))
    return out


def bounces() -> list[Panel]:
    """Draw heights over the table that fall by e² from bounce to bounce."""
    time = np.arange(0.0, 1.6, 1.0 / RATE)
    heights = {}
    for e in (0.9, 0.8):
        at, v, since, z = 0.0, 0.0, 0.3, []
        for t in time:
            height = since + v * (t - at) - 4.905 * (t - at) ** 2
            if height < 0.0:
                v, since, at = -e * (v - 9.81 * (t - at)), 0.0, t
                height = 0.0
            z.append(height)
        heights[f"e = {e}"] = np.array(z)
    return [Panel(time, heights, "time [s]", "height [m]")]


SIGNATURES: dict[str, Callable[[], list[Panel]]] = {
    "linear_drag": lambda: with_effect("linear_drag", {"drag": 0.05}, "ball"),
    "quadratic_drag": lambda: with_effect("quadratic_drag", {"drag": 0.05}, "ball"),
    "dry_drag": lambda: with_effect("dry_drag", {"drag": 0.02}, "ball"),
    "wind": lambda: with_effect("wind", {"wind_x": 0.04, "wind_y": 0.03}, "ball"),
    "gravity_scale": lambda: with_effect("gravity_scale", {"excess": 0.01}, "ball"),
    "magnus": magnus,
    "bounce": bounces,
    "string_mass": lambda: with_effect("string_mass", {"mass_ratio": 0.05}, "string"),
    "string_damping": lambda: with_effect("string_damping", {"damping": 0.05}, "string"),
    "string_bending": lambda: with_effect("string_bending", {"stiffness": 0.245}, "string"),
    "string_extension": extension,
    "string_folding": lambda: with_effect(
        "string_folding", {"resistance": 0.02}, "string", joints=VIOLENT, seconds=2.0
    ),
    "string_wrap": lambda: with_effect(
        "string_wrap", {"size": 1.0}, "string", joints=VIOLENT, seconds=3.0, model=CUP
    ),
    "string_rebound": lambda: with_effect(
        "string_rebound", {"restitution": 0.3}, "string", joints=VIOLENT, seconds=3.0
    ),
    "attachment_offset": lambda: with_effect(
        "attachment_offset", {"offset_x": 0.006, "offset_y": 0.008}, "string"
    ),
    "camera_delay": lambda: viewed(late),
    "camera_scale": lambda: viewed(lambda _, x: 1.01 * x),
    "camera_rotation": lambda: viewed(lambda _, x: x + np.cross([0.006, 0.0, 0.008], x)),
    "camera_offset": lambda: viewed(lambda _, x: x + np.array([0.006, 0.0, 0.008])),
}


def panels(name: str) -> list[Panel]:
    """Return what is drawn of one effect."""
    return SIGNATURES[name]()
