"""Bodies in maximal coordinates under constraints, against closed forms and differences."""

import pickle

import numpy as np
import pytest

import diffnea

G = 9.81
# Sums of a few products of order 10.
ROUNDING = 1e-10
INERTIA = [2.0, 0.0, 0.0, 0.0, 0.03, 0.0, 0.0, 0.04, 0.0, 0.05]


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    out = np.eye(4)
    out[:3, 3] = x, y, z
    return out


def string(**changes) -> diffnea.Constraint:
    parameters = {"p_AP": [0, 0, 0], "p_BQ": [0, 0, 0], "length": 0.4} | changes
    return diffnea.Constraint("string", (None, 0), **parameters)


def test_a_ball_on_a_string_swings_as_the_pendulum_it_is() -> None:
    angle, rate, mass, length = 0.7, 2.0, 0.05, 0.4
    down = np.array([np.sin(angle), 0, -np.cos(angle)])
    across = np.array([np.cos(angle), 0, np.sin(angle)])
    twist = np.zeros((1, 6))
    twist[0, 3:] = rate * length * across
    found = diffnea.constrained_acceleration(
        [diffnea.FreeBody.particle(mass)], [string()], pose=[pose(*(length * down))], twist=twist
    )
    acceleration = found.acceleration[0, 3:]
    assert acceleration @ across == pytest.approx(-G * np.sin(angle), abs=ROUNDING)
    assert acceleration @ down == pytest.approx(-(rate**2) * length, abs=ROUNDING)
    tension = mass * (G * np.cos(angle) + rate**2 * length)
    np.testing.assert_allclose(found.force[0, 3:], -tension * down, atol=ROUNDING)
    assert found.rows == ["string"]
    assert found.active.tolist() == [True]
    assert found.redundant.tolist() == [False]
    assert found.derivatives is None


def test_a_slack_string_does_nothing() -> None:
    found = diffnea.constrained_acceleration(
        [diffnea.FreeBody.particle(0.05)], [string()], pose=[pose(z=-0.2)]
    )
    np.testing.assert_allclose(found.acceleration, [[0, 0, 0, 0, 0, -G]])
    assert found.active.tolist() == [False]
    assert found.residual[0] == pytest.approx(0.2**2 - 0.4**2)


def test_a_second_hinge_along_the_same_axis_is_redundant() -> None:
    upper = pose(z=0.8)
    hinges = [
        diffnea.Constraint("hinge", (None, 0), "lower", X_AJ=np.eye(4), X_BK=np.eye(4)),
        diffnea.Constraint("hinge", (None, 0), "upper", X_AJ=upper, X_BK=upper),
    ]
    applied = [[0, 0, 0.3, 1, 0, 0]]
    found = diffnea.constrained_acceleration(
        [diffnea.FreeBody(INERTIA)], hinges, pose=[np.eye(4)], applied=applied
    )
    assert found.acceleration[0, 2] == pytest.approx(0.3 / 0.05)
    assert found.redundant.sum() == 5
    assert found.rows == ["lower"] * 5 + ["upper"] * 5


def test_constraints_that_contradict_each_other_are_named() -> None:
    beside = pose(x=0.5)
    hinges = [
        diffnea.Constraint("hinge", (None, 0), "door", X_AJ=np.eye(4), X_BK=np.eye(4)),
        diffnea.Constraint("hinge", (None, 0), "beside", X_AJ=beside, X_BK=beside),
        diffnea.Constraint("rod", (None, 1), "other", p_AP=[0, 0, 1], p_BQ=[0, 0, 0], length=1),
    ]
    twist = np.zeros((2, 6))
    twist[0, 2] = 0.7
    bodies = [diffnea.FreeBody(INERTIA), diffnea.FreeBody.particle(1.0)]
    with pytest.raises(ValueError, match="contradicts") as error:
        diffnea.constrained_acceleration(bodies, hinges, pose=[np.eye(4)] * 2, twist=twist)
    assert "agree without 'door' or 'beside'" in str(error.value)
    assert isinstance(error.value, diffnea.ModelError)


