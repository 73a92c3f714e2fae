"""Primitives, search, and rollouts of tasks and simulators in Python."""

import pickle

import numpy as np
import pytest

import diffnea

ROUNDING = 1e-12  # of sums of some ten numbers of order 1


class PointMass(diffnea.Simulator):
    """A mass in the plane that a spring pulls to where it should be."""

    joints = ("x", "y")
    channels = ("q_x", "q_y", "qd_x", "qd_y")
    period = 0.02
    stiffness, damping = 100.0, 20.0

    def __init__(self, lanes: int = 16) -> None:
        self.lanes = lanes

    def reset(self, q, seeds) -> None:
        self.q = np.zeros((2, self.lanes))
        self.q[:, : q.shape[1]] = q
        self.qd = np.zeros_like(self.q)

    def step(self, q, qd) -> None:
        force = self.stiffness * (q - self.q) + self.damping * (qd - self.qd)
        self.qd = self.qd + self.period * force
        self.q = self.q + self.period * self.qd

    def observe(self):
        return np.concatenate([self.q, self.qd])


GOAL = (0.3, -0.2)


def to_goal(rollouts: diffnea.RolloutSeries):
    """Negative distance from the goal at the end [m]."""
    return -np.hypot(rollouts["q_x"][:, -1] - GOAL[0], rollouts["q_y"][:, -1] - GOAL[1])


class ToGoal(diffnea.Task):
    """The same, look by look; done within 1 cm."""

    def begin(self, simulator, count) -> None:
        assert simulator.channels == PointMass.channels
        self.distance = np.zeros(count)

    def look(self, time, observation, ended) -> None:
        self.distance = np.hypot(observation["q_x"] - GOAL[0], observation["q_y"] - GOAL[1])

    def rewards(self):
        return -self.distance

    def solved(self):
        return self.distance < 0.01


def primitive(**options) -> diffnea.Promp:
    return diffnea.Promp(["x", "y"], duration=1.0, hold=0.5, bases=6, returns=False, **options)


def unit_search(promp: diffnea.Promp, **options) -> diffnea.Ereps:
    start = diffnea.Gaussian(np.zeros(promp.size), 0.25 * np.eye(promp.size))
    return diffnea.Ereps(start, **options)


# --- primitive and Gaussian ---


def test_motions_start_at_rest_and_come_home() -> None:
    promp = diffnea.Promp(["a", "b"], duration=1.2, hold=0.3)
    theta = np.random.default_rng(1).normal(size=promp.size)
    q, qd = promp.motion(theta, [0.0, 0.6, 1.2, 1.5])
    np.testing.assert_allclose(q[[0, 2, 3]], 0, atol=ROUNDING)
    np.testing.assert_allclose(qd[[0, 2, 3]], 0, atol=ROUNDING)
    assert np.abs(q[1]).min() > 0.01
    phi, phi_d = promp.features([0.6])
    np.testing.assert_allclose(q[1], theta.reshape(2, -1) @ phi[0], atol=ROUNDING)
    np.testing.assert_allclose(qd[1], theta.reshape(2, -1) @ phi_d[0], atol=1e-11)  # divided by T


def test_velocity_is_the_derivative() -> None:
    promp = diffnea.Promp(["a"], duration=1.2)
    theta = np.random.default_rng(2).normal(size=promp.size)
    h = 1e-5  # of order h² = 1e-10, times a third derivative of some 100
    times = np.linspace(0.1, 1.1, 20)
    ahead, behind = promp.motion(theta, times + h)[0], promp.motion(theta, times - h)[0]
    np.testing.assert_allclose(promp.motion(theta, times)[1], (ahead - behind) / (2 * h), atol=1e-6)


def test_a_via_point_is_met() -> None:
    promp = diffnea.Promp(["a", "b"])
    prior = diffnea.Gaussian(np.zeros(promp.size), np.eye(promp.size))
    policy = promp.via(prior, time=0.7, q=[0.2, -0.1], std=1e-6)
    q, _ = promp.motion(policy.mean, [0.7])
    np.testing.assert_allclose(q[0], [0.2, -0.1], atol=1e-9)  # the noise, squared
    assert policy.entropy() < prior.entropy()
    phi, _ = promp.features([0.7])
    A = np.kron(np.eye(2), phi)  # noqa: N806
    same = prior.conditioned(A, [0.2, -0.1], 1e-12 * np.eye(2))
    np.testing.assert_allclose(policy.mean, same.mean, atol=1e-9)


