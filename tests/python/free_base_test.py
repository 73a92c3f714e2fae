"""A walker on a free base: shapes, physics, and what refuses it."""

from pathlib import Path

import numpy as np
import pytest
from cli import BAD_INPUT, diffnea, done

import diffnea as package

# Sums of a dozen products of order 10: some ulp each; after a solve with M, its condition more.
ROUNDING = 1e-11
SOLVED = 1e-8

LINK = (
    '<link name="{name}"><inertial><origin xyz="0.02 {y} -0.05"/><mass value="{mass}"/>'
    '<inertia ixx="2e-2" ixy="1e-3" ixz="0" iyy="3e-2" iyz="0" izz="2.5e-2"/></inertial></link>'
)
JOINT = (
    '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="0.1 {y} -0.1" rpy="0.1 0 0.2"/><axis xyz="0 1 0"/>'
    '<limit lower="-2" upper="2" effort="40" velocity="10"/><dynamics damping="0.3"/></joint>'
)
MASS = 5.0 + 1.0 + 0.5 + 1.2


@pytest.fixture(scope="module")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("walker") / "walker.urdf"
    path.write_text(
        '<robot name="walker">'
        + LINK.format(name="trunk", y=0, mass=5)
        + LINK.format(name="left", y=0.03, mass=1)
        + LINK.format(name="foot", y=0, mass=0.5)
        + LINK.format(name="right", y=-0.03, mass=1.2)
        + JOINT.format(name="hip", parent="trunk", child="left", y=0.1)
        + JOINT.format(name="knee", parent="left", child="foot", y=0)
        + JOINT.format(name="other", parent="trunk", child="right", y=-0.1)
        + "</robot>"
    )
    return path


@pytest.fixture(scope="module")
def walker(urdf: Path) -> package.Model:
    return package.load_model(urdf, free_base=True)


def states(rows: int = 20) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    q = rng.normal(size=(rows, 10))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    return q, rng.normal(size=(rows, 9)), rng.normal(size=(rows, 9))


