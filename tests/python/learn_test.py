"""Ball in a cup from Python: learned in the model, executed in MuJoCo."""

import copy
import os
import pickle
import signal
import threading

import numpy as np
import pytest

import diffnea
import diffnea._transfer as transfer_module

MODEL = "wam4_ball_in_cup"
# Small enough to be quick: what is tested is the same for any search.
QUICK = {"samples": 16, "iterations": 3, "progress": False}


@pytest.fixture(scope="module")
def model() -> diffnea.Model:
    return diffnea.load_model(MODEL)


@pytest.fixture(scope="module")
def learned() -> diffnea.LearnResult:
    """One seed until it is solved: some seconds."""
    return diffnea.learn(MODEL, seeds=[1], iterations=40, threads=2, progress=False)


def numpy_reward(rollouts: diffnea.RolloutSeries):
    """Reward as docs/policy.md has it, with the defaults, written apart from the library."""
    string, epsilon, lambda_q, lambda_qd, lambda_slack = 0.4, 0.01, 0.02, 0.02, 20.0
    ball, cup, axis = (
        np.stack([rollouts[f"{name}_{x}"] for x in "xyz"], axis=-1)
        for name in ("ball", "cup", "axis")
    )
    delta = ball - cup
    psi = np.sum(delta * axis, axis=-1) / (np.sum(delta**2, axis=-1) + epsilon)
    hanging = -string / (string**2 + epsilon)
    caught = rollouts["phase"][:, -1] == 1
    at_end = np.where(caught, psi[:, -1], np.minimum(psi[:, -1], hanging))
    slack = np.maximum(0, 1 - np.linalg.norm(delta, axis=-1) / string)
    free = rollouts.mask & (rollouts["phase"] == 0)
    penalty = lambda_slack * np.sum(slack**2 * free, axis=1)
    for channel in rollouts:
        if channel.startswith("q_"):
            moved = rollouts[channel] - rollouts[channel][:, :1]
            penalty += lambda_q * np.sum(moved**2 * rollouts.mask, axis=1)
        elif channel.startswith("qd_"):
            penalty += lambda_qd * np.sum(rollouts[channel] ** 2 * rollouts.mask, axis=1)
    return np.exp(0.5 * psi.max(axis=1) + 0.5 * at_end) - penalty / rollouts.rows


def test_a_short_search_solves_the_task_in_the_model(learned) -> None:
    assert learned.solved.all()
    assert not learned.interrupted
    (policy,) = learned.policies
    assert policy.curve["solved_share"][-1] > 0.2
    trace = learned.imagine()
    assert trace["phase"][-1] == 1
    assert trace.solved
    assert trace.reward == policy.expected
    q, qd = policy.motion(trace.time)
    np.testing.assert_allclose(q, trace.q_desired, atol=1e-12)  # sums in another order
    assert np.abs(qd[[0, -1]]).max() < 1e-9
    assert "1 of 1 policies solved" in repr(learned)
    assert "<td>yes</td>" in learned._repr_html_()


def test_a_reward_in_numpy_learns_what_the_library_learns(model) -> None:
    string = model.to_dict()["ball"]["string"]["length"]
    assert string == pytest.approx(0.4)
    own = diffnea.learn(model, reward=numpy_reward, **QUICK)
    built_in = diffnea.learn(model, **QUICK)
    ours, theirs = own.policies[0], built_in.policies[0]
    for name in ("reward_mean", "reward_best"):
        # The same sums in another order: 1e-16 each of some 1000 terms, amplified by updates.
        np.testing.assert_allclose(ours.curve[name], theirs.curve[name], rtol=1e-9)
    assert np.array_equal(ours.curve["solved_share"], theirs.curve["solved_share"])
    np.testing.assert_allclose(ours.mean, theirs.mean, atol=1e-9)
    assert ours.rollouts == theirs.rollouts


def test_threads_do_not_change_the_result(model) -> None:
    one = diffnea.learn(model, seeds=[3], threads=1, **QUICK).policies[0]
    two = diffnea.learn(model, seeds=[3], threads=2, **QUICK).policies[0]
    many = diffnea.learn(model, seeds=[2, 3], threads=2, **QUICK).policies[1]
    for other in (two, many):
        assert np.array_equal(one.mean, other.mean)
        assert np.array_equal(one.covariance, other.covariance)
        assert all(np.array_equal(one.curve[k], other.curve[k]) for k in one.curve)
    own = [
        diffnea.learn(model, seeds=[3], reward=numpy_reward, threads=k, **QUICK).policies[0].mean
        for k in (1, 2)
    ]
    assert np.array_equal(*own)


