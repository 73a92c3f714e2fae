"""`diffnea excite` as a program sees it: the motion, what is said of it, and what is refused."""

import csv
import json
import signal
import subprocess
from pathlib import Path

import pytest
from cli import (
    BAD_INPUT,
    COMMAND,
    DONE,
    INTERRUPTED,
    MODELS,
    PENDULUM,
    SECONDS,
    WRONG_USAGE,
    diffnea,
    done,
)

WAM = MODELS / "wam4.xml"


def columns(path: Path) -> dict[str, list[float]]:
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {name: [float(row[name]) for row in rows] for name in rows[0]}


def test_the_result_says_what_was_gained_and_what_is_used(tmp_path: Path) -> None:
    motion = tmp_path / "motion.csv"
    printed = done("excite", WAM, "--duration", 10, "--seed", 1, "-o", motion, "--json", "--quiet")
    result = json.loads(printed)
    assert result["schema"] == "diffnea/excite/1"
    assert result["trajectory"] == str(motion)
    assert not result["interrupted"]
    information = result["information"]
    assert information["std_ratio"] < 0.8  # standard errors against the median random motion
    low, high = information["std_ratio_range"]
    assert low <= information["std_ratio"] <= high
    assert information["log_det"] > information["random_log_det"]
    for joint in result["joints"]:
        for share in joint["limits_used"].values():
            assert share is None or 0.0 < share <= 1.0
    assert any("models state no acceleration limits" in note for note in result["notes"])
    data = columns(motion)
    assert {"time", "qcmd_joint1", "qdcmd_joint1", "qddcmd_joint1"} <= set(data)
    assert len(data["time"]) == result["rows"] == 5001


def test_a_person_reads_the_ratio(tmp_path: Path) -> None:
    answer = diffnea("excite", PENDULUM, "--iterations", 20, "-o", tmp_path / "motion.csv")
    assert "expected standard errors of the" in answer.stderr
    assert "times those of a random motion" in answer.stderr
    assert answer.stdout == ""


def test_the_same_seed_gives_the_same_file(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("one.csv", "same.csv", "other.csv")]
    for file, seed in zip(files, (5, 5, 6), strict=True):
        done("excite", PENDULUM, "--iterations", 20, "--seed", seed, "-o", file, "--quiet")
    one, same, other = (file.read_bytes() for file in files)
    assert one == same
    assert one != other


def test_limits_that_are_given_hold(tmp_path: Path) -> None:
    motion = tmp_path / "motion.csv"
    limits = (
        *("--position-limit", "shoulder=0.2:0.6"),
        *("--velocity-limit", "1.5,elbow=0.7"),
        *("--acceleration-limit", "3"),
        *("--torque-limit", "shoulder=2.5"),
    )
    printed = done("excite", PENDULUM, *limits, "--iterations", 50, "-o", motion, "--json")
    data = columns(motion)
    assert min(data["qcmd_shoulder"]) >= 0.2
    assert max(data["qcmd_shoulder"]) <= 0.6
    assert max(map(abs, data["qdcmd_shoulder"])) <= 1.5
    assert max(map(abs, data["qdcmd_elbow"])) <= 0.7
    assert max(map(abs, data["qddcmd_elbow"] + data["qddcmd_shoulder"])) <= 3.0
    use = {joint["joint"]: joint["limits_used"] for joint in json.loads(printed)["joints"]}
    assert 0.0 < use["shoulder"]["torque"] <= 1.0
    assert 0.0 < use["elbow"]["torque"] <= 1.0


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (("--torque-limit", "joint2=0.5", "--position-limit", "joint2=1.4:1.7"), BAD_INPUT,
         ("joint 'joint2'", "raise the torque limit", "--torque-limit")),
        (("--velocity-limit", "knee=1"), BAD_INPUT, ("knee", "joint1, joint2")),
        (("--velocity-limit", "0"), BAD_INPUT, ("limit of 0", "above 0")),
        (("--position-limit", "joint1=1:-1"), BAD_INPUT, ("inverted",)),
        (("--rate", "1"), BAD_INPUT, ("rate is too low",)),
        (("--harmonics", "2"), BAD_INPUT, ("3 or more",)),
        (("--velocity-limit", "joint1=fast"), WRONG_USAGE, ("'fast' is no number",)),
        (("--position-limit", "joint1=1"), WRONG_USAGE, ("LOW:HIGH",)),
    ],
)  # fmt: skip
def test_what_cannot_be_met_is_refused(
    tmp_path: Path, arguments: tuple[str, ...], status: int, words: tuple[str, ...]
) -> None:
    motion = tmp_path / "motion.csv"
    answer = diffnea("excite", WAM, *arguments, "--iterations", 3, "-o", motion, "--quiet")
    assert answer.returncode == status, answer.stderr
    for word in words:
        assert word in answer.stderr
    assert not motion.exists()


