"""`diffnea learn` and `transfer`: killed and gone on, refused, the same on any threads."""

import inspect
import json
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from cli import (
    BAD_INPUT,
    COMMAND,
    DONE,
    INTERRUPTED,
    MODELS,
    NO_USABLE_RESULT,
    SECONDS,
    WRONG_USAGE,
    diffnea,
    done,
    load,
)

import diffnea as module

WAM = MODELS / "wam4_ball.xml"
LEARNED = (DONE, NO_USABLE_RESULT)  # so few iterations need not catch the ball
SMALL = ("--samples", 24, "--iterations", 12, "--quiet")
ENDLESS = ("--iterations", 2000, "--stop-std", 1e-9, "--threads", 1)


def learn(out: Path, *words: object, model: object = WAM) -> subprocess.CompletedProcess[str]:
    return diffnea("learn", "ball-in-cup", model, *SMALL, *words, "-o", out)


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("learned")
    assert learn(folder, "--seeds", 2, "--threads", 2).returncode in LEARNED
    return folder


def strip_time(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: strip_time(v) for k, v in value.items() if k != "seconds"}
    return [strip_time(v) for v in value] if isinstance(value, list) else value


def same_policies(a: Path, b: Path, seeds: int) -> None:
    for seed in range(seeds):
        name = f"policy_{seed}.json"
        assert strip_time(load(a / name)) == strip_time(load(b / name)), name


def test_the_number_of_threads_does_not_matter(learned: Path, tmp_path: Path) -> None:
    assert learn(tmp_path / "one", "--seeds", 2, "--threads", 1).returncode in LEARNED
    assert learn(tmp_path / "single", "--threads", 2).returncode in LEARNED  # rollouts are divided
    same_policies(learned, tmp_path / "one", 2)
    same_policies(learned, tmp_path / "single", 1)


@contextmanager
def searching(out: Path, *words: object) -> Iterator[subprocess.Popen[str]]:
    """A search that is in its midst: it has left a checkpoint. Killed at the end, if not before."""
    process = subprocess.Popen(
        [COMMAND, "learn", "ball-in-cup", str(WAM), *map(str, words), "-o", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        checkpoint = out / "checkpoints" / "seed_0.json"
        deadline = time.monotonic() + SECONDS
        while not checkpoint.exists() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.002)
        assert checkpoint.exists()
        yield process
    finally:
        process.kill()
        process.communicate()


def killed(out: Path, *words: object) -> None:
    """A search that was killed in its midst; another one where it ended before the signal."""
    for _ in range(10):
        with searching(out, *words) as process:
            process.kill()
            process.communicate()
        if process.returncode == -signal.SIGKILL and not (out / "result.json").exists():
            return
        shutil.rmtree(out)
    pytest.fail("ten searches were over before they could be killed")


def test_killed_it_goes_on_to_the_same_result(learned: Path, tmp_path: Path) -> None:
    out = tmp_path / "killed"
    killed(out, *SMALL, "--threads", 1)
    assert learn(out, "--threads", 1).returncode in LEARNED
    same_policies(learned, out, 1)
    assert not list(out.glob(".partial*"))


ROBUST = ("--robust", "--draws", 8, "--each", 2, "--vary", "string.string_mass.mass_ratio=0:0.1")


def test_in_draws_of_what_may_vary(tmp_path: Path) -> None:
    one, two, again = (tmp_path / name for name in ("one", "two", "again"))
    assert learn(one, *ROBUST, "--threads", 1).returncode in LEARNED
    assert learn(two, *ROBUST, "--threads", 2).returncode in LEARNED
    same_policies(one, two, 1)
    killed(again, *SMALL, *ROBUST, "--threads", 1)
    assert learn(again, *ROBUST, "--threads", 1).returncode in LEARNED
    same_policies(one, again, 1)
    policy, result = load(one / "policy_0.json"), load(one / "result.json")
    assert policy["in_draws"]["draws"] == 64
    assert result["policies"][0]["in_draws"] == policy["in_draws"]
    assert result["task"]["robust"]["each"] == 2
    # Each that keeps within the limits, twice.
    assert policy["rollouts"] % 2 == 0
    assert "8 draws of the posterior" in (one / "report.html").read_text(encoding="utf-8")
    other = learn(one, "--threads", 1)
    assert other.returncode == BAD_INPUT
    assert "of another task" in other.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--robust",), "has no posterior"),
        (("--vary", "string.length=0.39:0.41"), "--robust"),
        (("--quantile", 0.1), "--robust"),
        (("--robust", "--vary", "string.length=0.4"), "PARAMETER=LOW:HIGH"),
        (("--robust", "--vary", "string.strin_mass.mass_ratio=0:1"), "string_mass"),
        ((*ROBUST[:3], "--each", 9, *ROBUST[5:]), "at most the 8 draws"),
        (("--robust", "--vary", "elbow.joint_elasticity.stiffness=1:2"), "elbow"),
    ],
)
def test_draws_that_cannot_be_are_said(
    words: tuple[object, ...], message: str, tmp_path: Path
) -> None:
    answer = learn(tmp_path / "out", *words)
    assert answer.returncode == BAD_INPUT
    assert message in answer.stderr


