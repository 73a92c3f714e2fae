"""Killed at any moment, interrupted, on a full disk: no long command leaves half a file.

What a killed command left does not stop the next one, which ends in what it would have ended in.
"""

import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import whole_files
from cli import (
    BAD_INPUT,
    COMMAND,
    DONE,
    INTERRUPTED,
    MODELS,
    NO_USABLE_RESULT,
    PENDULUM,
    SECONDS,
    diffnea,
    done,
)

BALL = MODELS / "wam4_ball.xml"
WORLD = "mujoco:wam4_ball_in_cup,perturb=none,rope=none"
SEARCH = ("--samples", 16, "--iterations", 6)
TINY = (
    *("--models", 1, "--seeds", 1, "--chunk", 1, "--lengths", "0.40", "--simulated-lengths", ""),
    *("--surrogates", "A", "--kinds", "nominal,diffnea", "--repetitions", 2, "--rope", "none"),
    *("--arm-seconds", 5, "--ball-seconds", 5, "--ball-repetitions", 1),
    *("--search", "samples=16", "--search", "iterations=3"),
)
REPRODUCE = (sys.executable, "-m", "diffnea.reproduce")
FINISHED = (DONE, NO_USABLE_RESULT)  # so short a search need not catch the ball


@dataclass(frozen=True)
class Case:
    """A command that is started in a folder of its own and leaves ``out`` there."""

    name: str
    words: Callable[[Path], tuple[object, ...]]
    """From the folder of the inputs."""
    out: str = "out"
    interruptible: bool = True
    """Ctrl-C is its own affair; others have nothing that could be kept."""
    program: tuple[str, ...] = (COMMAND,)


CASES = [
    Case("excite", lambda d: ("excite", PENDULUM, "--duration", 10, "-o", "out.csv"), "out.csv"),
    Case(
        "simulate",
        lambda d: (
            *("simulate", MODELS / "wam4.xml", "--trajectory", d / "wam.csv", "--truth", "t.json"),
            *("--world", "mujoco:wam4,perturb=A,noise=1", "-o", "out.csv"),
        ),
        "out.csv",
        interruptible=False,
    ),
    Case("identify", lambda d: ("identify", PENDULUM, *data(d), "--robust", "huber")),
    Case("diagnose", lambda d: ("diagnose", PENDULUM, *data(d))),
    Case("learn", lambda d: ("learn", "ball-in-cup", BALL, *SEARCH, "--seeds", 2)),
    Case(
        "transfer",
        lambda d: ("transfer", d / "learned", "--world", WORLD, "--repetitions", 3, "--record"),
    ),
    Case(
        "experiment",
        lambda d: (
            *("experiment", "ball-in-cup", *SEARCH, "--repetitions", 0, "--world", WORLD),
            *("--arm-seconds", 10, "--ball-seconds", 10, "--ball-repetitions", 1, "--seeds", 1),
        ),
    ),
    Case("report", lambda d: ("report", "out"), interruptible=False),
    Case("table1", lambda d: ("table1", *TINY, "--executor", "processes:1"), program=REPRODUCE),
    Case(
        "beyond",
        lambda d: (
            *("beyond", "--robots", 1, "--seeds", 4, "--observed", 4, "--lengths", "0.40"),
            *("--ropes", "none", "--executor", "processes:1"),
        ),
        program=REPRODUCE,
    ),
]
SLOW = {"experiment", "table1", "beyond"}
SLOWEST = {"beyond"}
"""Minutes, however short: in the study alone."""


def data(folder: Path) -> tuple[object, ...]:
    return (folder / "train.csv", "--test", folder / "test.csv")


def command(case: Case, folder: Path, inputs: Path) -> list[str]:
    words = [*case.program, *map(str, case.words(inputs))]
    if "-o" not in words and case.name != "report":
        words += ["-o", case.out]
    if case.name == "report":
        shutil.copytree(inputs / "RUN", folder / "out", dirs_exist_ok=True)
    return [*words, "--quiet"]


