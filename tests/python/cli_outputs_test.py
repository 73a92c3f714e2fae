"""Where a command writes: what is there stays, unless a run of its own left it."""

import os
import shutil
from pathlib import Path

import pytest
from cli import BAD_INPUT, PENDULUM, RUN_FILES, diffnea, done, edited, refused


def test_a_later_run_replaces_an_earlier_one(recordings: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    train = recordings / "train.csv"
    done("identify", PENDULUM, train, "-o", run)
    (run / "mine.txt").write_text("kept")
    done("identify", run / "model.json", train, "-o", run)
    # The second model is JSON: the first one's URDF would be of another fit.
    assert {path.name for path in run.iterdir()} == RUN_FILES - {"model.urdf"} | {"mine.txt"}


def test_a_run_that_fails_leaves_the_earlier_one_alone(recordings: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    done("identify", PENDULUM, recordings / "train.csv", "-o", run)
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    bad = edited(recordings / "train.csv", tmp_path / "bad.csv", lambda t: t[:20])
    assert diffnea("identify", PENDULUM, bad, "-o", run).returncode == BAD_INPUT
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before


def test_an_input_is_never_overwritten(tmp_path: Path) -> None:
    motion, model = tmp_path / "motion.csv", tmp_path / "arm.json"
    done("excite", PENDULUM, "--duration", 10, "-o", motion)
    done("simulate", PENDULUM, "--trajectory", motion, "-o", tmp_path / "a.csv", "--truth", model)
    before = {path: path.read_bytes() for path in (motion, model)}
    for output in (motion, tmp_path / "arm.csv"):  # the second one's sidecar would be arm.json
        answer = diffnea("simulate", model, "--trajectory", motion, "-o", output)
        assert answer.returncode == BAD_INPUT
        assert "is an input" in answer.stderr
    assert diffnea("excite", model, "-o", model).returncode == BAD_INPUT
    assert {path: path.read_bytes() for path in before} == before


def test_what_no_run_left_in_the_folder_stays(recordings: Path, tmp_path: Path) -> None:
    data = shutil.copy(recordings / "train.csv", tmp_path / "recording_1.csv")
    done("identify", PENDULUM, data, "-o", tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == RUN_FILES | {"recording_1.csv"}


@pytest.mark.parametrize("command", ["identify", "diagnose"])
@pytest.mark.parametrize("name", ["result.json", "series.json", "model.xml"])
def test_a_file_that_diffnea_did_not_write_stays(
    recordings: Path, tmp_path: Path, command: str, name: str
) -> None:
    (tmp_path / name).write_text('{"mine": 1}')
    answer = diffnea(command, PENDULUM, recordings / "train.csv", "-o", tmp_path)
    assert answer.returncode == BAD_INPUT
    assert f"{name}: was not left by diffnea" in answer.stderr
    assert (tmp_path / name).read_text() == '{"mine": 1}'
    assert {path.name for path in tmp_path.iterdir()} == {name}


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_a_model_is_not_overwritten_by_its_fit(
    recordings: Path, tmp_path: Path, command: str
) -> None:
    model = shutil.copy(PENDULUM, tmp_path / "model.urdf")
    answer = diffnea(command, model, recordings / "train.csv", "-o", tmp_path)
    assert answer.returncode == BAD_INPUT
    assert "model.urdf: was not left by diffnea" in answer.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"model.urdf"}


def test_what_a_killed_run_left_is_replaced(recordings: Path, tmp_path: Path) -> None:
    done("identify", PENDULUM, recordings / "train.csv", "-o", tmp_path)
    for path in tmp_path.iterdir():  # series.json is published first, result.json last
        if path.name not in ("series.json", "model.json"):
            path.unlink()
    done("identify", PENDULUM, recordings / "train.csv", "-o", tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == RUN_FILES


def test_the_result_of_another_command_stays(recordings: Path, tmp_path: Path) -> None:
    done("identify", PENDULUM, recordings / "train.csv", "-o", tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    model = tmp_path / "model.json"
    answer = diffnea("diagnose", model, recordings / "train.csv", "-o", tmp_path)
    assert answer.returncode == BAD_INPUT
    assert "holds another command's result (diffnea/identify/" in answer.stderr
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_folder_that_cannot_be_written(recordings: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    answer = diffnea(
        "identify", PENDULUM, recordings / "train.csv", "-o", tmp_path / "file" / "run"
    )
    assert answer.returncode == BAD_INPUT
    assert str(tmp_path / "file" / "run") in answer.stderr
    assert "reading" not in answer.stderr  # known before the work


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission(recordings: Path, tmp_path: Path) -> None:
    (tmp_path / "closed").mkdir(mode=0o500)
    message = refused(tmp_path / "closed" / "run", PENDULUM, recordings / "train.csv")
    assert "closed" in message
