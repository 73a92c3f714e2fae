"""Black-box baselines: networks that are trained in Python and move the ball in C++."""

import json
import pickle
import sys
from dataclasses import replace

import numpy as np
import pytest
from cli import MODELS
from cli import diffnea as command

import diffnea
from diffnea.blackbox import BallNetwork, FreeRun, TrainOptions, free_run, train
from diffnea.blackbox.data import local_polynomial, to_link

MODEL = MODELS / "wam4_ball_in_cup.xml"
HOME = np.array([0.0, 0.6, 0.0, 1.25])
QUICK = {"samples": 8, "iterations": 2, "progress": False}


@pytest.fixture(scope="module")
def model() -> diffnea.Model:
    return diffnea.load_model(MODEL)


def layer(rng: np.random.Generator, inputs: int, outputs: int) -> dict:
    return {
        "weights": rng.normal(scale=0.2, size=(outputs, inputs)).tolist(),
        "bias": rng.normal(scale=0.2, size=outputs).tolist(),
    }


def network(kind: str, seed: int = 0) -> BallNetwork:
    """Any network of small numbers: two members."""
    rng = np.random.default_rng(seed)
    members = []
    for _ in range(2):
        if kind == "ff":
            members.append({"cells": [], "layers": [layer(rng, 18, 10), layer(rng, 10, 3)]})
        else:
            members.append({"cells": [layer(rng, 18 + 6, 24)], "layers": [layer(rng, 6, 3)]})
    scale = {"mean": rng.normal(size=18).tolist(), "scale": rng.uniform(1, 3, size=18).tolist()}
    return BallNetwork(
        {
            "schema": "diffnea/ball-network/1",
            "kind": kind,
            "step": 0.002,
            "warm_up": 0.0 if kind == "ff" else 0.05,
            "input": scale,
            "output": {"mean": [0.0, 0.1, 0.0], "scale": [1.0, 2.0, 3.0]},
            "members": members,
        }
    )


def last_link(model: diffnea.Model) -> str:
    return [link.name for link in model.links if link.type != "fixed"][-1]


def swung(model: diffnea.Model, seconds: float) -> diffnea.Recording:
    """A pendulum on a moving arm, integrated here, and seen by a camera of 100 Hz."""
    h = 0.001
    time = np.arange(round(seconds / h) + 1) * h
    rates = np.array([[1.1, 2.3], [0.9, 2.9], [1.3, 1.9], [0.7, 2.1]])
    q = HOME + 0.15 * np.sin(time[:, None, None] * rates).sum(axis=2)
    qd = np.gradient(q, h, axis=0)
    knot = diffnea.frame_motion(model, "cup", q=q, qd=qd, qdd=np.gradient(qd, h, axis=0)).pose[
        :, :3, 3
    ]
    x, v = knot[0] - [0, 0, 0.4], np.zeros(3)
    ball = np.empty_like(knot)
    for k, anchor in enumerate(knot):
        away = x - anchor
        beyond = away * (1 - 0.4 / np.linalg.norm(away))  # back onto the sphere of 0.4 m
        x, v = x - beyond, v - beyond / h
        ball[k] = x
        v = v + h * np.array([0, 0, -9.81])
        x = x + h * v
    rows = slice(None, None, 2)
    seen = ball[rows].copy()
    seen[np.arange(len(seen)) % 5 != 0] = np.nan
    seen += np.random.default_rng(0).normal(scale=1e-3, size=seen.shape)
    return diffnea.Recording(
        time=time[rows], q=q[rows], joint_names=model.joint_names, ball=seen, source="swung"
    )


def test_a_network_is_its_file(tmp_path) -> None:
    net = network("lstm")
    net.save(tmp_path / "net.json")
    again = BallNetwork.load(tmp_path / "net.json")
    assert again == net == pickle.loads(pickle.dumps(net))
    assert again.to_dict() == net.to_dict()
    assert (again.kind, again.step, again.warm_up) == ("lstm", 0.002, 0.05)
    assert repr(net) == f"BallNetwork(lstm: 2 × {24 * 25 + 3 * 7} numbers)"
    document = net.to_dict() | {"kind": "gru"}
    with pytest.raises(diffnea.ModelError, match="choices: ff, lstm"):
        BallNetwork(document)


