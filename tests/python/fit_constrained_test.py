"""The constrained loss from Python. Motions are integrated from equations written out here."""

import pickle
import signal
from collections.abc import Callable
from time import monotonic

import numpy as np
import pytest

import diffnea

G = np.array([0.0, 0.0, -9.81])
RATE = 200.0  # [Hz]
PLACE_NOISE, TURN_NOISE = 1e-3, 5e-3  # [m, rad]


def integrated(rates: Callable, start: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times and states by Runge-Kutta's method, ten steps a row."""
    h = 1.0 / (10 * RATE)
    x, states = np.array(start, dtype=float), []
    for k in range(round(10 * RATE * seconds)):
        if k % 10 == 0:
            states.append(x)
        t = k * h
        a = rates(t, x)
        b = rates(t + h / 2, x + h / 2 * a)
        c = rates(t + h / 2, x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + rates(t + h, x + h * c))
    return np.arange(len(states)) / RATE, np.array(states)


def turned(w: np.ndarray) -> np.ndarray:
    """Return exp of rotation vectors, (N, 3) to (N, 3, 3)."""
    angle = np.linalg.norm(w, axis=-1, keepdims=True)[..., None] + 1e-30
    K = np.zeros((*w.shape, 3))
    K[:, 2, 1], K[:, 0, 2], K[:, 1, 0] = w.T
    K -= np.swapaxes(K, 1, 2)
    return np.eye(3) + np.sin(angle) / angle * K + (1 - np.cos(angle)) / angle**2 * K @ K


def seen(R: np.ndarray, p: np.ndarray, seed: int, turn: float = TURN_NOISE) -> np.ndarray:
    """Return poses of one body as a camera sees them, (N, 1, 4, 4)."""
    rng = np.random.default_rng(seed)
    out = np.tile(np.eye(4), (len(p), 1, 1, 1))
    out[:, 0, :3, :3] = R @ turned(turn * rng.normal(size=p.shape))
    out[:, 0, :3, 3] = p + PLACE_NOISE * rng.normal(size=p.shape)
    return out


PIVOT, LENGTH = np.array([0.3, -0.2, 1.1]), 0.6


def pendulum(seed: int, seconds: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    """Return times and poses of a particle on a rod: p̈ = g − p (v·v + g·p)/r²."""

    def rates(_: float, x: np.ndarray) -> np.ndarray:
        p, v = x[:3], x[3:]
        return np.concatenate([v, G - p * (v @ v + G @ p) / LENGTH**2])

    start = [LENGTH * np.sin(0.9), 0, -LENGTH * np.cos(0.9), 0, 1.2, 0]
    time, x = integrated(rates, np.array(start), seconds)
    return time, seen(np.eye(3), PIVOT + x[:, :3], seed, turn=0.0)


def on_rod(X, pivot, length):
    delta = X[0, :3, 3] - pivot
    return delta @ delta - length**2


BALL = [diffnea.FreeBody.particle(0.2)]


def test_a_pendulum_s_rod_and_pivot() -> None:
    """Written as a function, and the library's kind, which is the same."""
    time, pose = pendulum(seed=0)
    guess = {"pivot": [0.2, 0.0, 1.0], "length": 0.8}
    rod = diffnea.Constraint(on_rod, 0, "rod", **guess)
    fit = diffnea.fit_constrained(BALL, [rod], ["rod"], time=time, pose=pose)
    assert fit.converged
    assert [p.name for p in fit.parameters] == [
        *(f"rod.pivot[{k}]" for k in range(3)),
        "rod.length",
    ]
    found = np.array([p.value for p in fit.parameters])
    std = np.array([p.std for p in fit.parameters])
    assert (np.abs(found - [*PIVOT, LENGTH]) < 4 * std).all()
    assert (std < 2e-3).all()
    np.testing.assert_allclose(std, np.sqrt(np.diag(fit.covariance)))
    assert fit.parameters["rod.length"].prior == 0.8
    assert 0.5 < fit.errors[0].over_noise < 1.5
    np.testing.assert_array_equal(fit.constraints[0].parameters["pivot"], found[:3])

    kind = diffnea.Constraint(
        "rod", (None, 0), p_AP=guess["pivot"], p_BQ=[0, 0, 0], length=guess["length"]
    )
    free = ["rod.p_AP", "rod.length"]
    known = diffnea.fit_constrained(BALL, [kind], free, time=time, pose=pose)
    # Both end where a step gains less than 1e-8 of the cost.
    np.testing.assert_allclose([p.value for p in known.parameters], found, atol=1e-6)
    assert known.parameters["rod.length"].unit == "m"

    text = repr(fit)
    assert text.startswith("ConstrainedFit: converged after ")
    assert "rod.length" in text
    assert "±" in text
    again = pickle.loads(pickle.dumps(fit))
    np.testing.assert_array_equal(again.covariance, fit.covariance)
    assert again.constraints[0].parameters["length"] == found[3]
    assert fit.to_dict()["parameters"][3]["value"] == found[3]


def test_what_a_motion_does_not_tell_is_said() -> None:
    """The mass of a particle that weight alone moves."""
    time, pose = pendulum(seed=1)
    rod = diffnea.Constraint(on_rod, 0, pivot=PIVOT, length=LENGTH)
    fit = diffnea.fit_constrained(
        BALL, [rod], ["bodies[0].mass", "on_rod.length"], time=time, pose=pose
    )
    mass = fit.parameters["bodies[0].mass"]
    assert not mass.identifiable
    assert np.isnan(mass.std)
    assert np.isinf(fit.covariance[0, 0])
    assert fit.parameters["on_rod.length"].identifiable
    assert "not told by this motion" in repr(fit)


MASS, BEHIND, IZZ = 1.5, 0.12, 0.06


def test_a_sleigh_s_blade_and_inertia_are_inside_their_intervals() -> None:
    """Chaplygin's sleigh, its constraint of velocities a Python function; a torque turns it."""

    def torque(t):
        return 0.5 * np.cos(3 * t)

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        heading, spin, speed = x[:3]
        return np.array(
            [
                spin,
                (torque(t) - MASS * BEHIND * speed * spin) / (IZZ + MASS * BEHIND**2),
                BEHIND * spin**2,
                speed * np.cos(heading),
                speed * np.sin(heading),
            ]
        )

    def blade(X, V, behind):
        return V[0, 4] - behind * V[0, 2]

    time, x = integrated(rates, np.array([0.3, 0.0, 0.8, 0.0, 0.0]), 6.0)
    none = np.zeros(len(x))
    R = turned(np.stack([none, none, x[:, 0]], axis=1))
    along = np.stack([np.cos(x[:, 0]), np.sin(x[:, 0]), none], axis=1)
    place = np.stack([x[:, 3], x[:, 4], none], axis=1) + BEHIND * along
    applied = np.zeros((len(x), 1, 6))
    applied[:, 0, 2] = torque(time)

    body = diffnea.FreeBody([MASS, 0, 0, 0, 0.1, 0, 0, 0.1, 0, 0.1])
    deviations = []
    for seed in range(6):
        fit = diffnea.fit_constrained(
            [body],
            [diffnea.Constraint(blade, 0, behind=0.0)],
            ["blade.behind", "bodies[0].inertia.Izz"],
            time=time,
            pose=seen(R, place, seed),
            applied=applied,
            gravity=[0, 0, 0],
        )
        assert fit.converged
        for name, truth in (("blade.behind", BEHIND), ("bodies[0].inertia.Izz", IZZ)):
            p = fit.parameters[name]
            assert p.std < 5e-3
            deviations.append((p.value - truth) / p.std)
    # Twelve normal ones: one is beyond 3.5 in 200 tests, and four are beyond 1.96 as often.
    assert np.max(np.abs(deviations)) < 3.5
    assert np.sum(np.abs(deviations) < 1.96) >= 9


def test_a_rigid_body_s_centre_and_inertia_remain_possible() -> None:
    """A top on a ball joint, driven by known torques: I ω̇ = τ + c × m g − ω × I ω."""
    mass, com = 1.2, np.array([0.05, -0.02, -0.1])
    about_com = np.array([[0.010, 0.001, 0], [0.001, 0.014, -0.002], [0, -0.002, 0.008]])
    about_joint = about_com + mass * (com @ com * np.eye(3) - np.outer(com, com))
    inverse = np.linalg.inv(about_joint)

    def torque(t):
        return np.stack([0.4 * np.sin(3 * t), 0.3 * np.cos(2 * t), 0.2 * np.sin(5 * t)], axis=-1)

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        R, w = x[:9].reshape(3, 3), x[9:]
        K = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        moment = torque(t) + np.cross(com, mass * R.T @ G) - np.cross(w, about_joint @ w)
        return np.concatenate([(R @ K).ravel(), inverse @ moment])

    time, x = integrated(rates, np.array([*np.eye(3).ravel(), 1.0, 0.5, 1.0]), 4.0)
    applied = np.zeros((len(x), 1, 6))
    applied[:, 0, :3] = torque(time)
    R = x[:, :9].reshape(-1, 3, 3)
    guess = diffnea.FreeBody([mass, 0, 0, -0.06, 0.03, 0, 0, 0.03, 0, 0.02])
    joint = diffnea.Constraint("ball_joint", (None, 0), p_AP=[0, 0, 0], p_BQ=[0, 0, 0])
    fit = diffnea.fit_constrained(
        [guess],
        [joint],
        ["bodies[0].com", "bodies[0].inertia"],
        time=time,
        pose=seen(R, np.zeros((len(x), 3)), seed=0, turn=1e-3),
        applied=applied,
    )
    assert fit.converged
    values = {p.name.removeprefix("bodies[0]."): p.value for p in fit.parameters}
    found = [values[f"com[{k}]"] for k in range(3)]
    np.testing.assert_allclose(found, com, atol=2e-3)  # [m]
    upper = ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
    inertia = np.array([values[f"inertia.{name}"] for name in upper])
    np.testing.assert_allclose(inertia, about_com[np.triu_indices(3)], atol=1e-3)  # [kg·m²]
    # The body that comes back is the one whose numbers are listed.
    theta = fit.bodies[0].inertia
    np.testing.assert_allclose(theta[1:4] / theta[0], found)
    c = np.array(found)
    J = np.zeros((3, 3))
    J[np.triu_indices(3)] = (
        theta[4:] - (theta[0] * (c @ c * np.eye(3) - np.outer(c, c)))[np.triu_indices(3)]
    )
    np.testing.assert_allclose(J[np.triu_indices(3)], inertia, atol=1e-12)
    principal = np.linalg.eigvalsh(J + np.triu(J, 1).T)
    assert principal[2] < principal[0] + principal[1]


def test_a_pose_is_found_as_far_as_it_shows() -> None:
    """A plane on which a particle slides: its tilt and height, not what moves it in itself."""

    def on_plane(X, frame):
        return frame[:3, 2] @ (X[0, :3, 3] - frame[:3, 3])

    slope, start = 0.3, np.array([0.2, 0.1, 0.4])
    normal = np.array([np.sin(slope), 0, np.cos(slope)])
    down = G - normal * (normal @ G)
    t = np.arange(500)[:, None] / RATE
    place = start + t * [0, 1.5, 0] - 1.2 * t * down + t**2 / 2 * down
    frame = np.eye(4)
    frame[2, 3] = 0.5
    plane = diffnea.Constraint(on_plane, 0, frame=frame)
    data = {"time": t[:, 0], "pose": seen(np.eye(3), place, seed=0, turn=0.0)}
    fit = diffnea.fit_constrained(BALL, [plane], ["on_plane"], **data)
    names = ("rx", "ry", "rz", "x", "y", "z")
    told = [fit.parameters[f"on_plane.frame.{name}"].identifiable for name in names]
    assert not any(told[2:5])
    found = fit.constraints[0].parameters["frame"]
    np.testing.assert_allclose(found[:3, 2], normal, atol=5e-4)
    assert found[:3, 2] @ (start - found[:3, 3]) == pytest.approx(0.0, abs=1e-3)

    free = ["on_plane.frame.ry", "on_plane.frame.z"]
    fit = diffnea.fit_constrained(BALL, [plane], free, **data)
    tilt = fit.parameters["on_plane.frame.ry"]
    assert abs(tilt.value - slope) < 4 * tilt.std
    assert tilt.std < 1e-3
    assert fit.parameters["on_plane.frame.z"].identifiable


def test_a_gap_parts_the_motion() -> None:
    """Rows on both sides of a gap are not smoothed together."""
    time, pose = pendulum(seed=2)
    first, second = slice(0, 250), slice(330, None)
    parts = [np.r_[time[first], time[second]], np.concatenate([pose[first], pose[second]])]
    stretch = np.r_[np.zeros(250, dtype=int), np.ones(len(time) - 330, dtype=int)]
    rod = diffnea.Constraint(on_rod, 0, pivot=PIVOT, length=0.7)
    fit = diffnea.fit_constrained(
        BALL, [rod], ["on_rod.length"], time=parts[0], pose=parts[1], stretch=stretch
    )
    p = fit.parameters["on_rod.length"]
    assert abs(p.value - LENGTH) < 4 * p.std
    assert p.std < 1e-3


def test_contradictions_and_mistakes_are_named() -> None:
    time, pose = pendulum(seed=3, seconds=1.0)
    data = {"time": time, "pose": pose}
    rod = diffnea.Constraint(on_rod, 0, "rod", pivot=PIVOT, length=LENGTH)
    wrong = diffnea.Constraint(on_rod, 0, "wrong", pivot=PIVOT, length=0.7)
    with pytest.raises(diffnea.DataError, match=r"'wrong' has no free parameter and does not hold"):
        diffnea.fit_constrained(BALL, [rod, wrong], ["rod.length"], **data)
    with pytest.raises(diffnea.Error, match=r"got 'rod\.lenght'; choices: bodies\[0\]\.mass, rod"):
        diffnea.fit_constrained(BALL, [rod], ["rod.lenght"], **data)
    with pytest.raises(diffnea.Error, match="two constraints are called 'rod'"):
        diffnea.fit_constrained(BALL, [rod, rod], ["rod"], **data)
    with pytest.raises(diffnea.DataError, match="0 parameters"):
        diffnea.fit_constrained(BALL, [rod], [], **data)
    with pytest.raises(diffnea.ShapeError, match=r"pose: got shape \(200, 4, 4\), expected \(200,"):
        diffnea.fit_constrained(BALL, [rod], ["rod"], time=time, pose=pose[:, 0])
    with pytest.raises(diffnea.ShapeError, match=r"applied: got shape \(6,\), expected \(1, 6\)"):
        diffnea.fit_constrained(BALL, [rod], ["rod"], applied=np.zeros(6), **data)
    with pytest.raises(diffnea.DataError, match="expected later than"):
        diffnea.fit_constrained(BALL, [rod], ["rod"], time=time[::-1], pose=pose)
    skate = diffnea.Constraint("skate", 0, p_BP=[0, 0, 0], across_B=[0, 1, 0])
    with pytest.raises(diffnea.Error, match="across_B' is a unit vector, and cannot be free"):
        diffnea.fit_constrained(BALL, [skate], ["skate"], **data)
    bow = diffnea.Constraint(lambda X, h: np.log(X[0, 2, 3] - h), 0, "bow", h=1.0)
    with pytest.raises(diffnea.DataError, match=r"constraint 'bow' has no value at .* s; begin"):
        diffnea.fit_constrained(BALL, [bow], ["bow.h"], **data)
    lamina = diffnea.FreeBody([1.0, 0, 0, 0, 0.1, 0, 0, 0.1, 0, 0.2])
    with pytest.raises(diffnea.ModelError, match=r"bodies\[0\]\.inertia is free, and begins where"):
        diffnea.fit_constrained([lamina], [rod], ["bodies[0].inertia"], **data)


def test_ctrl_c_ends_a_fit() -> None:
    """Sixty pendulums would take many times as long."""
    time, pose = pendulum(seed=4)
    copies = 60
    data = {
        "time": np.tile(time, copies),
        "pose": np.tile(pose, (copies, 1, 1, 1)),
        "stretch": np.repeat(np.arange(copies), len(time)),
    }
    rod = diffnea.Constraint(on_rod, 0, pivot=[0, 0, 0], length=1.0)
    ended = []

    def interrupt(*_: object) -> None:
        ended.append(monotonic())
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, 2.0)
        with pytest.raises(KeyboardInterrupt):
            diffnea.fit_constrained(BALL, [rod], ["on_rod"], max_iterations=10_000, **data)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert monotonic() - ended[0] < 1.0