def test_gaussians_are_sampled_and_compared() -> None:
    covariance = np.array([[1.0, 0.3], [0.3, 0.5]])
    g = diffnea.Gaussian([1.0, 2.0], covariance)
    x = g.sample(20000, seed=3)
    assert np.array_equal(x, g.sample(20000, seed=3))
    np.testing.assert_allclose(x.mean(axis=0), g.mean, atol=0.03)  # 4/√20000
    np.testing.assert_allclose(np.cov(x.T), covariance, atol=0.05)
    other = diffnea.Gaussian([1.5, 2.0], covariance)
    expected = 0.5 * np.array([0.5, 0.0]) @ np.linalg.solve(covariance, [0.5, 0.0])
    assert g.kl(other) == pytest.approx(expected)
    np.testing.assert_allclose(g.std, np.sqrt(np.diag(covariance)))
    with pytest.raises(diffnea.Error, match="symmetric"):
        diffnea.Gaussian([0, 0], [[1, 0.5], [0, 1]])
    with pytest.raises(diffnea.Error, match="positive definite"):
        diffnea.Gaussian([0, 0], [[1, 2], [2, 1]])
    with pytest.raises(diffnea.ShapeError, match="covariance"):
        diffnea.Gaussian([0, 0], np.eye(3))


# --- search ---


def test_the_search_finds_the_optimum_of_a_quadratic() -> None:
    optimum = np.array([0.5, -1.0, 0.2])
    start = diffnea.Gaussian(np.zeros(3), np.eye(3))
    search = diffnea.Ereps(start, seed=1, samples=60, stop_std=1e-3, least_std=1e-4)
    while not search.done:
        theta = search.ask()
        search.tell(-np.sum((theta - optimum) ** 2, axis=1))
    # Where every standard deviation is below 1e-3, so is the mean's distance, nearly.
    np.testing.assert_allclose(search.policy.mean, optimum, atol=5e-3)
    assert "standard deviation" in search.stop_reason
    history = search.history
    assert len(history["reward_mean"]) == search.iteration
    assert (np.diff(history["reward_best"]) >= 0).all()
    assert (history["kl_update"] <= 0.5 + 1e-9).all()


def test_a_nan_is_reported_and_the_search_stays_as_it_was() -> None:
    search = unit_search(primitive(), samples=10)
    search.tell(np.arange(10.0))
    before = pickle.dumps(search)
    rewards = np.zeros(10)
    rewards[7] = np.nan
    named = f"{search.ask()[7][0]:.4g}"[:4]
    with pytest.raises(diffnea.DataError, match=r"iteration 2, sample 7: .*NaN") as error:
        search.tell(rewards)
    assert named in str(error.value)
    assert pickle.dumps(search) == before
    search.tell(np.arange(10.0), solved=np.arange(10) < 3)
    assert search.history["solved_share"][-1] == pytest.approx(0.3)


def test_a_pickled_search_goes_on_to_the_same_result() -> None:
    def went_on(search: diffnea.Ereps):
        while not search.done:
            search.tell(-np.sum(search.ask() ** 2, axis=1))
        return search.policy.mean

    search = unit_search(primitive(), samples=20, iterations=12)
    for _ in range(4):
        search.tell(-np.sum(search.ask() ** 2, axis=1))
    assert np.array_equal(went_on(pickle.loads(pickle.dumps(search))), went_on(search))


# --- own simulators and tasks ---


@pytest.mark.parametrize("kind", ["function", "task"])
def test_an_own_simulator_learns_to_reach_a_goal(kind) -> None:
    promp = primitive(held_last=0)
    how = {"reward": to_goal} if kind == "function" else {"task": ToGoal()}
    rollouts = diffnea.Rollouts(PointMass(), promp, **how)
    search = unit_search(promp, seed=2, samples=40, iterations=60)
    while not search.done:
        result = rollouts.run(search.ask())
        search.tell(result.rewards, result.solved)
    trace = rollouts.trace(search.policy.mean)
    assert trace.reward > -0.01  # [m]
    end = trace["q_x"][-1], trace["q_y"][-1]
    np.testing.assert_allclose(end, GOAL, atol=0.01)
    if kind == "task":
        assert trace.solved
        assert search.history["solved_share"][-1] > 0.5
    assert rollouts.count >= 40 * search.iteration