@pytest.fixture(scope="session")
def inputs(recordings: Path, run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("inputs")
    for name in ("train", "test"):
        for suffix in (".csv", ".json"):
            shutil.copy(recordings / f"{name}{suffix}", folder)
    shutil.copytree(run, folder / "RUN")
    motion = ("--duration", 4, "--iterations", 0, "--quiet", "-o", folder / "wam.csv")
    done("excite", MODELS / "wam4.xml", *motion)
    learned = ("--seeds", 2, *SEARCH, "--quiet", "-o", folder / "learned")
    assert diffnea("learn", "ball-in-cup", BALL, *learned).returncode in FINISHED
    return folder


class Uninterrupted:
    """What a case leaves when nothing happens to it, and how long it takes; found once."""

    def __init__(self, inputs: Path, folder: Path) -> None:
        self._inputs, self._folder = inputs, folder
        self._found: dict[str, tuple[Path, float]] = {}

    def __call__(self, case: Case) -> tuple[Path, float]:
        if case.name not in self._found:
            folder = self._folder / case.name
            folder.mkdir(exist_ok=True)
            begin = time.monotonic()
            finish(case, folder, self._inputs)
            self._found[case.name] = folder, time.monotonic() - begin
        return self._found[case.name]


@pytest.fixture(scope="session")
def uninterrupted(inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Uninterrupted:
    return Uninterrupted(inputs, tmp_path_factory.mktemp("whole"))


def start(case: Case, folder: Path, inputs: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command(case, folder, inputs),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
    )


def finish(case: Case, folder: Path, inputs: Path) -> None:
    process = start(case, folder, inputs)
    _, errors = process.communicate(timeout=8 * SECONDS)
    assert process.returncode in FINISHED, errors
    whole_files.check(folder)
    assert whole_files.hidden(folder) == []


def hit(
    case: Case, folder: Path, inputs: Path, after: float, by: signal.Signals
) -> tuple[int, str]:
    """Send a signal after so many seconds; the exit status and what was said."""
    process = start(case, folder, inputs)
    try:
        _, errors = process.communicate(timeout=after)
    except subprocess.TimeoutExpired:
        process.send_signal(by)
        _, errors = process.communicate(timeout=SECONDS)
    return process.returncode, errors


def kill_again_and_again(
    case: Case, folder: Path, inputs: Path, uninterrupted: Uninterrupted, times: list[float]
) -> None:
    expected, seconds = uninterrupted(case)

    def killed(share: float) -> bool:
        status, errors = hit(case, folder, inputs, share * seconds, signal.SIGKILL)
        assert status in (-signal.SIGKILL, *FINISHED), errors
        whole_files.check(folder)
        return status == -signal.SIGKILL

    landed = [killed(share) for share in times]
    share = min(times)
    while not any(landed):  # it is faster than it was, or goes on where it was
        share /= 2
        assert share > 1e-3, "none of the signals came in time"
        landed.append(killed(share))
    finish(case, folder, inputs)
    assert whole_files.results(folder) == whole_files.results(expected)


def named(*without: str) -> list[object]:
    return [pytest.param(case, id=case.name) for case in CASES if case.name not in without]


@pytest.mark.parametrize("case", named(*SLOWEST))
def test_killed_it_leaves_whole_files_and_the_next_run_does_not_mind(
    case: Case, inputs: Path, uninterrupted: Uninterrupted, tmp_path: Path
) -> None:
    times = [0.6] if case.name in SLOW else [0.3, 0.7, 0.95]
    kill_again_and_again(case, tmp_path, inputs, uninterrupted, times)


@pytest.mark.study
@pytest.mark.parametrize("case", named())
@pytest.mark.parametrize("seed", range(3))
def test_killed_at_random_moments(
    case: Case, seed: int, inputs: Path, uninterrupted: Uninterrupted, tmp_path: Path
) -> None:
    rng = random.Random(f"{case.name} {seed}")
    count = 6 if case.name in SLOW else 20
    times = [rng.uniform(0.0, 1.1) for _ in range(count)]
    kill_again_and_again(case, tmp_path, inputs, uninterrupted, times)


@pytest.mark.parametrize("case", [p for p in named(*SLOW) if p.values[0].interruptible])
def test_interrupted_it_says_so_and_what_it_leaves_is_usable(
    case: Case, inputs: Path, uninterrupted: Uninterrupted, tmp_path: Path
) -> None:
    expected, seconds = uninterrupted(case)
    status, errors = hit(case, tmp_path, inputs, 0.5 * seconds, signal.SIGINT)
    # On a busy machine it may not have begun: then the signal itself ends it.
    assert status in (INTERRUPTED, -signal.SIGINT, *FINISHED), errors
    if status == INTERRUPTED:
        assert "interrupted" in errors
    whole_files.check(tmp_path)
    assert whole_files.hidden(tmp_path) == []
    finish(case, tmp_path, inputs)
    assert whole_files.results(tmp_path) == whole_files.results(expected)


@pytest.mark.study
@pytest.mark.parametrize("case", [p for p in named() if p.values[0].interruptible])
@pytest.mark.parametrize("seed", range(2))
def test_interrupted_at_random_moments(
    case: Case, seed: int, inputs: Path, uninterrupted: Uninterrupted, tmp_path: Path
) -> None:
    """Also while it starts: then it may end by the signal itself, and leaves nothing."""
    expected, seconds = uninterrupted(case)
    rng = random.Random(f"{case.name} {seed}")
    for _ in range(3 if case.name in SLOW else 10):
        status, errors = hit(case, tmp_path, inputs, rng.uniform(0, 1) * seconds, signal.SIGINT)
        assert status in (INTERRUPTED, -signal.SIGINT, *FINISHED), errors
        whole_files.check(tmp_path)
        assert whole_files.hidden(tmp_path) == []
    finish(case, tmp_path, inputs)
    assert whole_files.results(tmp_path) == whole_files.results(expected)


# --- a disk that is full


def refused(case: Case, folder: Path, inputs: Path, limit: int | None = None) -> str:
    """Run it where it cannot write all; it must say so in a line, and end with status 1."""

    def little_disk() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    answer = subprocess.run(
        command(case, folder, inputs),
        capture_output=True,
        text=True,
        cwd=folder,
        preexec_fn=little_disk,
        timeout=3 * SECONDS,
        check=False,
    )
    assert answer.returncode == BAD_INPUT, (answer.returncode, answer.stderr)
    lines = answer.stderr.strip().splitlines()
    assert "Traceback" not in answer.stderr
    assert "internal error" not in answer.stderr
    if case.program == (COMMAND,):
        assert len(lines) == 1, answer.stderr
    return lines[-1]


@pytest.mark.parametrize("case", named(*SLOWEST))
def test_on_a_full_disk_the_earlier_results_stay(
    case: Case, inputs: Path, uninterrupted: Uninterrupted, tmp_path: Path
) -> None:
    whole, _ = uninterrupted(case)
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    if case.name == "table1":  # its results are there already: the table cannot be replaced
        (tmp_path / "out" / "table.json").write_text("{}\n")
    before = {path: path.read_bytes() for path in whole_files.files(tmp_path)}
    largest = max(map(len, before.values()))
    # Of a study the table comes first, and is small.
    limit = 1000 if case.program == REPRODUCE else min(largest // 2, 20_000)
    message = refused(case, tmp_path, inputs, limit=limit)
    assert case.out.partition(".")[0] in message
    assert os.strerror(27) in message  # File too large
    assert {path: path.read_bytes() for path in whole_files.files(tmp_path)} == before
    assert whole_files.hidden(tmp_path) == []
    finish(case, tmp_path, inputs)  # once there is room


@pytest.fixture
def little_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own with 96 KiB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=96k", "tmpfs", str(disk)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("only root may mount a file system")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.parametrize("case", named(*SLOW))
def test_no_space_left_on_device(case: Case, inputs: Path, little_disk: Path) -> None:
    if case.name == "report":
        pytest.skip("the run itself is larger than that disk")
    message = refused(case, little_disk, inputs)
    assert os.strerror(28) in message
    assert "out" in message
    whole_files.check(little_disk)
    assert whole_files.hidden(little_disk) == []