def test_derivatives_are_central_differences() -> None:
    bodies = [diffnea.FreeBody(INERTIA), diffnea.FreeBody.particle(0.3)]
    poses = [pose(0.1, 0.2, 0.3), pose(0.4, 0.1, -0.2)]
    twist = np.array([[0.3, 0.4, -0.2, 1, 0.5, -0.6], [0, 0, 0, 0.2, 0.1, 0.3]])

    def motion(length=0.9, x=0.2, twist=twist, mass=2.0, shift=0.0, **options):
        moved = [poses[0] @ pose(shift), poses[1]]
        ties = [
            diffnea.Constraint("rod", (0, 1), p_AP=[x, -0.1, 0.1], p_BQ=[0, 0, 0], length=length),
            diffnea.Constraint("ball_joint", (None, 0), p_AP=[0.3, 0.1, 0], p_BQ=[0, 0.2, 0.2]),
        ]
        free = [diffnea.FreeBody([mass, *INERTIA[1:]]), bodies[1]]
        return diffnea.constrained_acceleration(
            free, ties, pose=moved, twist=twist, kp=100, kd=20, **options
        )

    found = motion(derivatives=True).derivatives
    assert found is not None
    step = 1e-6
    # Accelerations of order 1e2: rounding leaves 1e-8.
    tolerance = {"atol": 1e-5, "rtol": 1e-5}

    def slope(**of):
        ((name, value),) = of.items()
        more, less = (motion(**{name: value + s}).acceleration for s in (step, -step))
        return (more - less) / (2 * step)

    np.testing.assert_allclose(
        found.parameters["rod.length"][..., 0], slope(length=0.9), **tolerance
    )
    np.testing.assert_allclose(found.parameters["rod.p_AP"][..., 0], slope(x=0.2), **tolerance)
    np.testing.assert_allclose(found.inertia[:, :, 0, 0], slope(mass=2.0), **tolerance)
    np.testing.assert_allclose(found.pose[:, :, 0, 3], slope(shift=0.0), **tolerance)
    unit = np.zeros((2, 6))
    unit[0, 1] = step
    difference = motion(twist=twist + unit).acceleration - motion(twist=twist - unit).acceleration
    np.testing.assert_allclose(found.twist[:, :, 0, 1], difference / (2 * step), **tolerance)
    assert found.parameters["ball_joint.p_BQ"].shape == (2, 6, 3)


def test_a_driven_pivot_takes_its_acceleration_from_the_caller() -> None:
    bodies = [diffnea.FreeBody.prescribed(), diffnea.FreeBody.particle(0.1)]
    tie = diffnea.Constraint("string", (0, 1), p_AP=[0, 0, 0], p_BQ=[0, 0, 0], length=0.5)
    up = [[0, 0, 0, 0, 0, 3.0], [0] * 6]
    found = diffnea.constrained_acceleration(
        bodies, [tie], pose=[pose(), pose(z=-0.5)], prescribed=up
    )
    np.testing.assert_allclose(found.acceleration[:, 5], [3.0, 3.0])
    assert found.force[1, 5] == pytest.approx(0.1 * (G + 3.0))


def test_a_string_that_becomes_taut_takes_the_velocity_along_it() -> None:
    ball = [diffnea.FreeBody.particle(0.05)]
    twist = [[0, 0, 0, 1.0, 0, -2.0]]
    dead = diffnea.after_impact(ball, [string()], pose=[pose(z=-0.4)], twist=twist)
    np.testing.assert_allclose(dead, [[0, 0, 0, 1, 0, 0]], atol=ROUNDING)
    half = diffnea.after_impact(ball, [string()], pose=[pose(z=-0.4)], twist=twist, restitution=0.5)
    np.testing.assert_allclose(half, [[0, 0, 0, 1, 0, 1]], atol=ROUNDING)