def test_a_nan_names_iteration_sample_and_parameters(model) -> None:
    calls = []

    def reward(rollouts: diffnea.RolloutSeries):
        calls.append(0)
        out = np.zeros(len(rollouts.rows))
        if len(calls) == 2:
            out[:] = np.nan
        return out

    with pytest.raises(diffnea.DataError, match=r"iteration 2, sample \d+: .*NaN.*parameters: "):
        diffnea.learn(model, reward=reward, **QUICK)


def test_it_stops_when_asked_and_gives_what_was_learned(model) -> None:
    seen = []

    def progress(seed, iteration, mean, share):
        seen.append((seed, iteration))
        return iteration < 2

    options = QUICK | {"progress": progress, "iterations": 50}
    for how in ({}, {"reward": numpy_reward}):
        seen.clear()
        result = diffnea.learn(model, seeds=2, **how, **options)
        assert result.interrupted
        assert seen == [(0, 1), (0, 2)]
        (policy,) = result.policies
        assert policy.stopped == ""
        assert len(policy.curve["eta"]) == 2
        assert "interrupted" in repr(result)


@pytest.mark.parametrize("reward", [None, numpy_reward])
def test_it_stops_after_the_last_iteration_of_a_seed_too(model, reward) -> None:
    seen = []

    def progress(seed, iteration, mean, share):
        seen.append((seed, iteration))
        return iteration < 2

    options = QUICK | {"progress": progress, "iterations": 2}
    result = diffnea.learn(model, seeds=3, reward=reward, **options)
    assert seen == [(0, 1), (0, 2)]
    assert result.seeds == [0]
    assert result.interrupted


@pytest.mark.parametrize("reward", [None, numpy_reward])
def test_ctrl_c_gives_back_what_was_learned(model, reward) -> None:
    def progress(seed, iteration, mean, share) -> None:
        if iteration == 1:
            threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGINT)).start()

    result = diffnea.learn(
        model, reward=reward, samples=16, iterations=1000, stop_std=0.0, progress=progress
    )
    assert result.interrupted
    assert len(result.policies[0].curve["eta"]) >= 1


def test_mistakes_in_progress_come_back(model) -> None:
    def progress(*facts) -> None:
        raise RuntimeError("my own mistake")

    with pytest.raises(RuntimeError, match="my own mistake"):
        diffnea.learn(model, samples=16, progress=progress)


def test_the_string_on_the_robot(model) -> None:
    def length(of: diffnea.Model) -> float:
        return float(of.to_dict()["ball"]["string"]["length"])

    quick = QUICK | {"iterations": 1}
    other = diffnea.learn(model, string=0.35, **quick)
    assert length(other.model) == 0.35
    assert other.policies[0].reward["string"] == 0.35
    data = model.to_dict()
    data["ball"]["string"] |= {"length": 0.41, "length_std": 0.001}
    identified = diffnea.Model.from_dict(data)
    kept = diffnea.learn(identified, string=0.4, **quick)
    assert length(kept.model) == 0.41
    with pytest.raises(diffnea.DataError, match=r"identified as 0.41 m"):
        diffnea.learn(identified, string=0.35, **quick)


def test_wrong_arguments_are_named(model) -> None:
    with pytest.raises(diffnea.Error, match="ball-in-cup"):
        diffnea.learn(model, "juggling")
    with pytest.raises(diffnea.ModelError, match="no cup"):
        diffnea.learn("wam4")
    with pytest.raises(diffnea.Error, match="choices: computed_torque, pd"):
        diffnea.learn(model, law="magic")
    with pytest.raises(diffnea.Error, match="seeds"):
        diffnea.learn(model, seeds=[])
    with pytest.raises(diffnea.Error, match="threads"):
        diffnea.learn(model, threads=0)


VARIED = {"string.string_mass.mass_ratio": (0.0, 0.1), "string.length": (0.39, 0.41)}


def test_in_draws_the_result_is_the_same_on_any_threads(model) -> None:
    options = {"robust": True, "draws": 8, "vary": VARIED, "seeds": [3], **QUICK}
    one, two = (diffnea.learn(model, threads=k, **options) for k in (1, 2))
    plain = diffnea.learn(model, seeds=[3], **QUICK)
    assert np.array_equal(one.policies[0].mean, two.policies[0].mean)
    assert not np.array_equal(one.policies[0].mean, plain.policies[0].mean)
    assert one.policies[0].rollouts == two.policies[0].rollouts
    assert 0.0 <= one.caught_share[0] <= 1.0
    assert np.isnan(plain.caught_share[0])
    assert plain.policies[0].caught_share is None
    assert " of 64 draws" in repr(one.policies[0])
    copy = pickle.loads(pickle.dumps(one.policies[0]))
    assert copy.caught_share == one.policies[0].caught_share
    assert copy.to_dict() == one.policies[0].to_dict()
    assert one.to_dict()["task"]["robust"]["vary"][1] == {
        "parameter": "string.length",
        "low": 0.39,
        "high": 0.41,
    }