@pytest.mark.parametrize("kind", ["ff", "lstm"])
def test_the_simulator_moves_the_ball_as_documented(model, kind: str) -> None:
    """The motion that C++ shows, again in NumPy from what the arm did."""
    net = network(kind)
    learned = diffnea.learn(model, string=0.4, seeds=[3], ball_network=net, **QUICK)
    (policy,) = learned.policies
    assert policy.ball_network == {"file": net.source, "sha256": net.sha256}
    again = pickle.loads(pickle.dumps(learned))
    assert again.policies[0].ball_network == policy.ball_network
    assert again.imagine().reward == policy.expected
    theta = 0.3 * np.ones(policy.mean.shape)
    rollouts = diffnea.Rollouts._of(learned._task().rollouts(None, None, False, 1), None)
    trace = rollouts.trace(theta)

    q = np.stack([trace[f"q_{joint}"] for joint in model.joint_names], axis=1)
    qd = np.stack([trace[f"qd_{joint}"] for joint in model.joint_names], axis=1)
    ball = np.stack([trace[f"ball_{axis}"] for axis in "xyz"], axis=1)
    link = diffnea.frame_motion(model, last_link(model), q=q, qd=qd, qdd=0 * q)
    R, p, v, w = link.pose[:, :3, :3], link.pose[:, :3, 3], link.velocity, link.angular_velocity  # noqa: N806
    h, hidden = net.step, None

    def inputs(k: int, change: float, x, xd):
        in_world = (
            x - p[k],
            xd - v[k],
            w[k],
            change * (w[k + 1] - w[k]) / h,
            change * (v[k + 1] - v[k]) / h,
            np.array([0.0, 0.0, 1.0]),
        )
        return np.concatenate([R[k].T @ a for a in in_world])[None]

    x, xd = ball[0].copy(), np.zeros(3)
    for _ in range(round(net.warm_up / h)):  # at rest
        _, hidden = net.accelerations(inputs(0, 0.0, x, xd), hidden)
    for k in range(400):
        a, hidden = net.accelerations(inputs(k, 1.0, x, xd), hidden)
        xd = xd + h * R[k] @ a[0]
        x = x + h * xd
        # Kinematics and tanh to rounding, over 400 steps of a bounded network.
        np.testing.assert_allclose(x, ball[k + 1], atol=1e-9)
    assert np.linalg.norm(ball[400] - ball[0]) > 0.05
    # Outside the cup 4, inside 5; 0 before the first step.
    assert set(trace["phase"]) <= {0.0, 4.0, 5.0}


def test_the_reward_is_the_papers_wherever_the_ball_ends(model) -> None:
    learned = diffnea.learn(
        model, string=0.4, ball_network=network("ff"), lambda_slack=0.0, lambda_q=0.0,
        lambda_qd=0.0, **QUICK,
    )  # fmt: skip
    trace = learned.imagine()
    ball, cup, axis = (
        np.stack([trace[f"{name}_{x}"] for x in "xyz"], axis=1) for name in ("ball", "cup", "axis")
    )
    delta = ball - cup
    psi = np.sum(delta * axis, axis=1) / (np.sum(delta**2, axis=1) + 0.01)
    assert trace.reward == pytest.approx(np.exp(0.5 * psi.max() + 0.5 * psi[-1]), rel=1e-12)


@pytest.mark.parametrize(("height", "solved"), [(0.035, True), (0.2, False)])
def test_a_ball_that_stays_inside_is_solved(model, height: float, solved: bool) -> None:
    """A spring with a damper takes the ball to a point over the cup's floor, or over the cup."""
    cup = np.linalg.solve(
        diffnea.frame_pose(model, last_link(model), q=HOME),
        diffnea.frame_pose(model, "cup", q=HOME) @ [0, 0, height, 1],
    )[:3]
    weights = np.zeros((3, 18))
    weights[:, :3], weights[:, 3:6] = -400 * np.eye(3), -40 * np.eye(3)
    document = network("ff").to_dict()
    document["input"] = {"mean": [0.0] * 18, "scale": [1.0] * 18}
    document["output"] = {"mean": [0.0] * 3, "scale": [1.0] * 3}
    pull = {"weights": weights.tolist(), "bias": (400 * cup).tolist()}
    document["members"] = [{"cells": [], "layers": [pull]}]
    learned = diffnea.learn(model, string=0.4, ball_network=BallNetwork(document), **QUICK)
    rollouts = diffnea.Rollouts._of(learned._task().rollouts(None, None, False, 1), None)
    trace = rollouts.trace(np.zeros(learned.policies[0].mean.shape))  # the arm rests
    assert trace.solved == solved
    assert trace["phase"][-1] == (5 if solved else 4)
    ball, cup, axis = (
        np.stack([trace[f"{name}_{x}"] for x in "xyz"], axis=1) for name in ("ball", "cup", "axis")
    )
    delta = ball - cup
    psi = np.sum(delta * axis, axis=1) / (np.sum(delta**2, axis=1) + 0.01)
    slack = np.maximum(0.0, 1.0 - np.linalg.norm(delta, axis=1) / 0.4)
    outside = trace["phase"] != 5
    assert trace.reward == pytest.approx(
        np.exp(0.5 * psi.max() + 0.5 * psi[-1]) - 20.0 * np.mean(slack**2 * outside), rel=1e-6
    )