def test_interrupted_it_leaves_what_was_learned(tmp_path: Path) -> None:
    out = tmp_path / "interrupted"
    with searching(out, *ENDLESS) as process:
        process.send_signal(signal.SIGINT)
        _, text = process.communicate(timeout=SECONDS)
    assert process.returncode == INTERRUPTED
    assert "goes on from there" in text
    assert (out / "policy_0.json").is_file()
    assert (out / "report.html").is_file()


def test_a_folder_of_another_run_is_not_touched(learned: Path, tmp_path: Path) -> None:
    folder = tmp_path / "policies"
    shutil.copytree(learned, folder)
    before = {path.name: path.read_bytes() for path in folder.glob("*.json")}
    answers = [
        diffnea("transfer", folder, "--repetitions", 0, "--quiet", "-o", folder),
        learn(folder, "--seeds", 1),  # the policy of the other seed would be lost
        learn(folder, "--seed", 5),
    ]
    for answer in answers:
        assert answer.returncode == BAD_INPUT
        assert "would be lost" in answer.stderr
    assert before == {path.name: path.read_bytes() for path in folder.glob("*.json")}


def test_more_iterations_go_on_and_the_same_again_changes_nothing(tmp_path: Path) -> None:
    out, whole = tmp_path / "out", tmp_path / "whole"
    few = ("--samples", 24, "--iterations", 5, "--quiet", "--seed", 3)
    diffnea("learn", "ball-in-cup", WAM, *few, "-o", out)
    first = (out / "policy_3.json").read_bytes()
    diffnea("learn", "ball-in-cup", WAM, *few, "-o", out)
    assert first == (out / "policy_3.json").read_bytes()
    learn(out, "--seed", 3)
    learn(whole, "--seed", 3)
    assert strip_time(load(out / "policy_3.json")) == strip_time(load(whole / "policy_3.json"))


def test_nothing_caught_is_no_usable_result(tmp_path: Path) -> None:
    answer = learn(tmp_path / "far", "--weight-std", 1e6)
    assert answer.returncode == NO_USABLE_RESULT
    assert "broke a joint's limit" in answer.stderr
    assert (tmp_path / "far" / "report.html").is_file()


def test_two_processes_do_not_learn_in_one_folder(tmp_path: Path) -> None:
    out = tmp_path / "shared"
    with searching(out, *ENDLESS):
        answer = diffnea("learn", "ball-in-cup", WAM, "--quiet", "-o", out)
    assert answer.returncode == BAD_INPUT
    assert "another process" in answer.stderr


def test_checkpoints_of_another_task_are_refused(learned: Path, tmp_path: Path) -> None:
    out = tmp_path / "copy"
    shutil.copytree(learned, out)
    answer = learn(out, "--lambda-q", 0.5)
    assert answer.returncode == BAD_INPUT
    assert "--fresh" in answer.stderr
    assert learn(out, "--lambda-q", 0.5, "--fresh").returncode in LEARNED


