"""What a command or a call would overwrite, and options that nothing would look at."""

import json
from pathlib import Path

import numpy as np
import pytest
from cli import BAD_INPUT, PENDULUM, WRONG_USAGE, diffnea, done

import diffnea as module


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("motion") / "motion.csv"
    time = np.arange(0, 1, 0.01)
    q = 0.1 * np.sin(2 * np.pi * time) ** 2
    names = json.loads(done("info", PENDULUM, "--json"))["joints"]
    columns = {"time": time}
    for name in names:
        columns[f"qcmd_{name}"] = q
        columns[f"qdcmd_{name}"] = np.gradient(q, 0.01)
        columns[f"qddcmd_{name}"] = np.gradient(columns[f"qdcmd_{name}"], 0.01)
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="")
    return path


def simulate(motion: Path, folder: Path, *words: object) -> tuple[int, str]:
    answer = diffnea("simulate", PENDULUM, "--trajectory", motion, "--quiet", *words, cwd=folder)
    return answer.returncode, answer.stderr


@pytest.mark.parametrize("truth", ["data.json", "./data.json", "data.csv"])
def test_two_outputs_are_two_files(motion: Path, tmp_path: Path, truth: str) -> None:
    status, said = simulate(motion, tmp_path, "-o", "data.csv", "--truth", truth)
    assert status == BAD_INPUT
    assert "two outputs" in said
    assert not list(tmp_path.iterdir())


def test_a_model_beside_a_recording_stays(motion: Path, tmp_path: Path) -> None:
    model = tmp_path / "arm.json"
    done("export", PENDULUM, "-o", model)
    before = model.read_bytes()
    status, said = simulate(motion, tmp_path, "-o", "arm.csv")
    assert status == BAD_INPUT
    assert "arm.json" in said
    assert model.read_bytes() == before
    assert not (tmp_path / "arm.csv").exists()


def test_a_truth_of_no_format_is_refused_first(motion: Path, tmp_path: Path) -> None:
    status, said = simulate(motion, tmp_path, "-o", "data.csv", "--truth", "truth.txt")
    assert status == BAD_INPUT
    assert "truth.txt" in said
    assert not list(tmp_path.iterdir())


def test_a_recording_of_before_is_replaced(motion: Path, tmp_path: Path) -> None:
    for _ in range(2):
        status, said = simulate(motion, tmp_path, "-o", "data.csv", "--truth", "truth.json")
        assert status == 0, said


# --- Python


def recording(**words: object) -> module.Recording:
    time = 0.01 * np.arange(20)
    return module.Recording(time=time, q=time, tau=time, joint_names=["a"], **words)


@pytest.mark.parametrize("name", ["arm.csv", "arm.parquet"])
def test_writing_a_recording_keeps_the_model(tmp_path: Path, name: str) -> None:
    pytest.importorskip("pyarrow")
    model = tmp_path / "arm.json"
    module.load_model("double_pendulum").save(model)
    before = model.read_bytes()
    with pytest.raises(module.FileError, match=r"arm\.json"):
        module.write_recording(recording(), tmp_path / name)
    assert model.read_bytes() == before
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("name", ["two.csv", "two.parquet"])
def test_runs_of_one_file_share_what_columns_cannot_hold(tmp_path: Path, name: str) -> None:
    pytest.importorskip("pyarrow")
    runs = [recording(period=1.0), recording(period=2.0)]
    with pytest.raises(module.DataError, match="recordings 0 and 1 differ in 'period'"):
        module.write_recording(runs, tmp_path / name)
    assert not list(tmp_path.iterdir())
    module.write_recording([runs[0], runs[0]], tmp_path / name)
    assert [r.period for r in module.read_recordings(tmp_path / name)] == [1.0, 1.0]


# --- options without effect


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (("--loss", "motion", "--robust", "huber"), "--robust"),
        (("--loss", "motion", "--prior", "entropic=1"), "--prior"),
        (("--loss", "constrained"), "--loss"),
        (("--horizon", 0.2), "--horizon"),
        (("--lambda", "1,1,1"), "--lambda"),
        (("--ball-window", 0.2), "--ball-window"),
    ],
)
def test_what_nothing_looks_at_is_wrong_usage(
    motion: Path, tmp_path: Path, words: tuple[object, ...], option: str
) -> None:
    answer = diffnea("identify", PENDULUM, motion, *words, "-o", tmp_path / "run")
    assert answer.returncode == WRONG_USAGE, answer.stderr
    assert option in answer.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("key", ["noise=2", "repetitions=3"])
def test_noise_of_sensors_is_of_recordings(tmp_path: Path, key: str) -> None:
    world = f"mujoco:wam4_ball_in_cup,perturb=none,{key}"
    answer = diffnea("transfer", tmp_path, "--world", world, "-o", tmp_path / "run")
    assert answer.returncode == WRONG_USAGE, answer.stderr
    assert key.partition("=")[0] in answer.stderr
    assert "--record" in answer.stderr