def test_the_command_names_the_network(tmp_path) -> None:
    net = network("ff")
    net.save(tmp_path / "net.json")
    small = ("--samples", 8, "--iterations", 2, "--quiet")
    out = tmp_path / "run"
    answer = command(
        "learn", "ball-in-cup", MODEL, "--ball-network", tmp_path / "net.json", *small, "-o", out
    )
    assert answer.returncode in (0, 3), answer.stderr
    result = json.loads((out / "result.json").read_text())
    assert result["task"]["ball_network"]["sha256"] == net.sha256
    assert [x["role"] for x in result["reproduce"]["inputs"]] == ["model", "ball_network"]
    assert BallNetwork.load(out / "ball_network.json") == net
    policy = diffnea.read_policy(out / "policy_0.json")
    assert policy.ball_network == {"file": str(tmp_path / "net.json"), "sha256": net.sha256}
    page = (out / "report.html").read_text()
    assert net.sha256[:12] in page
    assert command("report", out).returncode == 0
    assert (out / "report.html").read_text() == page
    # Another network is another task.
    network("ff", seed=1).save(tmp_path / "net.json")
    answer = command(
        "learn", "ball-in-cup", MODEL, "--ball-network", tmp_path / "net.json", *small, "-o", out
    )
    assert answer.returncode == 1
    assert "another task" in answer.stderr


def test_a_network_of_another_step_is_refused(model) -> None:
    with pytest.raises(diffnea.ModelError, match=r"steps of 2 ms.* 1\.25 ms"):
        diffnea.learn(model, ball_network=network("ff"), rate=400.0, **QUICK)


def test_local_polynomials_follow_a_cubic_through_gaps() -> None:
    time = np.linspace(0, 2, 201)
    time = time[(time < 0.9) | (time > 0.95)]
    cubic = np.poly1d([1.0, -2.0, 0.5, 3.0])
    at = np.array([0.0, 0.5, 0.92, 1.99])
    for order, got in enumerate(local_polynomial(time, cubic(time)[:, None], at, 0.1)):
        np.testing.assert_allclose(got[:, 0], cubic.deriv(order)(at), rtol=1e-8)
    apart = time[(time < 0.5) | (time > 0.9)]
    assert np.isnan(local_polynomial(apart, apart[:, None], np.array([0.7]), 0.1)[0]).all()


