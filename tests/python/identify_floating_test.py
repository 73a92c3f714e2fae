"""Robots that float, identified from flights; data by conservation of momentum."""

from pathlib import Path

import numpy as np
import pytest
from cli import BAD_INPUT, diffnea, done
from free_flyer import GRAVITY, STEP, Body, Flyer, carried_body, quadruped, slope

import diffnea as package

SEEDS = 20
FLIGHTS = 6  # flights of two seconds in each recording
# Noise of joints' encoders [rad] and torques [N·m]
ENCODER, TORQUE = 2e-5, 0.05
# Noise of the pose [m], and of each number of its quaternion: motion capture, and a poor one
POSE = 1e-4
POOR = 5e-4


def flown(flyer: Flyer, rng: np.random.Generator, seconds: float = 2.0) -> dict[str, np.ndarray]:
    """Throw the robot, its legs on random waves."""
    n = len(flyer.joints)
    t = 0.5 * STEP * np.arange(2 * int(seconds / STEP) + 25)
    q, qd = np.zeros((2, len(t), n))
    for j in range(n):
        for k in range(1, 5):
            w, a, phase = 2 * np.pi * rng.uniform(0.5, 3), 0.5 * rng.normal() / k, rng.uniform(0, 6)
            q[:, j] += a * np.sin(w * t + phase)
            qd[:, j] += a * w * np.cos(w * t + phase)
    spin, throw = 0.5 * rng.normal(size=3), rng.normal(size=3) + [0, 0, 5]
    return flyer.fly(q, qd, spin, throw)


def measured(flyer: Flyer, seed: int, pose: float = POSE) -> list[package.Recording]:
    """Return flights as sensors have them."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(FLIGHTS):
        x = flown(flyer, rng)
        out.append(
            package.Recording(
                time=x["time"],
                q=x["q"] + ENCODER * rng.normal(size=x["q"].shape),
                tau=x["tau"] + TORQUE * rng.normal(size=x["tau"].shape),
                joint_names=flyer.joints,
                base=x["base"] + pose * rng.normal(size=x["base"].shape),
                torque_side="link",
                source=f"flight {seed}.{k}",
            )
        )
    return out


def model_of(flyer: Flyer, path: Path) -> package.Model:
    path.write_text(flyer.urdf())
    return package.load_model(path, free_base=True)


@pytest.fixture(scope="module")
def walker() -> Flyer:
    return quadruped()


def wrong(flyer: Flyer, path: Path) -> package.Model:
    """A description whose masses are a quarter off, and whose inertias a fifth."""
    model = model_of(flyer, path)
    changed = model.to_dict()
    for k, link in enumerate(changed["links"]):
        factor = 1.25 if k % 2 else 0.8
        link["inertia"] = {name: _scaled(v, factor) for name, v in link["inertia"].items()}
    return package.Model.from_dict(changed)


def _scaled(value: object, factor: float) -> object:
    return [factor * float(x) for x in value] if isinstance(value, list) else factor * float(value)  # type: ignore[arg-type]


def test_a_flight_has_the_library_s_torques_and_no_wrench(walker: Flyer, tmp_path: Path) -> None:
    """The generator's momentum, and the library's recursion: no code in common."""
    model = model_of(walker, tmp_path / "walker.urdf")
    x = flown(walker, np.random.default_rng(1))
    q, step = np.hstack([x["base"], x["q"]]), x["time"][1]
    v = np.hstack([x["twist"], slope(x["q"], step)])
    whole = slice(6, -6)
    found = package.rnea(model, q=q[whole], qd=v[whole], qdd=slope(v, step)[whole])
    # Motion at 10 Hz, the third harmonic of the fastest wave, has 2e-6 of error in its slope.
    close = 1e-4
    assert np.abs(found[:, 6:] - x["tau"][whole]).max() < close * np.abs(x["tau"]).max()
    weight = sum(b.mass for b in walker.bodies) * -GRAVITY[2]
    assert np.abs(found[:, 3:6]).max() < close * weight
    assert np.abs(found[:, :3]).max() < close * np.abs(x["tau"]).max()
    turned = [package.difference(model, q0=q[k - 1], q1=q[k + 1])[:6] for k in range(1, 50)]
    off = np.array(turned) / (2 * step) - x["twist"][1:50]  # (2π f h)²/6 of motion at 6 Hz: 0.4 %
    assert np.abs(off).max() < 0.01 * np.abs(x["twist"]).max()


@pytest.mark.parametrize("pose", [pytest.param(POSE, marks=pytest.mark.study), POOR])
def test_base_parameters_lie_in_their_intervals(
    walker: Flyer, tmp_path: Path, pose: float
) -> None:
    """Truth lies in 90 to 98 % of the 95 % intervals of 20 recordings, the trunk's among them."""
    model = wrong(walker, tmp_path / "walker.urdf")
    value = walker.parameters()
    inside = count = of_trunk = 0
    for seed in range(SEEDS):
        result = package.identify(model, measured(walker, seed, pose), effects=[])
        assert result.summary.converged
        names = [p.name for p in result.parameters]
        for base in result.base_parameters:
            true = sum(
                c * value[names[k]] for k, c in zip(base.columns, base.coefficients, strict=True)
            )
            count += 1
            of_trunk += any(names[k].startswith("trunk.") for k in base.columns)
            inside += abs(base.value - true) <= 1.96 * base.std
    assert count == 66 * SEEDS  # 16 of a hip and a knee in their planes each, and ten of the trunk
    assert of_trunk >= 10 * SEEDS
    assert 0.90 <= inside / count <= 0.98


