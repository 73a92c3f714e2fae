"""What the jobs of the ball-in-a-cup studies do: functions of settings and of earlier results."""

from __future__ import annotations

import importlib.util
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core, blackbox
from .._core import IdentifyResult, Model, Policy, Recording, read_policy
from .._files import load_model
from .._learn import learn
from .._learn_result import LearnResult
from .._readers.packages import install_command
from .._robot_data import identify_robot, robot_motions
from .._rollouts import RolloutTrace
from .._simulate import simulate
from .._transfer import Execution, transfer
from .guess import with_string, wrong_guess
from .jobs import Arrays, Json, Output, Result

WIDE = 0.055
"""ε of the dipole that gives rewards of the paper's size [m²]."""
STEP = 0.002
"""Of a trace [s]."""
EVERY = 5
"""Rows of a trace of which one is kept: 100 Hz, the camera's rate."""
TRACE = ("q", "ball", "cup", "axis", "phase")
IN_CUP = (1, 5)
"""Phases of an imagined ball: caught by the white-box model, inside as a network moves it."""
ENDS_AS_IT_IS = (*IN_CUP, 4)
NETWORKS = {"ff-nn": "ff", "lstm": "lstm"}
"""Kinds of the study by those of ``diffnea.blackbox``."""


def missing_for_networks() -> str:
    """Say why there can be no network here; empty: nothing is missing."""
    if importlib.util.find_spec("torch") is None:
        return f"not run: torch is not installed ({install_command('blackbox')})"
    return ""


def record(settings: Json, needs: list[Result]) -> Output:
    """Record arm and ball in a world, with motions designed for the description."""
    nominal = nominal_model(settings)
    motions = robot_motions(
        nominal,
        arm_seconds=settings["arm_seconds"],
        ball_seconds=settings["ball_seconds"],
        seed=settings["seed"],
    )
    world, data = settings["world"], {}
    arrays: Arrays = {}
    # The same robot: its perturbation is drawn by the world's own seed.
    for name, motion, where in (
        ("arm", motions.arm, f"{_without_rope(world)},ball=none"),
        ("ball", motions.ball, f"{world},repetitions={settings['repetitions']}"),
    ):
        found = simulate(
            nominal, motion.trajectory, world=named_world(where, settings), seed=settings["seed"]
        )
        if found.failure:
            raise _core.DataError(f"the recording of the {name} ended early: {found.failure}")
        arrays |= _arrays_of(name, found.recording)
        data[name] = {"joints": found.recording.joint_names, "period": found.recording.period}
    return Output(data, arrays)


def identify(settings: Json, needs: list[Result]) -> Output:
    """Fit arm and ball to a recording, from the description or from a guess that is wrong."""
    nominal = nominal_model(settings)
    guess = settings.get("guess")
    begin = nominal if guess is None else wrong_guess(nominal, guess)
    robot = identify_robot(begin, recording_of(needs[0], "arm"), recording_of(needs[0], "ball"))
    string = robot.model.to_dict()["ball"]["string"]
    return Output(
        {
            "begin": begin.to_dict(),
            "model": robot.model.to_dict(),
            "string": string["length"],
            "attachment": string["attachment"],
            "arm": _fit(robot.arm),
            "ball": _fit(robot.ball),
        }
    )


def learn_policies(settings: Json, needs: list[Result]) -> Output:
    """Search from some seeds, in the model that was identified or else in the description."""
    nominal = nominal_model(settings)
    model = Model.from_dict(needs[0].data["model"]) if needs else nominal
    learned = learn(
        model,
        controller=nominal,
        string=settings["string"],
        seeds=settings["seeds"],
        progress=False,
        **settings["search"],
    )
    return learned_output(learned)


def train_network(settings: Json, needs: list[Result]) -> Output:
    """Train a network on the recording of the ball and all that policies did in the world.

    ``needs``: identified robot, recording, executed policies. Of these the motion is without
    noise, which is more than a camera would give.
    """
    model = Model.from_dict(needs[0].data["model"])
    recordings = [recording_of(needs[1], "ball")]
    recordings += [r for result in needs[2:] for r in executed_recordings(result, model)]
    network = blackbox.train(
        NETWORKS[settings["kind"]],
        recordings,
        model,
        seed=settings["seed"],
        options=blackbox.TrainOptions(**settings["training"]),
        progress=False,
    )
    return Output({"network": network.to_dict(), "recordings": len(recordings)})


