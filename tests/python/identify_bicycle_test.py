"""A bicycle on a free base, whose wheels roll by constraints; rides by Kane's equations."""

from pathlib import Path

import numpy as np
import pytest
from bicycle import FRONT, FRONT_RADIUS, LEAN, REAR, REAR_RADIUS, STEER, Bicycle
from free_flyer import Flyer

import diffnea as package

SEEDS = 20
SPEEDS = (4.6, 5.8)  # [m/s]; it is stable by itself from 4.3 to 6.0
STEP, ROWS = 0.005, 1601  # [s], of 8 s
ENCODER, TORQUE = 2e-5, 0.02  # noise [rad], [N·m]
FINE, COARSE = 1e-4, 3e-4  # noise of the pose [m], and of each number of its quaternion
JOINTS = ["j_bar", "j_front", "j_rear"]


@pytest.fixture(scope="module")
def bicycle() -> Bicycle:
    return Bicycle()


def described(bicycle: Bicycle, path: Path) -> dict[str, object]:
    """Return the robot as JSON has it: a tree, and two wheels that roll."""
    path.write_text(Flyer(bicycle.bodies).urdf())
    out = package.load_model(path, free_base=True).to_dict()
    axle = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # its z is the wheel's y
    out["constraints"] = [
        {
            "name": name,
            "kind": "rolling",
            "second": {"link": name, "pose": {"position": [0, 0, 0], "rotation": axle}},
            "radius": radius,
        }
        for name, radius in (("front", FRONT_RADIUS), ("rear", REAR_RADIUS))
    ]
    for link in out["links"]:  # nothing drives the front wheel
        if link["name"] == "front":
            link["joint"]["passive"] = True
    return out


def wrong(description: dict[str, object]) -> package.Model:
    """Masses and inertias 30 % off, up and down in turn."""
    changed = package.Model.from_dict(description).to_dict()
    for k, link in enumerate(changed["links"]):
        factor = 1.3 if k % 2 else 0.7
        link["inertia"] = {
            name: [factor * x for x in v] if isinstance(v, list) else factor * v
            for name, v in link["inertia"].items()
        }
    return package.Model.from_dict(changed)


@pytest.fixture(scope="module")
def rides(bicycle: Bicycle) -> dict[str, np.ndarray]:
    """Ride SEEDS times at each speed: torques of steering and pedals are sums of sines."""
    rng = np.random.default_rng(0)
    t = 0.5 * STEP * np.arange(2 * ROWS - 1)
    each = len(SPEEDS) * SEEDS
    push = np.zeros((len(t), each, 2))
    for _ in range(6):
        w, phase = 2 * np.pi * rng.uniform(0.2, 2.5, (each, 2)), rng.uniform(0, 6, (each, 2))
        push += [1.0, 8.0] * rng.normal(size=(each, 2)) * np.sin(w * t[:, None, None] + phase)
    q, torque = bicycle.ride(np.tile(SPEEDS, SEEDS), push, STEP)
    return {"time": t[::2], "q": q, "torque": torque}


def recording(
    bicycle: Bicycle, rides: dict[str, np.ndarray], k: int, pose: float
) -> package.Recording:
    """Return one ride as sensors have it."""
    rng = np.random.default_rng(k)
    q, steer_and_pedals = rides["q"][:, k], rides["torque"][:, k]
    tau = np.zeros((ROWS, 3))
    tau[:, [0, 2]] = steer_and_pedals + TORQUE * rng.normal(size=(ROWS, 2))
    base = bicycle.frame_poses(q)
    return package.Recording(
        time=rides["time"],
        q=q[:, [STEER, FRONT, REAR]] + ENCODER * rng.normal(size=(ROWS, 3)),
        tau=tau,
        joint_names=JOINTS,
        passive=["j_front"],
        base=base + pose * rng.normal(size=base.shape),
        torque_side="link",
        source=f"ride {k}",
    )


def test_the_generator_is_the_published_bicycle(bicycle: Bicycle) -> None:
    """Meijaard and others 2007, Table 2, at 5 m/s."""

    def second(x: np.ndarray) -> np.ndarray:
        q = np.zeros((1, 9))
        q[0, [LEAN, STEER]] = x[:2]
        u = np.array([[*x[2:], 5.0 / REAR_RADIUS]])
        return bicycle.acceleration(bicycle.put_down(q), u, np.zeros((1, 2)))[0, :2]

    step = 1e-5
    slope = np.zeros((4, 4))
    slope[0, 2] = slope[1, 3] = 1
    for k, e in enumerate(step * np.eye(4)):
        slope[2:, k] = (second(e) - second(-e)) / (2 * step)
    found = sorted(np.linalg.eigvals(slope), key=lambda x: (x.real, x.imag))
    published = [-14.07838969279822, -0.77534188219585 - 4.46486771378823j,
                 -0.77534188219585 + 4.46486771378823j, -0.32286642900409]  # fmt: skip
    # Differences within differences: 1e-5 of rates of order ten.
    np.testing.assert_allclose(found, published, atol=1e-4)


def test_masses_lie_in_their_intervals(
    bicycle: Bicycle, rides: dict[str, np.ndarray], tmp_path: Path
) -> None:
    """Base parameters of 20 pairs of rides at two speeds: 90 to 98 % in their 95 % intervals."""
    model = wrong(described(bicycle, tmp_path / "bicycle.urdf"))
    value = Flyer(bicycle.bodies).parameters()
    inside = []
    for seed in range(SEEDS):
        pair = [recording(bicycle, rides, 2 * seed + i, COARSE) for i in range(2)]
        result = package.identify(model, pair, effects=[])
        assert result.summary.converged
        names = [p.name for p in result.parameters]
        for base in result.base_parameters:
            true = sum(
                c * value[names[k]] for k, c in zip(base.columns, base.coefficients, strict=True)
            )
            inside.append(abs(base.value - true) <= 1.96 * base.std)
        rows = [e.joint for e in result.errors if np.isfinite(e.train)]
        assert rows == ["j_bar", "j_rear", "base_tx"]  # steering, pedals, and lean without a torque
    assert len(inside) >= 25 * SEEDS
    assert 0.90 <= np.mean(inside) <= 0.98


def test_the_trail_lies_in_its_interval(
    bicycle: Bicycle, rides: dict[str, np.ndarray], tmp_path: Path
) -> None:
    """A steering axis drawn 30 mm off is put where the wheels roll, and masses are those of then."""
    off = 0.03
    drawn = described(bicycle, tmp_path / "bicycle.urdf")
    for link in drawn["links"]:
        if link["name"] in ("bar", "front"):
            link["joint"]["pose"]["position"][0] += off if link["name"] == "bar" else -off
    model = package.Model.from_dict(drawn)
    inside = []
    for seed in range(SEEDS):
        pair = [recording(bicycle, rides, 2 * seed + i, FINE) for i in range(2)]
        result = package.identify(
            model, pair, effects=[], fit=["inertia", "kinematics@j_bar", "kinematics@j_front"],
            fix=["*.roll", "*.pitch", "*.yaw", "*.py", "*.pz"],
        )  # fmt: skip
        found = {p.name: p for p in result.parameters}
        for name, true in (("j_bar", -off), ("j_front", off)):
            p = found[f"{name}.kinematics.px"]
            assert p.identifiable
            assert p.std < 0.001
            inside.append(abs(p.value - true) <= 1.96 * p.std)
        assert any("constraint 'front' was off by 0.0" in note for note in result.notes)
    assert 0.90 <= np.mean(inside) <= 0.98