def test_the_trunk_s_inertia_is_known_with_the_whole_mass(walker: Flyer, tmp_path: Path) -> None:
    """Legs as they are described, the trunk has all ten parameters from the air alone."""
    model = model_of(walker, tmp_path / "walker.urdf")
    heavy = model.to_dict()
    inertia = heavy["links"][0]["inertia"]
    heavy["links"][0]["inertia"] = {name: _scaled(v, 1.5) for name, v in inertia.items()}
    legs = [f"{b.name}.*" for b in walker.bodies[1:]]
    result = package.identify(
        package.Model.from_dict(heavy), measured(walker, 1), effects=[], fix=legs
    )
    value = walker.parameters()
    for p in result.parameters[:10]:
        assert p.identifiable
        assert abs(p.value - value[p.name]) < 4 * p.std
        assert p.name != "trunk.mass" or p.std < 0.01 * p.value


def log_of(recordings: list[package.Recording], path: Path) -> Path:
    package.write_recording(recordings, path)
    return path


def test_the_command_fits_a_floating_robot(walker: Flyer, tmp_path: Path) -> None:
    """From CSV as from arrays; what it writes floats, and its errors have rows of the base."""
    wrong(walker, tmp_path / "walker.urdf")
    train, test = measured(walker, 1), measured(walker, 2)
    sidecar = '{"schema": "diffnea/recording/1", "torque_side": "link"}'
    for name, data in (("train", train), ("test", test)):
        log_of(data, tmp_path / f"{name}.csv")
        (tmp_path / f"{name}.json").write_text(sidecar)
    done(
        "identify", tmp_path / "walker.urdf", tmp_path / "train.csv", "--test",
        tmp_path / "test.csv", "--free-base", "-o", tmp_path / "run",
    )  # fmt: skip
    result = package.read_result(tmp_path / "run")
    axes = ["tx", "ty", "tz", "fx", "fy", "fz"]
    assert [e.joint for e in result.errors] == walker.joints + [f"base_{a}" for a in axes]
    assert [e.unit for e in result.errors[-6:]] == 3 * ["N*m"] + 3 * ["N"]
    assert all(np.isfinite(e.test) and e.test_raw >= e.test for e in result.errors)
    assert package.load_model(tmp_path / "run").free_base == "trunk"
    again = package.identify(
        package.load_model(tmp_path / "walker.urdf", free_base=True), train, test=test
    )
    for a, b in zip(result.parameters, again.parameters, strict=True):
        assert a.value == pytest.approx(b.value, rel=1e-9, abs=1e-12)


DRONE = Body("hull", -1, mass=1.3, com=(0.01, -0.02, 0.015),
             inertia=(0.012, 0.0004, -0.0003, 0.015, 0.0002, 0.022))  # fmt: skip


def thrown(seed: int, **given: object) -> package.Recording:
    """Record the drone with its thrust known to 0.1 N and 5 mN·m."""
    rng, x = np.random.default_rng(seed), carried_body(DRONE, seed)
    noise = rng.normal(size=x["wrench"].shape) * [*3 * [0.005], *3 * [0.1]]
    known = {
        "time": x["time"],
        "base": x["base"] + POSE * rng.normal(size=x["base"].shape),
        "base_wrench": x["wrench"] + noise,
        "torque_side": "link",
        "source": f"drone {seed}",
    }
    return package.Recording(**(known | given))