def test_function_and_task_say_the_same() -> None:
    promp = primitive()
    theta = np.random.default_rng(4).normal(scale=0.3, size=(50, promp.size))
    by_task = diffnea.Rollouts(PointMass(), promp, task=ToGoal()).run(theta)
    for threads in (1, 2):
        whole = diffnea.Rollouts(PointMass(lanes=7), promp, reward=to_goal, threads=threads)
        assert np.array_equal(whole.run(theta).rewards, by_task.rewards)
    assert whole.run(theta).solved is None


def test_whole_rollouts_are_those_of_their_parameters() -> None:
    promp, seen = primitive(), []

    def reward(rollouts: diffnea.RolloutSeries):
        seen.append(rollouts)
        return np.zeros(len(rollouts.rows))

    theta = np.random.default_rng(5).normal(scale=0.5, size=(20, promp.size))
    limit = 0.25
    rollouts = diffnea.Rollouts(
        PointMass(lanes=3),
        promp,
        reward=reward,
        ended=lambda observation: observation["q_x"] > 0.15,
        upper=[limit, limit],
        threads=2,
    )
    result = rollouts.run(theta)
    (series,) = seen
    desired = np.stack([promp.motion(w, series.time)[0] for w in theta])
    allowed = (desired <= limit).all(axis=(1, 2))
    assert 0 < allowed.sum() < 20
    assert (result.rewards[~allowed] < -1).all()  # not executed
    assert np.array_equal(series.theta, theta[allowed])
    assert series["q_x"].shape == (allowed.sum(), len(series.time))
    assert series.mask.sum() == series.rows.sum()
    for k, weights in enumerate(series.theta):
        trace = rollouts.trace(weights)
        assert len(trace.time) == series.rows[k]
        assert np.array_equal(series["q_x"][k][series.mask[k]], trace["q_x"])
        assert (series["q_x"][k][~series.mask[k]] == trace["q_x"][-1]).all()
        if series.rows[k] < len(series.time):
            assert trace["q_x"][-1] > 0.15 >= trace["q_x"][:-1].max()
    with pytest.raises(KeyError, match=r"no channel 'ball_x'; channels: q_x"):
        series["ball_x"]


def test_mistakes_in_python_come_back() -> None:
    promp = primitive()
    theta = np.zeros((4, promp.size))

    class Wrong(PointMass):
        def observe(self):
            return np.zeros((3, self.lanes))

    with pytest.raises(diffnea.ShapeError, match=r"Simulator.observe: got shape \(3, 16\)"):
        diffnea.Rollouts(Wrong(), promp, reward=to_goal).run(theta)

    class Failing(PointMass):
        def failures(self):
            return ["it broke", *[""] * (self.lanes - 1)]

    result = diffnea.Rollouts(Failing(), promp, reward=to_goal).run(theta)
    assert result.failures[0] == "it broke"
    assert result.rewards[0] == -np.inf
    assert np.isfinite(result.rewards[1:]).all()

    def broken(rollouts):
        raise RuntimeError("my own mistake")

    with pytest.raises(RuntimeError, match="my own mistake"):
        diffnea.Rollouts(PointMass(), promp, reward=broken).run(theta)

    class BrokenTask(ToGoal):
        def look(self, time, observation, ended) -> None:
            raise RuntimeError("in another thread")

    with pytest.raises(RuntimeError, match="in another thread"):
        diffnea.Rollouts(PointMass(2), promp, task=BrokenTask(), threads=2).run(theta)
    with pytest.raises(diffnea.ShapeError, match=r"reward: .* \(1,\), expected \(4,\)"):
        diffnea.Rollouts(PointMass(), promp, reward=lambda r: np.zeros(1)).run(theta)
    with pytest.raises(diffnea.Error, match="neither a task nor a reward"):
        diffnea.Rollouts(PointMass(), promp)
    with pytest.raises(diffnea.Error, match="joint 'z'"):
        diffnea.Rollouts(PointMass(), diffnea.Promp(["z"]), reward=to_goal)


def test_values_survive_pickling() -> None:
    promp = primitive()
    again = pickle.loads(pickle.dumps(promp))
    assert (again.joints, again.size, again.returns) == (promp.joints, promp.size, False)
    g = diffnea.Gaussian([1.0, 2.0], np.eye(2))
    back = pickle.loads(pickle.dumps(g))
    assert np.array_equal(back.mean, g.mean)
    assert np.array_equal(back.covariance, g.covariance)
    trace = diffnea.Rollouts(PointMass(), promp, reward=to_goal).trace(np.zeros(promp.size))
    same = pickle.loads(pickle.dumps(trace))
    assert np.array_equal(same["q_x"], trace["q_x"])
    assert same.reward == trace.reward