def test_draws_of_nothing_are_refused(model) -> None:
    with pytest.raises(diffnea.ModelError, match="has no posterior"):
        diffnea.learn(model, robust=True)
    with pytest.raises(diffnea.Error, match="robust=True"):
        diffnea.learn(model, quantile=0.1)
    with pytest.raises(diffnea.Error, match="draws"):
        diffnea.learn(model, robust=True, draws=0)
    with pytest.raises(diffnea.Error, match="each: got 0"):
        diffnea.learn(model, robust=True, vary=VARIED, each=0)
    with pytest.raises(diffnea.Error, match="low end"):
        diffnea.learn(model, robust=True, vary={"string.length": (0.5, 0.4)})
    with pytest.raises(diffnea.Error, match="own reward"):
        diffnea.learn(model, robust=True, vary=VARIED, reward=numpy_reward)


class LookByLook(diffnea.Task):
    """What :func:`numpy_reward` says of ψ alone, look by look."""

    def begin(self, simulator, count) -> None:
        self.most = np.full(count, -np.inf)
        self.phase = np.zeros(count)

    def look(self, time, observation, ended) -> None:
        delta = [observation[f"ball_{x}"] - observation[f"cup_{x}"] for x in "xyz"]
        along = sum(d * observation[f"axis_{x}"] for d, x in zip(delta, "xyz", strict=True))
        psi = along / (sum(d**2 for d in delta) + 0.01)
        self.most = np.where(ended, self.most, np.maximum(self.most, psi))
        self.phase = np.where(ended, self.phase, observation["phase"])
        ended |= self.phase >= 2

    def rewards(self):
        return self.most

    def solved(self):
        return self.phase == 1


def test_an_own_task_is_learned_in_the_model(model) -> None:
    def whole(rollouts: diffnea.RolloutSeries):
        delta = [rollouts[f"ball_{x}"] - rollouts[f"cup_{x}"] for x in "xyz"]
        along = sum(d * rollouts[f"axis_{x}"] for d, x in zip(delta, "xyz", strict=True))
        return np.max(along / (sum(d**2 for d in delta) + 0.01), axis=1)

    by_task = diffnea.learn(model, LookByLook(), **QUICK).policies[0]
    by_function = diffnea.learn(model, reward=whole, **QUICK).policies[0]
    assert np.array_equal(by_task.mean, by_function.mean)
    assert np.array_equal(by_task.curve["solved_share"], by_function.curve["solved_share"])


def test_results_survive_pickling_and_are_drawn(learned, tmp_path) -> None:
    again = pickle.loads(pickle.dumps(learned))
    one, two = learned.policies[0], again.policies[0]
    assert np.array_equal(one.mean, two.mean)
    assert np.array_equal(one.covariance, two.covariance)
    assert repr(one) == repr(two)
    np.testing.assert_equal(two.controller, one.controller)
    np.testing.assert_equal(two.curve, one.curve)
    assert again.imagine().reward == one.expected
    assert np.array_equal(one.sample(3, seed=1), one.sample(3, seed=1))
    assert again.to_dict() == learned.to_dict()
    assert learned.to_dict()["schema"] == "diffnea/learn/1"
    pytest.importorskip("matplotlib")
    learned.plot().savefig(tmp_path / "curves.png")
    assert (tmp_path / "curves.png").stat().st_size > 10_000


def test_files_hold_a_policy(learned, tmp_path) -> None:
    one = learned.policies[0]
    one.save(tmp_path / "policy.json")
    again = diffnea.read_policy(tmp_path / "policy.json")
    assert np.array_equal(one.mean, again.mean)
    assert one.to_dict() == again.to_dict()
    assert again.to_dict()["schema"] == "diffnea/policy/1"
    learned.save(tmp_path / "run")
    for name in ("result.json", "report.html", "policy_1.json"):
        assert (tmp_path / "run" / name).is_file()


def test_a_policy_is_executed_in_a_world(learned, tmp_path) -> None:
    result = diffnea.transfer(learned, repetitions=2, threads=2)
    assert len(result.executions) == 1
    assert len(result.repetitions) == 2
    assert result.outcomes[0] in ("in_cup", "late", "fell_out", "rim", "beside", "missed")
    assert result.success in (0.0, 1.0)
    assert 0.0 <= result.repeatability <= 1.0
    one, other = result.repetitions
    assert not np.array_equal(one.trace["ball_x"], other.trace["ball_x"])  # noise of their own
    alone = diffnea.transfer(learned.policies[0], repetitions=0)
    assert alone.imagined == []
    assert np.isnan(alone.repeatability)
    np.testing.assert_array_equal(
        alone.executions[0].trace["ball_x"], result.executions[0].trace["ball_x"]
    )
    back = pickle.loads(pickle.dumps(result))
    assert back.to_dict() == result.to_dict()
    assert "TransferResult('mujoco:wam4_ball_in_cup" in repr(result)
    assert "masses -8…+20 %" in result.to_dict()["differences"]
    assert "masses -8…+20 %" in result._repr_html_()

    pytest.importorskip("matplotlib")
    result.plot().savefig(tmp_path / "paths.png")
    assert (tmp_path / "paths.png").stat().st_size > 10_000
    pytest.importorskip("PIL")
    result.animate(tmp_path / "film.gif", fps=5)
    assert (tmp_path / "film.gif").read_bytes().startswith(b"GIF89a")
    with pytest.raises(diffnea.Error, match=r"\.gif, \.mp4"):
        result.animate(tmp_path / "film.avi")