def test_without_torch_the_message_says_what_to_install(model, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(diffnea.Error, match=r"PyTorch: .* -m pip install 'torch>="):
        train("ff", swung(model, 1.0), model)


@pytest.mark.parametrize("kind", ["ff", "lstm"])
def test_c_plus_plus_computes_what_torch_does(kind: str) -> None:
    torch = pytest.importorskip("torch")
    from diffnea.blackbox.torch_network import torch_network

    class Data:
        input_mean, input_scale = np.linspace(-1, 1, 18), np.linspace(1, 2, 18)
        output_mean, output_scale = np.ones(3), np.arange(1.0, 4.0)

    torch.manual_seed(0)
    net = torch_network(torch, Data(), kind, (20, 20) if kind == "ff" else (9, 9))
    document = {
        "schema": "diffnea/ball-network/1",
        "kind": kind,
        "step": 0.002,
        "warm_up": 0.0,
        "input": {"mean": net.input_mean.tolist(), "scale": net.input_scale.tolist()},
        "output": {"mean": net.output_mean.tolist(), "scale": net.output_scale.tolist()},
        "members": [net.document()],
    }
    exported, net = BallNetwork(document), net.double()
    x = np.random.default_rng(0).normal(size=(5, 4, 18))  # 4 steps in a row
    state = hidden = None
    with torch.no_grad():
        for k in range(4):
            expected, state = net.step(torch.tensor(x[:, k]), state)
            got, hidden = exported.accelerations(x[:, k], hidden)
            np.testing.assert_allclose(got, expected.numpy(), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("kind", ["ff", "lstm"])
def test_training_makes_free_runs_better(model, kind: str) -> None:
    pytest.importorskip("torch")
    recording = swung(model, 24.0)
    quick = TrainOptions(
        hidden=(32,),
        first_iterations=150,
        iterations=30,
        horizons=(0.1, 0.2),
        check_horizon=0.3,
        batch=24,
    )
    none = replace(quick, first_iterations=1, iterations=1)
    untrained = train(kind, recording, model, options=none, progress=False)
    seen = []
    net = train(
        kind, recording, model, options=quick, seed=1, ensemble=2,
        progress=lambda stage, iteration, error: seen.append((stage, error)),
    )  # fmt: skip
    before, after = (free_run(x, recording, model, seconds=0.5).at(0.49) for x in (untrained, net))
    # Falls of decimetres to centimetres: a fifth leaves room for other versions of torch.
    assert after["position_error"] < 0.2 * before["position_error"]
    assert after["length_error"] < 0.2 * before["length_error"]
    assert {stage for stage, _ in seen} == {
        "accelerations", "rollouts of 0.1 s", "rollouts of 0.2 s",
    }  # fmt: skip
    told = net.training
    assert told["options"]["hidden"] == [32]
    assert told["recordings"] == ["swung"]
    assert len(net.to_dict()["members"]) == len(told["stages"]) == 2
    assert [row["time"] for row in told["held_out"]][:3] == pytest.approx([0.1, 0.25, 0.5])


# Far too short to learn anything: what is tested is the same for any size.
HASTY = TrainOptions(
    hidden=(8,), first_iterations=4, iterations=4, horizons=(0.1,), batch=4, check_every=2,
    check_horizon=0.3,
)  # fmt: skip


def test_training_may_leave_out_a_stage(model) -> None:
    pytest.importorskip("torch")
    recording = swung(model, 24.0)
    (stages,) = train(
        "ff", recording, model, options=replace(HASTY, horizons=()), progress=False
    ).training["stages"]
    assert [stage["stage"] for stage in stages] == ["accelerations"]
    net = train("ff", recording, model, options=replace(HASTY, first_iterations=0), progress=False)
    (stages,) = net.training["stages"]  # a file without infinity, or it would not be read
    assert [stage["held_out_error"] is None for stage in stages] == [True, False]


def test_training_that_diverges_says_so(model) -> None:
    pytest.importorskip("torch")
    with pytest.raises(diffnea.Error, match=r"never finite.* learning_rate than 1e\+25"):
        train(
            "ff", swung(model, 24.0), model, options=replace(HASTY, learning_rate=1e25),
            progress=False,
        )  # fmt: skip


@pytest.mark.parametrize(("looks", "members"), [(1, 1), (5, 1), (9, 2)])
def test_training_that_is_stopped_returns_whole_networks(model, looks: int, members: int) -> None:
    """Four looks a network: two in each of two stages."""
    pytest.importorskip("torch")
    seen = []

    def until(stage: str, iteration: int, error: float) -> bool:
        seen.append(iteration)
        return len(seen) < looks

    net = train("ff", swung(model, 24.0), model, options=HASTY, ensemble=3, progress=until)
    assert len(net.to_dict()["members"]) == members
    assert len(seen) == looks


def test_an_error_is_that_of_the_last_row_that_was_seen() -> None:
    nan = np.nan
    run = FreeRun(
        time=np.array([0.0, 0.1, 0.2]),
        position_error=np.array([[nan, 1.0, nan], [nan, 3.0, nan]]),
        length_error=np.array([[0.0, -1.0, -2.0], [0.0, 1.0, 4.0]]),
    )
    assert run.at(0.21) == {"time": 0.2, "position_error": 2.0, "length_error": 3.0}
    assert np.isnan(run.at(0.0)["position_error"])


def test_inputs_do_not_depend_on_where_the_arm_stands() -> None:
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rotation, x = np.eye(3)[None], np.array([[1.0, 2.0, 3.0]])
    np.testing.assert_allclose(to_link(turn @ rotation, x @ turn.T), to_link(rotation, x))