def test_a_drone_has_its_inertia_from_its_thrust(tmp_path: Path) -> None:
    """No joint at all: the wrench is what is measured, and all ten parameters are known."""
    flyer = Flyer((DRONE,))
    model = wrong(flyer, tmp_path / "drone.urdf")
    value, inside, count = flyer.parameters(), 0, 0
    for seed in range(SEEDS):
        result = package.identify(model, thrown(seed), effects=[])
        for p in result.parameters:
            assert p.identifiable
            inside += abs(p.value - value[p.name]) <= 1.96 * p.std
            count += 1
    assert count == 10 * SEEDS
    assert 0.90 <= inside / count <= 0.98


def test_forces_that_are_zero_do_not_take_the_mass(tmp_path: Path) -> None:
    """A drone that rises and yaws: four of its six rows are noise, of pose and wrench."""
    hull = '<mass value="1"/><inertia ixx=".01" iyy=".01" izz=".02" ixy="0" ixz="0" iyz="0"/>'
    path = tmp_path / "hull.urdf"
    path.write_text(f'<robot name="d"><link name="hull"><inertial>{hull}</inertial></link></robot>')
    mass, turn = 1.3, 0.021  # [kg], [kg·m²]
    rng = np.random.default_rng(1)
    t = np.arange(0, 10, 0.004)
    w = 2 * np.pi * np.array([[0.3], [0.7], [1.1]])
    wave, change = np.sin(w * t + w).sum(0), -(w**2 * np.sin(w * t + w)).sum(0)
    base, wrench = np.zeros((len(t), 7)), np.zeros((len(t), 6))
    base[:, 2], base[:, 5], base[:, 6] = 0.2 * wave, np.sin(0.2 * wave), np.cos(0.2 * wave)
    wrench[:, 5], wrench[:, 2] = mass * (0.2 * change - GRAVITY[2]), turn * 0.4 * change
    result = package.identify(
        package.load_model(path, free_base=True),
        package.Recording(
            time=t,
            base=base + 1e-3 * rng.normal(size=base.shape),
            base_wrench=wrench + rng.normal(size=wrench.shape) * [*3 * [0.002], *3 * [0.02]],
            torque_side="link",
        ),
        effects=[],
    )
    found = {p.name: p for p in result.parameters}
    for name, value in (("hull.mass", mass), ("hull.Izz", turn)):
        assert abs(found[name].value - value) <= 4 * found[name].std
        assert found[name].std < 0.02 * value


def test_a_measured_twist_serves_as_well(tmp_path: Path) -> None:
    """Its frame is checked by the audit: that of the world is a fault, its own is none."""
    x, rng = carried_body(DRONE, 3), np.random.default_rng(3)
    twist = x["twist"] + 1e-3 * rng.normal(size=x["twist"].shape)
    report = package.audit(thrown(3, base_twist=twist))
    assert not [f for f in report.faults if f.severity == "fault"]
    assert any(c.name == "measured twist" and c.done for c in report.checks)
    w, u = x["base"][:, 6:], x["base"][:, 3:6]
    turns = lambda v: v + 2 * np.cross(u, np.cross(u, v) + w * v)  # noqa: E731
    in_world = np.hstack([turns(twist[:, :3]), turns(twist[:, 3:])])
    report = package.audit(thrown(3, base_twist=in_world))
    found = {(f.fault, f.channel) for f in report.faults if f.severity == "fault"}
    assert found == {
        ("twist_frame", "base_wx, base_wy, base_wz"),
        ("twist_frame", "base_vx, base_vy, base_vz"),
    }
    report = package.audit(thrown(3, base_twist=np.hstack([-twist[:, :3], 1.1 * twist[:, 3:]])))
    found = {f.fault: f.value for f in report.faults if f.severity == "fault"}
    assert set(found) == {"velocity_sign", "velocity_scale"}
    assert found["velocity_sign"] == pytest.approx(-1, abs=0.01)
    assert found["velocity_scale"] == pytest.approx(1.1, abs=0.01)


