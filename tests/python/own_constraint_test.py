"""Constraints written as Python functions: against the library's kinds, and what they refuse."""

import math
import pickle
from collections.abc import Callable

import numpy as np
import pytest

import diffnea

# Sums of some dozen products, in another order: of numbers of order 100.
ROUNDING = 1e-10


def point(X, p_B):
    return X[:3, :3] @ p_B + X[:3, 3]


def apart(X, p_AP, p_BQ):
    return point(X[1], p_BQ) - point(X[0], p_AP)


def rod(X, p_AP, p_BQ, length):
    delta = apart(X, p_AP, p_BQ)
    return delta @ delta - length**2


def hinge(X, X_AJ, X_BK):
    J, K = X[0] @ X_AJ, X[1] @ X_BK
    return [*(K - J)[:3, 3], J[:3, 0] @ K[:3, 2], J[:3, 1] @ K[:3, 2]]


def lowest(axle, radius):
    up = np.array([0, 0, 1]) - axle * axle[2]
    return up * (-radius / np.sqrt(1 - axle[2] ** 2))


def wheel_contact(X, p_BC, axle_B, radius):
    return point(X[0], p_BC)[2] + lowest(X[0, :3, :3] @ axle_B, radius)[2]


def rolling_wheel(X, V, p_BC, axle_B, radius):
    R, spin = X[0, :3, :3], V[0, :3]
    centre = R @ (V[0, 3:] + np.cross(spin, p_BC))
    return (centre + np.cross(R @ spin, lowest(R @ axle_B, radius)))[:2]


def skate(X, V, p_BP, across_B):
    return (V[0, 3:] + np.cross(V[0, :3], p_BP)) @ across_B


KINDS: dict[str, Callable] = {
    "rod": rod,
    "ball_joint": apart,
    "hinge": hinge,
    "wheel_contact": wheel_contact,
    "rolling_wheel": rolling_wheel,
    "skate": skate,
}
OF_TWO = ("rod", "ball_joint", "hinge")