@pytest.mark.parametrize("output", ["nowhere/motion.csv", "folder"])
def test_what_cannot_be_written_is_refused_before_the_work(tmp_path: Path, output: str) -> None:
    (tmp_path / "folder").mkdir()
    long = ("--iterations", 100_000, "-o", tmp_path / output)
    assert diffnea("excite", WAM, *long).returncode == BAD_INPUT
    motion = tmp_path / "motion.csv"
    done("excite", PENDULUM, "--duration", 10, "--iterations", 0, "-o", motion)
    follow = ("simulate", PENDULUM, "--trajectory", motion, "-o")
    assert diffnea(*follow, tmp_path / output).returncode == BAD_INPUT
    truth = diffnea(*follow, tmp_path / "log.csv", "--truth", tmp_path / output)
    assert truth.returncode == BAD_INPUT
    assert output in truth.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"folder", "motion.csv"}


def test_quiet_leaves_the_result(tmp_path: Path) -> None:
    motion = tmp_path / "motion.csv"
    words = ("--duration", 10, "--iterations", 0, "-o", motion, "--quiet")
    answer = diffnea("excite", PENDULUM, *words)
    assert answer.returncode == DONE
    assert f"{motion}: " in answer.stderr
    assert "designing" not in answer.stderr
    arm = diffnea("export", MODELS / "wam4.xml", "-o", tmp_path / "arm.urdf", "--quiet")
    assert arm.stdout == ""
    assert "arm.urdf cannot hold:\n  " in arm.stderr


def test_an_interrupted_search_leaves_the_best_so_far(tmp_path: Path) -> None:
    motion = tmp_path / "motion.csv"
    command = [COMMAND, "excite", WAM, "--iterations", "100000", "-o", motion]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert "designing" in process.stderr.readline()  # the search runs
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=SECONDS)
    assert process.returncode == INTERRUPTED
    assert "best motion until then" in errors
    assert len(columns(motion)["time"]) == 10001


def test_simulate_says_which_joint_does_not_follow(tmp_path: Path) -> None:
    motion, log = tmp_path / "motion.csv", tmp_path / "log.csv"
    done("excite", WAM, "--duration", 10, "--seed", 1, "-o", motion, "--quiet")
    follows = diffnea("simulate", WAM, "--trajectory", motion, "-o", log)
    assert "off its command" not in follows.stderr
    world = ("--world", "mujoco:wam4,perturb=A,seed=1")
    soft = diffnea("simulate", WAM, "--trajectory", motion, "-o", log, *world, "--kp", 1, 1, 1, 1)
    assert "log.csv: joint2 is off its command by" in soft.stderr
    assert "--kp" in soft.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("--kp", "-1", "-1"),
        ("--kd", "1", "-1"),
        ("--noise", "-1"),
        ("--rate", "0"),
        ("--kp", "inf"),
    ],
)
def test_simulate_refuses_what_cannot_be(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    motion = tmp_path / "motion.csv"
    done("excite", PENDULUM, "--duration", 10, "-o", motion)
    answer = diffnea(
        *("simulate", PENDULUM, "--trajectory", motion, "-o", tmp_path / "data.csv"), *arguments
    )
    assert answer.returncode == WRONG_USAGE, answer.stderr
    assert not (tmp_path / "data.csv").exists()


def test_excite_says_what_it_does_without_limits(tmp_path: Path) -> None:
    answer = diffnea("excite", PENDULUM, "--duration", 10, "-o", tmp_path / "motion.csv")
    assert "no position limits" in answer.stderr
    printed = done("excite", PENDULUM, "--duration", 10, "-o", tmp_path / "motion.csv", "--json")
    assert any("no position limits" in note for note in json.loads(printed)["notes"])