def rotation(q: np.ndarray) -> np.ndarray:
    x, y, z, w = q[3:7]
    v = np.array([x, y, z])
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return (w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * cross


def test_a_model_says_what_floats(walker: package.Model, urdf: Path) -> None:
    assert walker.free_base == "trunk"
    assert (walker.num_joints, walker.num_positions, walker.num_velocities) == (3, 10, 9)
    assert walker.links[0].type == "floating"
    assert walker.inertial_parameters.shape == (40,)
    assert "free base" in repr(walker)
    assert package.Model.from_dict(walker.to_dict()) == walker
    fixed = package.load_model(urdf)
    assert fixed.free_base is None
    assert fixed.num_positions == fixed.num_velocities == 3


def test_shapes_of_one_state_and_of_many(walker: package.Model) -> None:
    q, qd, qdd = states()
    tau = package.rnea(walker, q=q, qd=qd, qdd=qdd)
    assert tau.shape == (20, 9)
    assert package.rnea(walker, q=q[0], qd=qd[0], qdd=qdd[0]).shape == (9,)
    assert package.mass_matrix(walker, q=q).shape == (20, 9, 9)
    assert package.regressor(walker, q=q, qd=qd, qdd=qdd).shape == (20, 9, 40)
    assert package.frame_jacobian(walker, "foot", q=q[0]).shape == (6, 9)
    for k in range(3):
        one = package.rnea(walker, q=q[k], qd=qd[k], qdd=qdd[k])
        np.testing.assert_allclose(one, tau[k], atol=ROUNDING)


def test_algorithms_agree(walker: package.Model) -> None:
    q, qd, qdd = states()
    tau = package.rnea(walker, q=q, qd=qd, qdd=qdd)
    np.testing.assert_allclose(package.aba(walker, q=q, qd=qd, tau=tau), qdd, atol=SOLVED)
    bias = package.rnea(walker, q=q, qd=qd, qdd=0 * qdd)
    mass = package.mass_matrix(walker, q=q)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", mass, qdd) + bias, tau, atol=ROUNDING)
    columns = package.regressor(walker, q=q, qd=qd, qdd=qdd)
    np.testing.assert_allclose(columns @ walker.inertial_parameters, tau, atol=ROUNDING)


def test_derivatives_are_central_differences_on_the_manifold(walker: package.Model) -> None:
    q, qd, qdd = (x[0] for x in states())
    step = 1e-6
    dq, dqd, mass = package.rnea_derivatives(walker, q=q, qd=qd, qdd=qdd)
    np.testing.assert_allclose(mass, package.mass_matrix(walker, q=q), atol=ROUNDING)
    for k, unit in enumerate(np.eye(9) * step):
        turned = [package.integrate(walker, q=q, v=v) for v in (unit, -unit)]
        tau = [package.rnea(walker, q=x, qd=qd, qdd=qdd) for x in turned]
        np.testing.assert_allclose((tau[0] - tau[1]) / (2 * step), dq[:, k], atol=1e-7)
        tau = [package.rnea(walker, q=q, qd=qd + v, qdd=qdd) for v in (unit, -unit)]
        np.testing.assert_allclose((tau[0] - tau[1]) / (2 * step), dqd[:, k], atol=1e-7)


def test_effects_of_the_joints_act(walker: package.Model) -> None:
    q, qd, qdd = states()
    tau = package.rnea(walker, q=q, qd=qd, qdd=qdd, effects=True)
    bare = package.rnea(walker, q=q, qd=qd, qdd=qdd)
    np.testing.assert_allclose(tau[:, :6], bare[:, :6], atol=ROUNDING)
    np.testing.assert_allclose(tau[:, 6:], bare[:, 6:] + 0.3 * qd[:, 6:], atol=ROUNDING)
    back = package.aba(walker, q=q, qd=qd, tau=tau, effects=True)
    np.testing.assert_allclose(back, qdd, atol=SOLVED)


def test_a_robot_that_falls_feels_nothing(walker: package.Model) -> None:
    q, qd, qdd = states()
    still = np.zeros(9)
    for row in q:
        falls = package.aba(walker, q=row, qd=still, tau=still)
        down = rotation(row).T @ [0, 0, -9.81]
        np.testing.assert_allclose(falls, [0, 0, 0, *down, 0, 0, 0], atol=SOLVED)
        weight = package.gravity_torques(walker, q=row)
        np.testing.assert_allclose(weight[3:6], -MASS * down, atol=ROUNDING)
    turned = q.copy()
    turned[:, 3:7] *= -1  # the same rotation
    torques = [package.rnea(walker, q=x, qd=qd, qdd=qdd) for x in (q, turned)]
    np.testing.assert_allclose(*torques, atol=ROUNDING)


def test_a_hung_robot_is_the_joints_half(walker: package.Model, urdf: Path) -> None:
    hung = package.load_model(urdf)
    q, qd, qdd = (x.copy() for x in states())
    q[:, :7] = [0, 0, 0, 0, 0, 0, 1]
    qd[:, :6] = qdd[:, :6] = 0
    tau = package.rnea(walker, q=q, qd=qd, qdd=qdd)
    expected = package.rnea(hung, q=q[:, 7:], qd=qd[:, 6:], qdd=qdd[:, 6:])
    np.testing.assert_allclose(tau[:, 6:], expected, atol=ROUNDING)


def test_frames_move_with_the_base(walker: package.Model) -> None:
    q, qd, qdd = states()
    step = 1e-6
    for row, v, a in zip(q, qd, qdd, strict=True):
        moves = package.frame_motion(walker, "foot", q=row, qd=v, qdd=a)
        jacobian = package.frame_jacobian(walker, "foot", q=row)
        speed = np.concatenate([moves.angular_velocity, moves.velocity])
        np.testing.assert_allclose(jacobian @ v, speed, atol=ROUNDING)
        ends = [
            package.frame_motion(
                walker,
                "foot",
                q=package.integrate(walker, q=row, v=h * v + 0.5 * h * h * a),
                qd=v + h * a,
                qdd=a,
            )
            for h in (step, -step)
        ]
        change = (ends[0].pose[:3, 3] - ends[1].pose[:3, 3]) / (2 * step)
        np.testing.assert_allclose(change, moves.velocity, atol=1e-7)
        change = (ends[0].velocity - ends[1].velocity) / (2 * step)
        np.testing.assert_allclose(change, moves.acceleration, atol=1e-6)


def test_a_step_and_its_difference(walker: package.Model) -> None:
    q, qd, _ = states()
    to = package.integrate(walker, q=q, v=qd)
    assert to.shape == (20, 10)
    np.testing.assert_allclose(np.linalg.norm(to[:, 3:7], axis=1), 1, atol=1e-15)
    short = np.linalg.norm(qd[:, :3], axis=1) < np.pi
    back = package.difference(walker, q0=q, q1=to)
    np.testing.assert_allclose(back[short], qd[short], atol=ROUNDING)
    hinge = package.load_model("wam4")
    x = np.zeros(hinge.num_joints)
    assert np.array_equal(package.integrate(hinge, q=x, v=x + 1), x + 1)


def flight(walker: package.Model, seed: int) -> tuple[np.ndarray, ...]:
    """Tumble through the air with the joints driven: states, accelerations, and torques."""
    rng = np.random.default_rng(seed)
    q, v = states(1)[0][0], rng.normal(size=9)
    amplitude, rate, phase = rng.normal(size=3), rng.uniform(5, 20, 3), rng.uniform(0, 6, 3)
    step, rows = 2e-3, []
    for k in range(300):
        force = np.zeros(9)
        force[6:] = amplitude * np.sin(rate * k * step + phase)

        def slope(x: np.ndarray, force: np.ndarray = force, v0: np.ndarray = q) -> np.ndarray:
            turned = package.integrate(walker, q=v0, v=x[:9])
            return package.aba(walker, q=turned, qd=x[9:], tau=force)

        a = package.aba(walker, q=q, qd=v, tau=force)
        rows.append((q, v, a, force))
        middle = slope(np.concatenate([0.5 * step * v, v + 0.5 * step * a]))
        q = package.integrate(walker, q=q, v=step * (v + 0.5 * step * a))
        v = v + step * middle
    return tuple(np.array(x) for x in zip(*rows, strict=True))


def test_inertias_are_fitted_to_flights_without_a_wrench(walker: package.Model) -> None:
    def stacked(seed: int) -> tuple[np.ndarray, np.ndarray]:
        q, qd, qdd, tau = flight(walker, seed)
        columns = package.regressor(walker, q=q, qd=qd, qdd=qdd)
        return columns.reshape(-1, 40), tau.reshape(-1)

    columns, tau = (np.concatenate(x) for x in zip(*map(stacked, range(4)), strict=True))
    fitted = np.linalg.lstsq(columns, tau, rcond=1e-10)[0]
    held_out, expected = stacked(9)
    np.testing.assert_allclose(held_out @ fitted, expected, atol=1e-6)
    joints = np.arange(len(expected)) % 9 >= 6
    assert np.all(expected[~joints] == 0)  # the six rows of the base
    # Their columns see what the joints' rows do not, the inertia of the base among it.
    rows = np.arange(len(tau)) % 9 >= 6
    rank = [np.linalg.matrix_rank(x, tol=1e-6) for x in (columns[rows], columns)]
    assert rank[1] > rank[0]
    assert abs(fitted[:40:10].sum() - MASS) < 1e-4


def test_what_is_no_state_is_named(walker: package.Model) -> None:
    q, qd, qdd = states(4)
    with pytest.raises(package.ShapeError, match=r"rnea: q: got shape \(4, 9\), expected \(10,\)"):
        package.rnea(walker, q=qd, qd=qd, qdd=qdd)
    with pytest.raises(package.ShapeError, match=r"qd: got shape \(9,\), expected \(4, 9\)"):
        package.rnea(walker, q=q, qd=qd[0], qdd=qdd)
    q[2, 3:7] *= 0.9
    with pytest.raises(package.DataError, match=r"row 2 .*norm 0\.9.*expected norm 1"):
        package.aba(walker, q=q, qd=qd, tau=qdd)
    with pytest.raises(package.DataError, match=r"mass_matrix.*norm 0\.9"):
        package.mass_matrix(walker, q=q[2])


def test_what_serves_no_free_base_says_so(
    walker: package.Model, urdf: Path, tmp_path: Path
) -> None:
    still = np.zeros((2, 3))
    motion = package.Trajectory(
        time=[0.0, 1.0], q=still, qd=still, qdd=still, joint_names=walker.joint_names
    )
    with pytest.raises(package.ModelError, match=r"'trunk' .* floats.*world=.*--fix-base"):
        package.simulate(walker, motion)
    with pytest.raises(package.ModelError, match="contradict"):
        package.load_model(urdf, free_base=True, fix_base=True)
    motion.save(tmp_path / "motion.csv")
    failed = diffnea(
        *("simulate", urdf, "--free-base", "--trajectory", "motion.csv", "-o", "out.csv"), cwd=tmp_path
    )
    assert failed.returncode == BAD_INPUT
    assert "--fix-base" in failed.stderr
    assert len(failed.stderr.strip().splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["motion.csv"]


def test_the_command_shows_and_exports_it(urdf: Path, tmp_path: Path) -> None:
    shown = done("info", urdf, "--free-base")
    assert "a free base and joints of 3 degrees of freedom, 4 links, 7.7 kg" in shown
    assert "trunk (floating)" in shown
    for name in ("walker.xml", "walker.json"):
        done("export", urdf, "--free-base", "-o", tmp_path / name)
        model = package.load_model(tmp_path / name)
        assert model.free_base == "trunk"
        q, qd, qdd = states()
        expected = package.load_model(urdf, free_base=True)
        np.testing.assert_allclose(
            package.rnea(model, q=q, qd=qd, qdd=qdd),
            package.rnea(expected, q=q, qd=qd, qdd=qdd),
            atol=ROUNDING,
        )