def test_signs_and_norms_of_quaternions(walker: Flyer, tmp_path: Path) -> None:
    """One rotation has two of them: signs at random change nothing. What is no rotation is left out."""
    model = model_of(walker, tmp_path / "walker.urdf")
    good = measured(walker, 1)
    rng = np.random.default_rng(1)

    def with_base(change: np.ndarray, r: package.Recording) -> package.Recording:
        base = r.base.copy()
        base[:, 3:] *= change
        return package.Recording(
            time=r.time, q=r.q, tau=r.tau, joint_names=r.joint_names, base=base,
            torque_side="link", source=r.source,
        )  # fmt: skip

    fit = package.identify(model, good, effects=[])
    signs = [rng.choice([-1.0, 1.0], size=(len(r), 1)) for r in good]
    flipped = [with_base(s, r) for s, r in zip(signs, good, strict=True)]
    again = package.identify(model, flipped, effects=[])
    for a, b in zip(fit.parameters, again.parameters, strict=True):
        assert a.value == pytest.approx(b.value, rel=1e-9, abs=1e-12)
    assert any("changes its sign" in note for note in again.notes)
    assert any(f.fault == "quaternion_sign" for f in package.audit(flipped).faults)
    short = [with_base(np.full((len(r), 1), 0.995), r) for r in good]
    again = package.identify(model, short, effects=[])  # three digits: divided by the norm
    for a, b in zip(fit.base_parameters, again.base_parameters, strict=True):
        assert abs(a.value - b.value) < 1e-3 * a.std  # the barrier's tolerance
    assert any(f.fault == "quaternion_norm" for f in package.audit(short).faults)
    lost = np.ones((len(good[0]), 1))
    lost[100:103] = 0  # a tracker that lost sight
    few = package.identify(model, [with_base(lost, good[0]), *good[1:]], effects=[])
    assert any("has norm 0, expected 1; 3 such rows are gaps" in n for n in few.data_report.notes)
    with pytest.raises(package.DataError, match=r"has norm [12]\.?\d*, expected 1; 501 of 501 rows"):
        package.identify(model, with_base(np.full((501, 1), 2.0), good[0]))
    # A file's reader leaves the rows out.
    log_of([with_base(lost, good[0])], tmp_path / "lost.csv")
    read = package.read_recordings(tmp_path / "lost.csv")
    assert read.report.quarantined == 3
    assert "base_qw has norm 0, expected 1" in read.report.quarantined_rows[0].reason
    log_of([with_base(np.full((501, 1), 2.0), good[0])], tmp_path / "long.csv")
    with pytest.raises(package.DataError, match="501 of 501 rows cannot be true"):
        package.read_recordings(tmp_path / "long.csv")


def test_a_robot_on_the_ground_is_told(walker: Flyer, tmp_path: Path) -> None:
    """Contacts are not modelled: what holds the weight is missing, and a note says so."""
    model = model_of(walker, tmp_path / "walker.urdf")
    flight = measured(walker, 1)
    held = []
    for r in flight:
        base = np.tile([0, 0, 0.4, 0, 0, 0, 1.0], (len(r), 1))
        base += POSE * np.random.default_rng(r.run).normal(size=base.shape)
        held.append(package.Recording(time=r.time, q=r.q, tau=r.tau, joint_names=r.joint_names,
                                      base=base, torque_side="link"))  # fmt: skip
    assert not any("holds or touches it" in n for n in package.identify(model, flight).notes)
    assert any("holds or touches it" in n for n in package.identify(model, held).notes)


def test_refusals(walker: Flyer, tmp_path: Path) -> None:
    """Bases that are not logged or do not float, axes that are missing, losses that do not serve."""
    model = model_of(walker, tmp_path / "walker.urdf")
    r = measured(walker, 1)[0]
    bare = package.Recording(time=r.time, q=r.q, tau=r.tau, joint_names=r.joint_names)
    with pytest.raises(package.DataError, match=r"floats on 'trunk', and its pose is not recorded"):
        package.identify(model, bare)
    hung = package.load_model(tmp_path / "walker.urdf")
    fit = package.identify(hung, r)
    assert any("base_…) are left out: the model's base is fixed" in n for n in fit.data_report.notes)
    for loss in ("motion", "forward"):
        with pytest.raises(package.ModelError, match="by this loss: the base 'trunk'"):
            package.identify(model, r, loss=loss)
    frame = r.to_frame()
    frame.drop(columns="base_qy").to_csv(tmp_path / "three.csv", index=False)
    said = diffnea("audit", tmp_path / "three.csv")
    assert said.returncode == BAD_INPUT
    assert "of base_qx, base_qy, base_qz, base_qw some are missing" in said.stderr
    assert package.Recording.from_frame(frame).base == pytest.approx(r.base)
    with pytest.raises(package.DataError, match="need the pose of the base"):
        package.Recording(time=r.time, q=r.q, joint_names=r.joint_names, base_wrench=r.base[:, :6])
