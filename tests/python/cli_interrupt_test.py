"""`diffnea identify`, interrupted, interrupted twice, and killed."""

import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
from cli import COMMAND, INTERRUPTED, PENDULUM, RUN_FILES, SECONDS, Table, done, edited, load


def interrupted(
    arguments: list[object], after: str, by: signal.Signals = signal.SIGINT
) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [COMMAND, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith(after):
            process.send_signal(by)
            break
    return process


@pytest.fixture(scope="session")
def long_recording(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The training data forty times over, as runs of one file: seconds of work."""

    def repeat(table: Table) -> Table:
        runs = [[*row, str(run)] for run in range(40) for row in table[1:]]
        return [[*table[0], "run"], *runs]

    return edited(recordings / "train.csv", tmp_path_factory.mktemp("long") / "long.csv", repeat)


def test_ctrl_c_keeps_what_there_is(long_recording: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    process = interrupted(
        ["identify", PENDULUM, long_recording, "--robust", "cauchy", "-o", run], after="reading"
    )
    _, errors = process.communicate(timeout=SECONDS)
    assert process.returncode == INTERRUPTED, errors
    assert "interrupted" in errors
    assert {path.name for path in run.iterdir()} == RUN_FILES
    summary: dict[str, Any] = load(run / "result.json")["summary"]
    assert summary["interrupted"]
    assert "interrupted" in summary["termination"]


def test_the_second_ctrl_c_ends_it_at_once(long_recording: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    process = interrupted(
        ["identify", PENDULUM, long_recording, "-o", run], after="opening", by=signal.SIGSTOP
    )
    # Two of one kind would be merged; these wait for each other until the program goes on.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGCONT):
        process.send_signal(number)
    process.communicate(timeout=SECONDS)
    assert process.returncode in {
        -signal.SIGINT,
        -signal.SIGTERM,
    }  # the later one's turn is not set
    assert not run.exists()


def test_what_a_killed_run_left_goes_with_the_next(
    long_recording: Path, recordings: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    process = interrupted(
        ["identify", PENDULUM, long_recording, "-o", run], after="reading", by=signal.SIGKILL
    )
    process.communicate(timeout=SECONDS)
    assert process.returncode == -signal.SIGKILL
    assert [path.name for path in run.iterdir()] == [f".partial-{process.pid}"]
    done("identify", PENDULUM, recordings / "train.csv", "-o", run)
    assert {path.name for path in run.iterdir()} == RUN_FILES