def learn_in_network(settings: Json, needs: list[Result]) -> Output:
    """Search in a network that moves the ball; ``needs``: network, identified robot."""
    network = blackbox.BallNetwork(needs[0].data["network"], needs[0].file.name)
    options: Json = settings["search"] | {"ball_network": network}
    learned = learn(
        Model.from_dict(needs[1].data["model"]),
        controller=nominal_model(settings),
        string=settings["string"],
        seeds=settings["seeds"],
        progress=False,
        **options,
    )
    return learned_output(learned)


def learned_output(learned: LearnResult) -> Output:
    """Policies, and what the model had them do."""
    traces = [learned.imagine(policy) for policy in learned.policies]
    rows = []
    for policy, trace in zip(learned.policies, traces, strict=True):
        solved_share = np.asarray(policy.curve["solved_share"])
        rows.append(
            {
                "seed": policy.seed,
                "expected": policy.expected,
                "expected_wide": paper_reward(trace, policy),
                "solved": policy.solved,
                "iterations": len(solved_share),
                "first_capture": int(np.argmax(solved_share > 0)) + 1
                if (solved_share > 0).any()
                else None,
                "rollouts": policy.rollouts,
                "policy": policy.to_dict(),
            }
        )
    return Output({"policies": rows}, _traces(traces, "imagined"))


def transfer_policies(settings: Json, needs: list[Result]) -> Output:
    """Execute policies in a world, each once without noise."""
    learned = needs[0]
    found = transfer(
        policies_of(learned),
        named_world(settings["world"], settings),
        controller=nominal_model(settings),
        repetitions=0,
        seed=settings["seed"],
    )
    traces = [e.trace for e in found.executions]
    obtained = _traces(traces, "obtained")
    imagined = learned.arrays
    rows = []
    for k, (row, execution) in enumerate(
        zip(learned.data["policies"], found.executions, strict=True)
    ):
        rows.append(
            {key: row[key] for key in ("seed", "expected", "expected_wide", "solved", "rollouts")}
            | _execution(execution)
            | {"path_error": _path_error(imagined, obtained, k)}
        )
    data: Json = {"policies": rows, "joints": policies_of(learned)[0].joints}
    return Output(data, obtained | {"fast_q": _joint_series(traces, data["joints"])})


def repeat_best(settings: Json, needs: list[Result]) -> Output:
    """Repeat, with noise, the policy that did best in the world: success first, then reward.

    ``needs``: what was learned, and then, in the same order, what became of it.
    """
    half = len(needs) // 2
    candidates = [
        (row["success"], row["reward"], chunk, k)
        for chunk, result in enumerate(needs[half:])
        for k, row in enumerate(result.data["policies"])
        if not row["failure"]
    ]
    if not candidates:
        return Output({"seed": None, "repetitions": []})
    success, reward, chunk, k = max(candidates, key=lambda c: (c[0], c[1], -c[2], -c[3]))
    policy = policies_of(needs[chunk])[k]
    found = transfer(
        policy,
        named_world(settings["world"], settings),
        controller=nominal_model(settings),
        repetitions=settings["repetitions"],
        seed=settings["seed"],
    )
    return Output(
        {
            "seed": policy.seed,
            "success": success,
            "reward": reward,
            "repetitions": [_execution(e) for e in found.repetitions],
        }
    )


def recording_of(result: Result, name: str) -> Recording:
    """Return recording ``arm`` or ``ball`` of a job's result."""
    arrays, described = result.arrays, result.data[name]
    return Recording(
        time=arrays[f"{name}_time"],
        q=arrays[f"{name}_q"],
        tau=arrays[f"{name}_tau"],
        ball=arrays.get(f"{name}_ball"),
        joint_names=described["joints"],
        period=described["period"],
        source=f"{result.file}:{name}",
    )


def executed_recordings(result: Result, model: Model) -> list[Recording]:
    """Return what executed policies were seen to do: joints at 500 Hz, the ball at 100 Hz."""
    out = []
    for k, row in enumerate(result.data["policies"]):
        q, ball = result.arrays["fast_q"][k], result.arrays["obtained_ball"][k]
        q = q[np.isfinite(q).all(axis=1)]
        if row["failure"] or len(q) < 2:
            continue
        seen = np.full((len(q), 3), np.nan)
        seen[::EVERY] = ball[: len(seen[::EVERY])]
        time = STEP * np.arange(len(q))
        source = f"{result.file.name}: policy {row['seed']}"
        joints = model.joint_names
        out.append(Recording(time=time, q=q, ball=seen, joint_names=joints, source=source))
    return out


