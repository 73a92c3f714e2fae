"""Robots that float, from a description to a fit: excite, simulate in MuJoCo, identify.

Flights are judged by conservation of momentum, which has no code in common with the library.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from cli import BAD_INPUT, diffnea, done, load
from free_flyer import GRAVITY, Flyer, quadruped, turn
from identify_floating_test import model_of, wrong

import diffnea as package

RATE = 500.0  # control and rows [Hz]
# Fourier series up to 3 Hz are smooth: differences of 2 ms are off by (2π f h)²/6, 2e-4 of them.
DIFFERENCES = 1e-3


@pytest.fixture(scope="module")
def walker() -> Flyer:
    return quadruped()


@pytest.fixture(scope="module")
def described(walker: Flyer, tmp_path_factory: pytest.TempPathFactory) -> package.Model:
    """Return the walker, read from the MJCF that its URDF was exported to."""
    folder = tmp_path_factory.mktemp("walker")
    model_of(walker, folder / "walker.urdf").save(folder / "walker.xml")
    return package.load_model(folder / "walker.xml")


@pytest.fixture(scope="module")
def motions(described: package.Model) -> list[package.Trajectory]:
    """Return a motion to fit, and one to hold out."""
    return [
        package.design_excitation(
            described, duration=10, period=10, harmonics=20, seed=seed, iterations=5
        ).trajectory
        for seed in (1, 2)
    ]


def world_of(model: package.Model) -> str:
    return f"mujoco:{model.source},perturb=none,seed=1"


def rotations(base: np.ndarray) -> np.ndarray:
    v, w = base[:, 3:6], base[:, 6]
    angle = 2 * np.arctan2(np.linalg.norm(v, axis=1), w)
    axis = v / np.maximum(np.linalg.norm(v, axis=1), 1e-300)[:, None]
    return np.array([turn(a, np.array(x)) for a, x in zip(axis, angle, strict=True)])


def test_flights_keep_their_momentum(
    walker: Flyer, described: package.Model, motions: list[package.Trajectory]
) -> None:
    """The centre of mass falls, the angular momentum about it stays; torques are the links'."""
    flights = package.simulate(
        described, motions[0], world=world_of(described), noise=0, rate=RATE, period=10.0
    ).recordings
    assert not any(r.period for r in flights)  # no flight repeats another
    assert [r.run for r in flights] == list(range(5))
    mass = np.array([b.mass for b in walker.bodies])
    turned = []
    for r in flights[:3]:
        assert r.base is not None
        assert r.tau is not None
        frames = rotations(r.base)
        turned.append(np.degrees(np.arccos((np.trace(frames[-1]) - 1) / 2)))
        centre = np.einsum("i,kij->kj", mass, walker.in_trunk(r.q)[2]) / mass.sum()
        falls = r.base[:, :3] + (frames @ centre[..., None])[..., 0]
        path = np.polynomial.polynomial.polyfit(r.time, falls, 2)
        np.testing.assert_allclose(path[2], 0.5 * GRAVITY, atol=1e-4)
        off = falls - np.polynomial.polynomial.polyval(r.time, path).T
        assert np.abs(off).max() < 1e-6  # [m]
        assert abs(r.base[0, 2] - r.base[-1, 2]) < 0.1  # it comes back, its legs elsewhere
        assert r.base[:, 2].max() - r.base[0, 2] == pytest.approx(9.81 / 2, abs=0.1)

        inside, h = slice(1, -1), r.time[1] - r.time[0]
        skew = (frames[2:] - frames[:-2]) / (2 * h) @ np.swapaxes(frames[inside], 1, 2)
        omega = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
        inertia, own = walker.momentum(r.q[inside], (r.q[2:] - r.q[:-2]) / (2 * h))
        spin = np.einsum("kji,kj->ki", frames[inside], omega)
        kept = np.einsum("kij,kj->ki", frames[inside], (inertia @ spin[..., None])[..., 0] + own)
        assert np.ptp(kept, axis=0).max() < DIFFERENCES * np.abs(own).max()

        v = np.array(
            [
                package.difference(described, q0=a, q1=b) / (2 * h)
                for a, b in zip(*(np.hstack([r.base, r.q])[x] for x in (slice(-2), slice(2, None))),
                                strict=True)
            ]
        )  # fmt: skip
        q, vd = np.hstack([r.base, r.q])[2:-2], (v[2:] - v[:-2]) / (2 * h)
        found = package.rnea(described, q=q, qd=v[1:-1], qdd=vd)
        # The mean of what acts within the differences, a triangle over four rows.
        acts = sum(
            w * r.tau[2 + k : len(r.tau) - 2 + k]
            for k, w in zip(range(-2, 2), (1, 3, 3, 1), strict=True)
        )
        assert np.abs(found[:, 6:] - acts / 8).max() < 0.01 * np.abs(r.tau).max()
        assert np.abs(found[:, 3:6]).max() < DIFFERENCES * mass.sum() * 9.81
    assert max(turned) > 10  # thrown with a spin