def test_a_wheel_rolls_and_a_skate_glides() -> None:
    wheel = {"p_BC": [0, 0, 0], "axle_B": [0, 1, 0], "radius": 0.3}
    ties = [
        diffnea.Constraint("wheel_contact", 0, **wheel),
        diffnea.Constraint("rolling_wheel", [0], **wheel),
    ]
    pushed = diffnea.constrained_acceleration(
        [diffnea.FreeBody(INERTIA)], ties, pose=[pose(z=0.3)], applied=[[0, 0, 0, 1, 0, 0]]
    ).acceleration[0]
    assert pushed[3] == pytest.approx(1 / (2.0 + 0.04 / 0.3**2))
    assert pushed[1] == pytest.approx(pushed[3] / 0.3)
    skate = diffnea.Constraint("skate", 0, p_BP=[0, 0, 0], across_B=[0, 1, 0])
    glides = diffnea.constrained_acceleration(
        [diffnea.FreeBody(INERTIA)],
        [skate],
        pose=[pose()],
        applied=[[0, 0, 0, 1, 5, 0]],
        gravity=[0, 0, 0],
    )
    np.testing.assert_allclose(glides.acceleration[0, 3:], [0.5, 0, 0], atol=ROUNDING)


def test_mistakes_are_named() -> None:
    with pytest.raises(ValueError, match=r"got 'rope'; choices: ball_joint, hinge, rod"):
        diffnea.Constraint("rope", (None, 0))
    with pytest.raises(ValueError, match="length is missing; parameters: p_AP, p_BQ, length"):
        diffnea.Constraint("rod", (None, 0), p_AP=[0, 0, 0], p_BQ=[0, 0, 0])
    with pytest.raises(ValueError, match="got parameter 'lenght'"):
        string(lenght=1.0)
    with pytest.raises(ValueError, match="expected more than 0"):
        string(length=0.0)
    with pytest.raises(ValueError, match="bodies: got 1, expected 2"):
        diffnea.Constraint("ball_joint", 0, p_AP=[0, 0, 0], p_BQ=[0, 0, 0])
    with pytest.raises(ValueError, match="expected a unit vector"):
        diffnea.Constraint("skate", 0, p_BP=[0, 0, 0], across_B=[0, 2, 0])
    with pytest.raises(ValueError, match="names body 0"):
        diffnea.constrained_acceleration([], [string()], pose=np.zeros((0, 4, 4)))
    ball = [diffnea.FreeBody.particle(0.1)]
    with pytest.raises(ValueError, match=r"pose: got shape \(4, 4\), expected \(1, 4, 4\)"):
        diffnea.constrained_acceleration(ball, [string()], pose=np.eye(4))
    with pytest.raises(ValueError, match="its rotation is none"):
        diffnea.constrained_acceleration(ball, [string()], pose=[2 * np.eye(4)])
    with pytest.raises(ValueError, match="two constraints are called 'string'"):
        diffnea.constrained_acceleration(ball, [string(), string()], pose=[np.eye(4)])
    with pytest.raises(ValueError, match="mass of 0"):
        diffnea.FreeBody([0.0] * 10)


def test_values_survive_pickling_and_say_what_they_are() -> None:
    tie = string()
    again = pickle.loads(pickle.dumps(tie))
    assert (again.kind, again.name, again.bodies) == ("string", "string", (None, 0))
    assert again.parameters["length"] == 0.4
    assert repr(tie) == "Constraint('string', (None, 0), name='string')"
    body = pickle.loads(pickle.dumps(diffnea.FreeBody(INERTIA)))
    np.testing.assert_array_equal(body.inertia, INERTIA)
    assert body.kind == "rigid"
    assert repr(diffnea.FreeBody.particle(0.5)) == "FreeBody(particle, mass=0.5)"
    found = diffnea.constrained_acceleration([body], [tie], pose=[pose(z=-0.4)], derivatives=True)
    back = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(back.acceleration, found.acceleration)
    np.testing.assert_array_equal(back.derivatives.twist, found.derivatives.twist)
    assert "acceleration=array(1, 6)" in repr(found)
