"""A four-bar linkage from MJCF: read, explained, exported, and its dynamics from Python."""

import json
from pathlib import Path

import numpy as np
import pytest
from cli import done

import diffnea as package

BAR = (
    '<body name="{name}" pos="{pos} 0 0"><inertial pos=".1 .01 .02" mass="1.3" '
    'diaginertia=".01 .02 .03"/><joint name="j_{name}" axis="0 1 0"/>{rest}</body>'
)
HOME = (-1.1, 0.6, 1.4)


def four_bar(tmp_path: Path) -> Path:
    """Write a crank, a coupler and a rocker whose tip is pinned to the ground."""
    rocker = BAR.format(name="rocker", pos=".8", rest='<site name="tip" pos=".6 0 0"/>')
    coupler = BAR.format(name="coupler", pos=".3", rest=rocker)
    path = tmp_path / "four_bar.xml"
    path.write_text(
        '<mujoco model="four_bar"><compiler angle="radian"/><worldbody>'
        '<site name="ground" pos=".9 0 0"/>'
        + BAR.format(name="crank", pos="0", rest=coupler)
        + '</worldbody><equality><connect name="pin" site1="tip" site2="ground"/></equality>'
        '<actuator><motor joint="j_crank"/></actuator>'
        f'<keyframe><key name="home" qpos="{HOME[0]} {HOME[1]} {HOME[2]}"/></keyframe></mujoco>'
    )
    return path


def tips(model: package.Model, q: np.ndarray) -> np.ndarray:
    return package.frame_pose(model, "tip", q=q)[..., :3, 3]


def test_positions_close_the_loop_and_driven_joints_stay(tmp_path: Path) -> None:
    """The tip is at its pin, whatever the crank's angle."""
    model = package.load_model(four_bar(tmp_path))
    assert model.constraints == ["pin"]
    crank = np.linspace(-1.1, -0.6, 7)
    start = np.tile(HOME, (7, 1))
    start[:, 0] = crank
    q = package.project_positions(model, q=start, held=["j_crank"])
    np.testing.assert_array_equal(q[:, 0], crank)
    np.testing.assert_allclose(tips(model, q), np.tile([0.9, 0, 0], (7, 1)), atol=1e-9)
    # One state at a time gives the same.
    np.testing.assert_array_equal(
        package.project_positions(model, q=start[3], held=["j_crank"]), q[3]
    )


def test_accelerations_are_those_of_the_bodies_in_maximal_coordinates(tmp_path: Path) -> None:
    """The same links as free bodies on hinges and a ball joint."""
    model = package.load_model(four_bar(tmp_path))
    rng = np.random.default_rng(2)
    q = package.project_positions(model, q=np.array(HOME))
    qd = package.project_velocities(model, q=q, qd=rng.normal(size=3))
    tau = rng.normal(size=3)
    found = package.constrained_forward_dynamics(model, q=q, qd=qd, tau=tau)
    assert found.rows == ["pin"] * 3
    np.testing.assert_allclose(found.residual, 0, atol=1e-11)
    J = package.constraint_jacobian(model, q=q)
    np.testing.assert_allclose(J @ qd, 0, atol=1e-12)
    np.testing.assert_allclose(-J.T @ found.multiplier, found.force, atol=1e-10)

    names = ["crank", "coupler", "rocker"]
    zero = np.zeros(3)
    motion = [package.frame_motion(model, name, q=q, qd=qd, qdd=zero) for name in names]
    pose = np.array([m.pose for m in motion])
    turn = pose[:, :3, :3]
    twist = np.hstack(
        [
            np.einsum("bji,bj->bi", turn, [m.angular_velocity for m in motion]),
            np.einsum("bji,bj->bi", turn, [m.velocity for m in motion]),
        ]
    )
    about_y = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    constraints, applied = [], np.zeros((3, 6))
    for i, x in enumerate([0, 0.3, 0.8]):
        parent = about_y.copy()
        parent[0, 3] = x
        constraints.append(
            package.Constraint(
                "hinge", (i - 1 if i else None, i), f"joint{i}", X_AJ=parent, X_BK=about_y
            )
        )
        applied[i, 1] += tau[i]
        if i:
            applied[i - 1, 1] -= tau[i]
    constraints.append(
        package.Constraint("ball_joint", (None, 2), p_AP=[0.9, 0, 0], p_BQ=[0.6, 0, 0])
    )
    bodies = [
        package.FreeBody(model.inertial_parameters[10 * i : 10 * (i + 1)]) for i in range(3)
    ]
    free = package.constrained_acceleration(
        bodies, constraints, pose=pose, twist=twist, applied=applied
    )
    # Joint accelerations about y are differences of the bodies' angular accelerations.
    np.testing.assert_allclose(
        np.diff(free.acceleration[:, 1], prepend=0.0), found.qdd, rtol=1e-9, atol=1e-9
    )