@pytest.mark.parametrize(
    ("words", "needle"),
    [
        (("--start", "0,0.6,0,-0.9"), "cup's axis"),
        (("--string", 0.05), "does not reach over the rim"),
        (("--start", "0,0.6"), "start"),
        (("--joints", "joint9"), "joint9"),
        (("--kp", "1,2"), "kp"),
        (("--start", "2.7,0.6,0,1.25"), "joint1"),
    ],
)
def test_a_task_that_cannot_be_is_refused(
    tmp_path: Path, words: tuple[object, ...], needle: str
) -> None:
    answer = learn(tmp_path / "out", *words)
    assert answer.returncode == BAD_INPUT, answer.stderr
    assert needle in answer.stderr
    assert len(answer.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out" / "result.json").exists()


def test_a_model_without_cup_or_ball_is_refused(tmp_path: Path) -> None:
    text = WAM.read_text(encoding="utf-8").replace('numeric name="cup"', 'numeric name="mug"')
    without_cup = tmp_path / "no_cup.xml"
    without_cup.write_text(text, encoding="utf-8")
    answer = learn(tmp_path / "a", model=without_cup)
    assert answer.returncode == BAD_INPUT
    assert "has no cup" in answer.stderr
    answer = learn(tmp_path / "b", model=MODELS / "panda.urdf")
    assert answer.returncode == BAD_INPUT


def test_options_out_of_range_are_wrong_usage(tmp_path: Path) -> None:
    wrong = {
        "--seeds": 0,
        "--epsilon": 0,
        "--duration": "nan",
        "--kappa": -1,
        "--bases": 1,
        "--hold": 0.1,
    }
    for words in wrong.items():
        answer = learn(tmp_path / "out", *words)
        assert answer.returncode == WRONG_USAGE, (words, answer.stderr)


def test_a_full_disk_at_a_checkpoint_is_said(tmp_path: Path) -> None:
    def little_disk() -> None:  # files may grow to 3 kB; the signal of that is not ours to die of
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))

    answer = subprocess.run(
        [COMMAND, "learn", "ball-in-cup", str(WAM), *map(str, SMALL), "-o", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        preexec_fn=little_disk,
        timeout=SECONDS,
        check=False,
    )
    assert answer.returncode == BAD_INPUT
    assert "checkpoints" in answer.stderr
    for path in (tmp_path / "out" / "checkpoints").glob("*.json"):
        load(path)  # whole, or not there


def test_a_motion_beyond_the_limits_fails_alone(learned: Path, tmp_path: Path) -> None:
    folder = tmp_path / "policies"
    shutil.copytree(learned, folder)
    path = folder / "policy_0.json"
    text = load(path)
    text["mean"][0] = 40.0
    path.write_text(json.dumps(text), encoding="utf-8")
    said = done("transfer", folder, "--repetitions", 0, "-o", tmp_path / "out", "--quiet")
    broken, other = load(tmp_path / "out" / "result.json")["policies"]
    assert "breaks a limit: joint2" in broken["failure"]
    assert broken["outcome"] == "failed"
    assert "breaks a limit: joint2" in said
    assert other["failure"] is None


def test_where_no_motion_can_be_executed_none_is_recorded(learned: Path, tmp_path: Path) -> None:
    folder, out = tmp_path / "policies", tmp_path / "out"
    shutil.copytree(learned, folder)
    for path in folder.glob("policy_*.json"):
        text = load(path)
        text["mean"][0] = 40.0
        path.write_text(json.dumps(text), encoding="utf-8")
    answer = diffnea("transfer", folder, "--repetitions", 0, "--record", "-o", out, "--quiet")
    assert answer.returncode == NO_USABLE_RESULT
    assert "recording_0.csv: was not recorded: the motion breaks a limit" in answer.stderr
    assert (out / "result.json").is_file()
    assert not list(out.glob("recording_*"))


def test_transfer_refuses_another_controller(learned: Path, tmp_path: Path) -> None:
    folder = tmp_path / "policies"
    shutil.copytree(learned, folder)
    path = folder / "policy_0.json"
    text = load(path)
    text["controller"]["kp"][1] = 1e9
    path.write_text(json.dumps(text), encoding="utf-8")
    answer = diffnea("transfer", folder, "--repetitions", 0, "-o", tmp_path / "out", "--quiet")
    assert answer.returncode == BAD_INPUT
    assert "controller" in answer.stderr


def test_transfer_refuses_other_worlds_and_folders(learned: Path, tmp_path: Path) -> None:
    for world in ("mujoco:wam4", "mujoco:furuta", "mujoco:nothing"):
        answer = diffnea("transfer", learned, "--world", world, "-o", tmp_path / "out")
        assert answer.returncode == BAD_INPUT, (world, answer.stderr)
    answer = diffnea("transfer", tmp_path, "-o", tmp_path / "out")
    assert answer.returncode == BAD_INPUT
    assert "result.json" in answer.stderr


def test_transfer_is_json_alone_and_the_same_again(learned: Path, tmp_path: Path) -> None:
    words = (
        "--world",
        "mujoco:wam4_ball_in_cup,perturb=none",
        "--rope",
        "none",
        "--repetitions",
        2,
    )
    first = json.loads(done("transfer", learned, *words, "-o", tmp_path / "a", "--json"))
    again = ("-o", tmp_path / "b", "--json", "--threads", 1)
    second = json.loads(done("transfer", learned, *words, *again))
    assert strip_time(first["policies"]) == strip_time(second["policies"])
    assert strip_time(first["repetitions"]) == strip_time(second["repetitions"])


def test_one_world_is_the_default_and_says_how_it_differs(learned: Path, tmp_path: Path) -> None:
    world = inspect.signature(module.transfer).parameters["world"].default
    for command in ("transfer", "experiment"):
        assert f"={world}" in "".join(done(command, "--help").split())
    answer = done("transfer", learned, "--repetitions", 0, "-o", tmp_path / "out")
    result = load(tmp_path / "out" / "result.json")
    assert result["world"] == world
    assert "inertias +10…+20 %" in result["differences"]
    sentence = f"The world differs from its description: {'; '.join(result['differences'])}."
    assert sentence in answer
    assert sentence in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    (tmp_path / "seeds").mkdir()
    # Another --seed is other noise, not another robot.
    other = ("--repetitions", 0, "--seed", 7, "-o", tmp_path / "seeds")
    done("transfer", learned, *other)
    same = load(tmp_path / "seeds" / "result.json")
    rewards = [[policy["reward"] for policy in r["policies"]] for r in (result, same)]
    assert rewards[0] == rewards[1]


@pytest.fixture
def unwritable(tmp_path: Path) -> Iterator[Path]:
    path = tmp_path / "file"
    path.write_text("", encoding="utf-8")
    yield path
    assert path.stat().st_size == 0


def test_an_output_that_is_a_file_is_refused(unwritable: Path) -> None:
    answer = learn(unwritable)
    assert answer.returncode == BAD_INPUT
    assert str(unwritable) in answer.stderr


@pytest.mark.parametrize("name", ["arm.csv", "identify-ball/model.json", "policy/result.json"])
def test_an_experiment_keeps_what_is_not_its_own(tmp_path: Path, name: str) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("mine")
    answer = diffnea("experiment", "ball-in-cup", "--fresh", "-o", tmp_path)
    assert answer.returncode == BAD_INPUT
    assert name in answer.stderr
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [tmp_path / name]


def test_an_experiment_goes_on_and_is_not_mixed_with_another(tmp_path: Path) -> None:
    out = tmp_path / "loop"
    short = ("--arm-seconds", 10, "--ball-seconds", 10, "--ball-repetitions", 1)
    short += ("--seeds", 1, "--repetitions", 0)
    words = ("experiment", "ball-in-cup", *short, *SMALL, "-o", out)
    world = "mujoco:wam4_ball_in_cup,perturb=none,rope=none"
    assert diffnea(*words, "--world", world).returncode in LEARNED
    files = [out / "arm.csv", out / "ball.csv", out / "identify-ball" / "model.json"]
    before = [(path.read_bytes(), path.stat().st_mtime_ns) for path in files]
    assert diffnea(*words, "--world", world).returncode in LEARNED  # nothing is recorded again
    answer = diffnea(*words, "--world", world.replace("none,rope", "A,rope"))
    assert answer.returncode == BAD_INPUT
    assert "holds another experiment" in answer.stderr
    assert before == [(path.read_bytes(), path.stat().st_mtime_ns) for path in files]