def test_every_controller_has_its_own_world(model, monkeypatch) -> None:
    """NumPy prints these gains alike."""
    gains = np.full(4, 100.0)
    options = QUICK | {"seeds": [1], "iterations": 1, "kd": gains / 10}
    policies = [
        diffnea.learn(model, kp=kp, **options).policies[0] for kp in (gains, gains, gains + 1e-9)
    ]
    made = []
    world = transfer_module._World

    def spy(name, controller, policy, *options):
        made.append(policy.controller["kp"][0])
        return world(name, controller, policy, *options)

    monkeypatch.setattr(transfer_module, "_World", spy)
    diffnea.transfer(policies, repetitions=0)
    assert made == [100.0, 100.0 + 1e-9]


def test_a_rollout_of_one_look_is_a_film_of_one_picture(learned, tmp_path) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("PIL")
    trace = learned.imagine()
    first = diffnea.RolloutTrace(
        trace.time[:1], trace.channels, trace.array[:1], trace.q_desired[:1], 0.0, False, "failed"
    )
    diffnea.animate(first, learned.model, tmp_path / "film.gif")
    assert (tmp_path / "film.gif").stat().st_size > 1000


def test_the_library_s_worlds_run_any_rollouts(model) -> None:
    promp = diffnea.Promp(["joint2", "joint4"], duration=0.5, hold=0.1)
    home = np.array([0.0, 0.6, 0.0, 1.25])
    theta = np.random.default_rng(1).normal(scale=0.1, size=(3, promp.size))
    worlds = (
        diffnea.model_simulator(model, bandwidth=25.0),
        diffnea.world_simulator(f"mujoco:{MODEL},perturb=none,ball=tendon", lanes=2),
    )
    ends = []
    for world in worlds:
        rollouts = diffnea.Rollouts(
            world, promp, reward=lambda r: -np.abs(r["qd_joint2"]).max(axis=1), start=home
        )
        assert (rollouts.run(theta).rewards < 0).all()
        ends.append(rollouts.trace(theta[0]))
    # The same arm in two simulators: they differ by friction and integration, not by more.
    np.testing.assert_allclose(ends[0]["q_joint2"], ends[1]["q_joint2"], atol=0.02)


def test_a_simulator_that_was_not_reset_says_so(model) -> None:
    simulator = diffnea.model_simulator(model)
    still = np.zeros((len(simulator.joints), simulator.lanes))
    start = np.array([[0.0, 0.6, 0.0, 1.25]]).T
    for one in (simulator, copy.deepcopy(simulator)):
        with pytest.raises(diffnea.Error, match="reset"):
            one.step(still, still)
        one.reset(start, [0])
        one.step(still, still)
        with pytest.raises(diffnea.Error, match="reset"):
            one.clone().step(still, still)


def test_a_simulator_may_use_the_library_s(model) -> None:
    class Delayed(diffnea.Simulator):
        """Commands arrive one period late."""

        def __init__(self, inner) -> None:
            self.inner = inner
            self.joints, self.channels = inner.joints, inner.channels
            self.period, self.lanes = inner.period, inner.lanes

        def reset(self, q, seeds) -> None:
            self.inner.reset(q, seeds)
            self.last = None

        def step(self, q, qd) -> None:
            self.inner.step(*(self.last or (q, qd)))
            self.last = q, qd

        def observe(self):
            return self.inner.observe()

    inner = diffnea.model_simulator(model)
    promp = diffnea.Promp(["joint2"], duration=0.3, hold=0.1)
    home = np.array([0.0, 0.6, 0.0, 1.25])
    theta = np.full(promp.size, 0.1)
    traces = [
        diffnea.Rollouts(world, promp, task=diffnea.BallInCupTask(), start=home).trace(theta)
        for world in (inner, Delayed(inner))
    ]
    # The same motion one period later, up to gravity at another instant and the ball's pull.
    np.testing.assert_allclose(traces[1]["q_joint2"][1:], traces[0]["q_joint2"][:-1], atol=1e-3)