def test_a_held_robot_is_a_robot_on_a_fixed_base(
    described: package.Model, motions: list[package.Trajectory]
) -> None:
    """--fix-base holds the world's trunk, too; legs meet it without a contact."""
    hung = package.load_model(described.source, fix_base=True)
    theirs = package.simulate(hung, motions[0], world=world_of(described), noise=0)
    ours = package.simulate(hung, motions[0], noise=0)
    assert len(theirs.recordings) == 1
    assert theirs.recording.base is None
    pairs = [(getattr(theirs.recording, x), getattr(ours.recording, x)) for x in ("q", "tau")]
    for a, b in pairs:
        # Both are Runge–Kutta's of 0.5 ms on the same torques.
        assert np.abs(a - b).max() < 1e-5 * np.abs(b).max()


def test_base_parameters_come_back_from_flights(
    walker: Flyer, described: package.Model, motions: list[package.Trajectory], tmp_path: Path
) -> None:
    """Truth lies in its 95 % intervals in ten recordings of one designed motion."""
    model = wrong(walker, tmp_path / "wrong.urdf")
    value = walker.parameters()
    inside = count = 0
    for seed in range(10):
        flights = package.simulate(
            described, motions[0], world=world_of(described), seed=seed
        ).recordings
        result = package.identify(model, flights, effects=[])
        assert result.summary.converged
        names = [p.name for p in result.parameters]
        for base in result.base_parameters:
            true = sum(
                c * value[names[k]] for k, c in zip(base.columns, base.coefficients, strict=True)
            )
            count += 1
            inside += abs(base.value - true) <= 1.96 * base.std
    print(f"{inside} of {count} intervals hold the truth")
    assert count == 10 * 66
    # Intervals of one designed motion are a little wide, as those of loops are: 0.98 seen.
    assert 0.90 <= inside / count <= 0.995


def test_a_design_for_flight_keeps_its_limits(described: package.Model) -> None:
    """Better than random motions by its own measure, and the trunk's parameters are seen."""
    held = package.load_model(described.source, fix_base=True)
    flown = package.design_excitation(
        described, duration=10, seed=1, iterations=10, torque_limits={"": 0.2}
    )
    on_a_stand = package.design_excitation(held, duration=10, seed=1, iterations=0)
    assert flown.std_ratio < 1.0
    # The trunk has ten of its own, which a stand takes.
    assert flown.base_parameters >= on_a_stand.base_parameters
    assert any("gives way" in note for note in flown.notes)
    t = flown.trajectory
    zero_g = package.Model.from_dict({**held.to_dict(), "gravity": [0, 0, 0]})
    tau = package.rnea(zero_g, q=t.q, qd=t.qd, qdd=t.qdd)
    assert 0.1 < np.abs(tau).max() < 0.2


REFUSED: list[tuple[dict[str, object], str]] = [
    ({}, r"floats, and flights are simulated by MuJoCo.*--fix-base"),
    ({"world": "mujoco:wam4"}, r"base is fixed, and that of the model floats"),
    ({"world": "{here},repetitions=3"}, r"repetitions of a robot that floats"),
    ({"world": "{here}", "flight": 11.0}, r"lasts 10 s, expected one flight of 11 s or more"),
    ({"world": "{here}", "flight": 0.0}, r"flight must be positive"),
]


@pytest.mark.parametrize(("options", "message"), REFUSED)
def test_what_cannot_fly_is_refused(
    described: package.Model,
    motions: list[package.Trajectory],
    options: dict[str, object],
    message: str,
) -> None:
    if "world" in options:
        options = {**options, "world": str(options["world"]).format(here=world_of(described))}
    with pytest.raises(package.Error, match=message):
        package.simulate(described, motions[0], **options)  # type: ignore[arg-type]


def test_the_commands_lead_from_a_description_to_flights(
    walker: Flyer, described: package.Model, tmp_path: Path
) -> None:
    """A URDF, its export, motions, two logs with a run a flight, a fit."""
    urdf, robot = tmp_path / "walker.urdf", tmp_path / "walker.xml"
    urdf.write_text(walker.urdf())
    done("export", urdf, "--free-base", "-o", robot)
    for seed in (1, 2):
        motion, log = tmp_path / f"motion{seed}.csv", tmp_path / f"flights{seed}.csv"
        design = ("--duration", 10, "--iterations", 3, "--seed", seed)
        done("excite", robot, "-o", motion, *design)
        world = ("--world", f"mujoco:{robot},perturb=A,seed=3", "--seed", seed)
        simulated = ("simulate", robot, "--trajectory", motion, *world, "-o", log, "--json")
        told = json.loads(done(*simulated))
        assert (told["runs"], told["rows"], told["seconds"]) == (5, 5 * 1001, 2.0)
        flights = package.read_recordings(log)
        assert [r.run for r in flights] == list(range(5))
    answer = diffnea("simulate", robot, "--trajectory", motion, "-o", tmp_path / "x.csv")
    assert answer.returncode == BAD_INPUT
    assert "--world mujoco:FILE.xml" in answer.stderr
    assert not (tmp_path / "x.csv").exists()
    run = tmp_path / "run"
    train, test = (tmp_path / f"flights{seed}.csv" for seed in (1, 2))
    done("identify", robot, train, "--test", test, "-o", run)
    rmse = load(run / "result.json")["rmse"]
    for joint in walker.joints:
        assert rmse["test"][joint] < 0.5 * rmse["nominal_test"][joint]