def some_pose(rng: np.random.Generator) -> np.ndarray:
    out = np.eye(4)
    out[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    out[:3, 0] *= np.linalg.det(out[:3, :3])
    out[:3, 3] = rng.normal(size=3)
    return out


def some_parameters(kind: str, rng: np.random.Generator) -> dict:
    if kind == "hinge":
        return {"X_AJ": some_pose(rng), "X_BK": some_pose(rng)}
    if kind in OF_TWO:
        points = {"p_AP": rng.normal(size=3), "p_BQ": rng.normal(size=3)}
        return points | ({"length": 0.7} if kind == "rod" else {})
    direction = some_pose(rng)[:3, 0]
    if kind == "skate":
        return {"p_BP": rng.normal(size=3), "across_B": direction}
    return {"p_BC": rng.normal(size=3), "axle_B": direction, "radius": 0.3}


def some_motion(rng: np.random.Generator) -> dict:
    return {
        "pose": np.array([some_pose(rng), some_pose(rng)]),
        "twist": rng.normal(size=(2, 6)),
        "applied": rng.normal(size=(2, 6)),
        "kp": 30.0,
        "kd": 7.0,
    }


BODIES = [
    diffnea.FreeBody([2.0, 0.1, 0.0, -0.1, 0.05, 0.01, 0.0, 0.06, 0.01, 0.07]),
    diffnea.FreeBody([1.0, 0.0, 0.1, 0.0, 0.04, 0.0, 0.01, 0.03, 0.0, 0.04]),
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("bodies", [(0, 1), (None, 1), (1, None)])
def test_a_kind_written_as_a_function_is_the_kind(kind: str, bodies) -> None:
    """Accelerations, forces and all derivatives, of any state."""
    if kind not in OF_TWO:
        bodies = [1]
    rng = np.random.default_rng(3)
    parameters, motion = some_parameters(kind, rng), some_motion(rng)
    own, known = (
        diffnea.constrained_acceleration(
            BODIES,
            [diffnea.Constraint(of, bodies, "tie", **parameters)],
            derivatives=True,
            **motion,
        )
        for of in (KINDS[kind], kind)
    )
    for name in ("acceleration", "force", "multiplier", "residual"):
        np.testing.assert_allclose(getattr(own, name), getattr(known, name), atol=ROUNDING)
    for name in ("pose", "twist", "inertia"):
        of_own, of_known = (getattr(x.derivatives, name) for x in (own, known))
        scale = np.abs(of_known).max()
        np.testing.assert_allclose(of_own, of_known, atol=ROUNDING * (1 + scale))
    assert list(own.derivatives.parameters) == list(known.derivatives.parameters)
    for name, of_known in known.derivatives.parameters.items():
        scale = np.abs(of_known).max()
        np.testing.assert_allclose(
            own.derivatives.parameters[name], of_known, atol=ROUNDING * (1 + scale)
        )


def test_a_function_is_one_of_numbers_as_well() -> None:
    rng = np.random.default_rng(4)
    parameters, motion = some_parameters("hinge", rng), some_motion(rng)
    tie = diffnea.Constraint(hinge, (0, 1), **parameters)
    found = diffnea.constrained_acceleration(BODIES, [tie], **motion)
    expected = hinge(motion["pose"], **parameters)
    np.testing.assert_allclose(found.residual, np.array(expected), atol=ROUNDING)


def bead(g: Callable, x: float, **parameters) -> diffnea.ConstrainedMotion:
    """Return what holds a particle at (x, 0.4, 0.3)."""
    pose = np.eye(4)[None].copy()
    pose[0, :3, 3] = x, 0.4, 0.3
    tie = diffnea.Constraint(g, 0, "tie", **parameters)
    twist = [[0, 0, 0, 0.8, 0.3, -0.2]]
    return diffnea.constrained_acceleration(
        [diffnea.FreeBody.particle(0.1)], [tie], pose=pose, twist=twist, derivatives=True
    )


FUNCTIONS: list[Callable] = [
    lambda x, y: np.sin(x) * np.cos(y) + np.tan(x * y),
    lambda x, y: np.exp(-x) + np.log(x + 2 * y),
    lambda x, y: np.sqrt(x) + x**3 - x**-2 + y**0.3 + 2**x,
    lambda x, y: np.arcsin(x) + np.arccos(y * x) + np.arctan(x / y),
    lambda x, y: np.arctan2(y, x) + np.arctan2(1.0, x) + np.hypot(x, 0.5),
    lambda x, y: np.linalg.norm([x, y, 1.0]) + np.square(x) + np.float64(3) * y - (+x) * (-y),
]


@pytest.mark.parametrize("f", FUNCTIONS)
def test_functions_of_numpy_have_their_derivatives(f: Callable) -> None:
    """Twice along the motion, against differences of the same function of numbers."""

    def g(X, shift):
        return f(X[0, 0, 3] + shift, X[0, 1, 3])

    found = bead(g, 0.5, shift=0.1)
    v = np.array([0.8, 0.3])

    def along(t: float) -> float:
        return float(f(0.6 + v[0] * t, 0.4 + v[1] * t))

    assert found.residual[0] == pytest.approx(along(0.0), abs=ROUNDING)
    # Central differences: h² of them are 1e-8, rounding over h² 1e-8.
    h, tolerance = 1e-4, 1e-5
    step = np.eye(2) * h
    at = np.array([0.6, 0.4])
    J = np.array([f(*(at + s)) - f(*(at - s)) for s in step]) / (2 * h)
    gamma = (along(h) - 2 * along(0.0) + along(-h)) / h**2
    # g̈ = J a + γ = 0, of a free acceleration (0, 0).
    a = -J * gamma / (J @ J)
    np.testing.assert_allclose(found.acceleration[0, 3:5], a, atol=tolerance * (1 + abs(gamma)))


def test_an_upper_bound_pulls_alone() -> None:
    def within(X, radius):
        return X[0, :3, 3] @ X[0, :3, 3] - radius**2

    ball = [diffnea.FreeBody.particle(0.1)]
    pose = np.eye(4)[None].copy()
    pose[0, 2, 3] = -0.4
    taut = diffnea.Constraint(within, 0, relation="at_most", radius=0.4)
    slack = diffnea.Constraint(within, 0, relation="at_most", radius=0.5)
    assert diffnea.constrained_acceleration(ball, [taut], pose=pose).active.tolist() == [True]
    assert diffnea.constrained_acceleration(ball, [slack], pose=pose).active.tolist() == [False]
    twist = [[0, 0, 0, 1.0, 0, -2.0]]
    after = diffnea.after_impact(ball, [taut], pose=pose, twist=twist)
    np.testing.assert_allclose(after, [[0, 0, 0, 1, 0, 0]], atol=ROUNDING)


def test_python_runs_once() -> None:
    calls = []

    def on_floor(X, height=0.0):
        calls.append(height)
        return X[0, 2, 3] - height

    tie = diffnea.Constraint(on_floor, 0)
    assert tie.parameters == {"height": 0.0}
    ball = [diffnea.FreeBody.particle(0.1)]
    for _ in range(3):
        diffnea.constrained_acceleration(ball, [tie], pose=np.eye(4)[None], derivatives=True)
    assert len(calls) == 1
    again = pickle.loads(pickle.dumps(tie))
    assert (again.kind, again.name, again.bodies) == ("on_floor", "on_floor", (0,))
    found = diffnea.constrained_acceleration(ball, [again], pose=np.eye(4)[None])
    np.testing.assert_allclose(found.force[0, 3:], [0, 0, 0.981])
    assert repr(tie) == "Constraint('on_floor', (0,), name='on_floor')"


def test_what_cannot_be_traced_is_refused() -> None:
    def branches(X):
        return X[0, 2, 3] if X[0, 0, 3] > 0 else X[0, 1, 3]

    with pytest.raises(diffnea.Error, match=r"a comparison .* symbols.*each case as a constraint"):
        diffnea.Constraint(branches, 0)
    for g in (
        lambda X: np.maximum(X[0, 2, 3], 0.0),
        lambda X: np.where(X[0, 2, 3] == 0, X[0, 0, 3], 1.0),
        lambda X: X[0, 2, 3] and 1.0,
    ):
        with pytest.raises(diffnea.Error, match="a comparison of a pose"):
            diffnea.Constraint(g, 0)
    with pytest.raises(diffnea.Error, match=r"absolute value .* no derivative at 0"):
        diffnea.Constraint(lambda X: abs(X[0, 2, 3]), 0)
    with pytest.raises(diffnea.Error, match=r"np\.sin, not math\.sin"):
        diffnea.Constraint(lambda X: math.sin(X[0, 2, 3]), 0)
    with pytest.raises(diffnea.Error, match="cannot be traced"):
        diffnea.Constraint(lambda X: np.floor(X[0, 2, 3]), 0)


def test_a_state_without_a_value_or_a_derivative_is_refused() -> None:
    with pytest.raises(diffnea.ModelError, match="constraint 'tie' has no value at these poses"):
        bead(lambda X: np.log(X[0, 0, 3]), -1.0)
    with pytest.raises(diffnea.ModelError, match="constraint 'tie' has no derivative at these"):
        bead(lambda X: np.sqrt(X[0, 0, 3] ** 2), 0.0)


def test_mistakes_are_named() -> None:
    def g(X, height):
        return X[0, 2, 3] - height

    with pytest.raises(diffnea.Error, match=r"'g': missing a required argument: 'height'"):
        diffnea.Constraint(g, 0)
    with pytest.raises(diffnea.Error, match=r"unexpected keyword argument 'hight'"):
        diffnea.Constraint(g, 0, height=1.0, hight=2.0)
    with pytest.raises(diffnea.Error, match="could not convert string"):
        diffnea.Constraint(g, 0, height="tall")
    with pytest.raises(diffnea.Error, match="'none': got None from the function"):
        diffnea.Constraint(lambda X: None, 0, "none")
    with pytest.raises(diffnea.Error, match="row 1 of g does not depend on X"):
        diffnea.Constraint(lambda X, a: [X[0, 2, 3], a], 0, a=1.0)
    with pytest.raises(diffnea.Error, match="row 0 of g does not depend on V"):
        diffnea.Constraint(lambda X, V: X[0, 2, 3], 0)
    with pytest.raises(diffnea.Error, match="does not depend on X"):
        diffnea.Constraint(lambda X: X[0, 2, 3], (None, 0))
    with pytest.raises(diffnea.ShapeError, match="got 3 besides the world, expected 1 or 2"):
        diffnea.Constraint(lambda X: X[2, 2, 3], (0, 1, 2))
    with pytest.raises(diffnea.Error, match="got 'less'; choices: equal, at_most"):
        diffnea.Constraint(g, 0, relation="less", height=1.0)
    with pytest.raises(diffnea.Error, match="which a function alone takes"):
        diffnea.Constraint("rod", (None, 0), relation="at_most")
    with pytest.raises(diffnea.ModelError, match="frame: its rotation is none"):
        diffnea.Constraint(lambda X, frame: (X[0] @ frame)[2, 3], 0, frame=2 * np.eye(4))