def policies_of(result: Result) -> list[Policy]:
    """Return the policies of a learning job's result."""
    with tempfile.TemporaryDirectory(prefix="diffnea-") as folder:
        out = []
        for row in result.data["policies"]:
            path = Path(folder) / "policy.json"
            path.write_text(json.dumps(row["policy"]), encoding="utf-8")
            out.append(read_policy(path))
        return out


def paper_reward(trace: RolloutTrace, policy: Policy, epsilon: float = WIDE) -> float:
    """Return the paper's reward of what a model imagined.

    A ball that the white-box model does not catch ends as if it hung; of a network's nobody knows.
    """
    if not len(trace.time):
        return float("nan")
    options = policy.reward
    delta = trace.points("ball") - trace.points("cup")
    psi = np.sum(delta * trace.points("axis"), axis=1) / (np.sum(delta**2, axis=1) + epsilon)
    string = options["string"]
    end = (
        psi[-1]
        if trace["phase"][-1] in ENDS_AS_IT_IS
        else min(psi[-1], -string / (string**2 + epsilon))
    )
    effort = 0.0
    for joint in policy.joints:
        q, qd = trace[f"q_{joint}"], trace[f"qd_{joint}"]
        effort += options["lambda_q"] * np.mean((q - q[0]) ** 2)
        effort += options["lambda_qd"] * np.mean(qd**2)
    return float(np.exp(0.5 * psi.max() + 0.5 * end) - effort)


def nominal_model(settings: Json) -> Model:
    """Return the description, with the string that is on the robot."""
    return with_string(load_model(settings["model"]), settings["string"])


def named_world(world: str, settings: Json) -> str:
    """Return the world with the string that is on the robot; perturb changes its length."""
    return f"{world},nominal_string={settings['string']}"


def _without_rope(world: str) -> str:
    return ",".join(part for part in world.split(",") if not part.startswith("rope="))


def _arrays_of(name: str, recording: Recording) -> Arrays:
    found = {"time": recording.time, "q": recording.q, "tau": recording.tau}
    if recording.ball is not None:
        found["ball"] = recording.ball
    return {f"{name}_{key}": np.asarray(values) for key, values in found.items()}


def _fit(fit: IdentifyResult) -> Json:
    found = fit.to_dict()
    return {key: found[key] for key in ("parameters", "effects", "rmse") if key in found} | {
        "ball": found.get("ball")
    }


def _traces(traces: list[RolloutTrace], name: str) -> Arrays:
    """Arrays (policies, rows, …) at 100 Hz, float32; NaN where an episode was over."""
    rows = max((len(t.time[::EVERY]) for t in traces), default=0)
    columns: dict[str, list[str]] = {key: [] for key in TRACE}
    for channel in traces[0].channels if traces else ():
        stem, _, suffix = channel.partition("_")
        if stem == "phase" or (stem in columns and (stem == "q" or suffix in ("x", "y", "z"))):
            columns[stem].append(channel)
    out: Arrays = {}
    for key, channels in columns.items():
        values = np.full((len(traces), rows, len(channels)), np.nan, dtype=np.float32)
        for k, trace in enumerate(traces):
            kept = [trace[channel][::EVERY] for channel in channels]
            values[k, : len(kept[0])] = np.stack(kept, axis=1)
        out[f"{name}_{key}"] = values
    return out


def _joint_series(traces: list[RolloutTrace], joints: list[str]) -> np.ndarray:
    """(policies, rows, joints) at every step, float32; NaN where an episode was over."""
    rows = max(len(trace.time) for trace in traces)
    out = np.full((len(traces), rows, len(joints)), np.nan, dtype=np.float32)
    for k, trace in enumerate(traces):
        out[k, : len(trace.time)] = np.stack([trace[f"q_{joint}"] for joint in joints], axis=1)
    return out


def _execution(execution: Execution) -> Json:
    names = ("outcome", "text", "reward", "reward_wide", "failure", "success")
    return {name: getattr(execution, name) for name in names}


def _path_error(imagined: Arrays, obtained: Arrays, k: int) -> float | None:
    """Distance of the two balls in the last row before the model catches it [m]; None: never."""
    caught = np.flatnonzero(np.isin(imagined["imagined_phase"][k, :, 0], IN_CUP))
    if not len(caught) or caught[0] == 0 or caught[0] > obtained["obtained_ball"].shape[1]:
        return None
    at: Any = caught[0] - 1
    return float(
        np.linalg.norm(imagined["imagined_ball"][k, at] - obtained["obtained_ball"][k, at])
    )