def test_a_batch_is_its_rows_and_accelerations_project_to_themselves(tmp_path: Path) -> None:
    """(T, n) in, (T, n) out; J q̈ + γ = 0 already holds."""
    model = package.load_model(four_bar(tmp_path))
    rng = np.random.default_rng(3)
    q = package.project_positions(model, q=HOME + 0.1 * rng.normal(size=(5, 3)))
    qd = package.project_velocities(model, q=q, qd=rng.normal(size=(5, 3)))
    tau = rng.normal(size=(5, 3))
    found = package.constrained_forward_dynamics(model, q=q, qd=qd, tau=tau)
    assert found.qdd.shape == found.force.shape == (5, 3)
    assert found.multiplier.shape == found.residual.shape == (5, 3)
    one = package.constrained_forward_dynamics(model, q=q[4], qd=qd[4], tau=tau[4])
    np.testing.assert_array_equal(one.qdd, found.qdd[4])
    np.testing.assert_allclose(
        package.project_accelerations(model, q=q, qd=qd, qdd=found.qdd), found.qdd, atol=1e-9
    )
    # The tree's inverse dynamics return the torques, with those of the constraint.
    np.testing.assert_allclose(
        package.rnea(model, q=q, qd=qd, qdd=found.qdd), tau + found.force, atol=1e-9
    )


def test_refusals(tmp_path: Path) -> None:
    """Open-chain dynamics are refused, and so is a posture that nothing closes."""
    path = four_bar(tmp_path)
    model = package.load_model(path)
    zero = np.zeros(3)
    with pytest.raises(package.ModelError, match="constrained_forward_dynamics takes them"):
        package.aba(model, q=zero, qd=zero, tau=zero)
    # With the crank and the coupler held the tip cannot reach its pin.
    with pytest.raises(package.DataError, match="row 0: no posture near it"):
        package.project_positions(model, q=np.array([HOME]), held=["j_crank", "j_coupler"])
    with pytest.raises(package.ModelError, match="j_crank"):
        package.project_positions(model, q=zero, held=["no such joint"])


def test_info_and_export(tmp_path: Path) -> None:
    """`info` lists the loop; MJCF and JSON keep it; a URDF lists it as lost."""
    path = four_bar(tmp_path)
    info = json.loads(done("info", path, "--json"))["constraints"]
    assert info["dofs_left"] == 1
    assert info["closes"]
    assert info["list"][0]["name"] == "pin"
    assert 0.0 < info["list"][0]["apart"] < 1.0
    for name in ("out.json", "out.xml"):
        done("export", path, "-o", tmp_path / name)
        again = package.load_model(tmp_path / name)
        assert again.constraints == ["pin"]
        q = package.project_positions(again, q=np.array(HOME))
        np.testing.assert_allclose(tips(again, q), [0.9, 0, 0], atol=1e-9)
    lost = package.load_model(path).save(tmp_path / "out.urdf")
    assert any("constraint 'pin'" in line for line in lost)


def test_torques_of_the_drive_are_those_that_moved_it(tmp_path: Path) -> None:
    """Forward with the crank's torque alone, then back, by torques and by regressor."""
    model = package.load_model(four_bar(tmp_path))
    rng = np.random.default_rng(4)
    q = package.project_positions(model, q=HOME + 0.1 * rng.normal(size=(6, 3)))
    qd = package.project_velocities(model, q=q, qd=rng.normal(size=(6, 3)))
    tau = np.zeros((6, 3))
    tau[:, 0] = rng.normal(size=6)
    qdd = package.constrained_forward_dynamics(model, q=q, qd=qd, tau=tau).qdd
    found = package.driven_torques(model, q=q, qd=qd, qdd=qdd, driven=["j_crank"])
    np.testing.assert_allclose(found, tau[:, :1], atol=1e-9)
    Y = package.driven_regressor(model, q=q, qd=qd, qdd=qdd, driven=["j_crank"])
    assert Y.shape == (6, 1, 30)
    np.testing.assert_allclose(Y @ model.inertial_parameters, found, atol=1e-9)
    with pytest.raises(package.DataError, match="row 0: the driven joints do not hold"):
        package.driven_torques(model, q=q, qd=qd, qdd=qdd, driven=[])
