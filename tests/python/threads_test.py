"""The number of threads is nobody's result: the same bytes on one, two and four of them."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli import DONE, MODELS, NO_USABLE_RESULT, PENDULUM, diffnea, done, load

import diffnea as python

BALL = MODELS / "wam4_ball.xml"
WORLD = "mujoco:wam4_ball_in_cup,perturb=A,noise=1"
COUNTS = (1, 2, 4)
OF_THE_RUN = {"seconds", "seconds_fitting", "cpu_seconds", "threads", "command"}
"""What a result says of how it was made, and a page shows."""


def without(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: without(v) for k, v in value.items() if k not in OF_THE_RUN}
    return [without(v) for v in value] if isinstance(value, list) else value


def left(folder: Path) -> dict[str, bytes]:
    """All files, JSON without what is of the run; text, so that every digit counts."""
    out = {}
    for path in sorted(folder.rglob("*")):
        if not path.is_file() or path.suffix == ".html" or "checkpoints" in path.parts:
            continue
        if path.suffix == ".json":
            out[path.name] = json.dumps(without(load(path))).encode()
        else:
            out[path.name] = path.read_bytes()
    return out


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("learned")
    few = ("--samples", 16, "--iterations", 4, "--seeds", 3, "--quiet")
    answer = diffnea("learn", "ball-in-cup", BALL, *few, "-o", folder)
    assert answer.returncode in (DONE, NO_USABLE_RESULT)
    return folder


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("motion") / "wam.csv"
    words = ("--duration", 4, "--iterations", 0, "--quiet", "-o", path)
    done("excite", MODELS / "wam4.xml", *words)
    return path


@pytest.mark.parametrize(
    "words",
    [
        ("identify", PENDULUM, "{train}", "--test", "{test}", "--robust", "huber"),
        ("identify", PENDULUM, "{train}", "--loss", "motion", "--horizon", 0.5),
        ("diagnose", PENDULUM, "{train}", "--test", "{test}"),
        ("transfer", "{learned}", "--world", WORLD, "--repetitions", 3, "--record"),
        ("learn", "ball-in-cup", BALL, "--samples", 24, "--iterations", 5),
        ("learn", "ball-in-cup", BALL, "--samples", 16, "--iterations", 4, "--seeds", 3),
    ],
    ids=["identify", "motion", "diagnose", "transfer", "rollouts", "seeds"],
)
def test_a_command_leaves_the_same_files(
    words: tuple[object, ...], recordings: Path, learned: Path, tmp_path: Path
) -> None:
    inputs = {"train": recordings / "train.csv", "test": recordings / "test.csv"}
    given = [str(word).format(learned=learned, **inputs) for word in words]
    found = []
    for threads in COUNTS:
        folder = tmp_path / str(threads)
        answer = diffnea(*given, "--threads", threads, "--quiet", "-o", folder)
        assert answer.returncode in (DONE, NO_USABLE_RESULT), answer.stderr
        found.append(left(folder))
    assert found[0].keys() == found[1].keys() == found[2].keys()
    for name, content in found[0].items():
        assert content == found[1][name], name
        assert content == found[2][name], name


def test_a_recording_is_the_same(motion: Path, tmp_path: Path) -> None:
    """Repetitions in a world that are averaged."""
    found = []
    for threads in COUNTS:
        file = tmp_path / f"{threads}.csv"
        world = ("--world", "mujoco:wam4,perturb=A,repetitions=3", "--threads", threads)
        wam = MODELS / "wam4.xml"
        done("simulate", wam, "--trajectory", motion, *world, "--quiet", "-o", file)
        found.append(file.read_bytes())
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize("size", [1.0, 30.0, 1e6])
def test_rows_of_a_batch_do_not_know_of_each_other(size: float) -> None:
    """Which rows share a pack of lanes depends on the number of threads; no bit of a row does."""
    model = python.load_model("wam4")
    n = len(model.joint_names)
    q, qd, x = np.random.default_rng(3).normal(scale=size, size=(3, 1003, n))
    for function, name in (
        (python.rnea, "qdd"),
        (python.aba, "tau"),
        (python.regressor, "qdd"),
    ):
        one = function(model, q=q, qd=qd, **{name: x})
        for threads in (2, 3, 4):
            assert np.array_equal(function(model, q=q, qd=qd, threads=threads, **{name: x}), one)


def test_results_of_calls_side_by_side_are_those_of_calls_in_turn(arm, train) -> None:
    def answers(seed: int) -> str:
        fit = python.identify(arm, train).to_dict()
        finding = python.diagnose(arm, train, seed=seed, grey_box=False).to_dict()
        return json.dumps(without([fit, finding]), default=str)

    in_turn = [answers(seed) for seed in range(3)]
    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(answers, range(3))) == in_turn
