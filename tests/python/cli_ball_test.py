"""A ball on a string through the command: what comes out, and what is refused."""

import csv
import json
import signal
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import whole_files
from cli import COMMAND, DONE, INTERRUPTED, SECONDS, WRONG_USAGE, diffnea, done, load, refused

LENGTH, ATTACHMENT, NOISE = 0.4, np.array([0.25, 0.03, 0.05]), 1.5e-3
RATES, AMPLITUDES = np.array([1.9, 2.9]), np.array([0.5, 0.8])
STEP = 5e-4  # [s]
EVERY = 20  # rows are 10 ms apart
RUN_FILES = {"result.json", "series.json", "model.json", "report.html"}


def joint(name: str, axis: list[int], position: list[float]) -> dict[str, Any]:
    limits = {"lower": -3, "upper": 3, "velocity": 8, "effort": 40}
    return {
        "name": name,
        "type": "revolute",
        "axis": axis,
        "pose": {"position": position},
        "limits": limits,
    }


def model(*, length: float = LENGTH, ball: bool = True) -> dict[str, Any]:
    """A hand that turns about z, then x; the ball is tied beside it."""
    inertia = {"mass": 1.0, "com": [0.1, 0, 0], "about_com": [0.01, 0, 0, 0.01, 0, 0.01]}
    string = {"link": "hand", "attachment": [0.22, 0.0, 0.08], "length": length}
    return {
        "schema": "diffnea/model/1",
        "name": "swinger",
        "gravity": [0, 0, -9.81],
        "links": [
            {"name": "base", "joint": joint("yaw", [0, 0, 1], [0, 0, 1]), "inertia": inertia},
            {
                "name": "hand",
                "parent": "base",
                "joint": joint("roll", [1, 0, 0], [0.3, 0, 0]),
                "inertia": inertia,
            },
        ],
    } | ({"ball": {"mass": 0.024, "radius": 0.02, "string": string}} if ball else {})


def angles(t: np.ndarray, pace: float) -> np.ndarray:
    return AMPLITUDES * np.sin(pace * RATES * t[:, None] + [0.0, 0.4])


def anchors(q: np.ndarray) -> np.ndarray:
    """Where the string is tied, by the arm's geometry."""
    c, s = np.cos(q), np.sin(q)
    x, (y, z) = 0.3 + ATTACHMENT[0], ATTACHMENT[1:]
    y, z = y * c[:, 1] - z * s[:, 1], y * s[:, 1] + z * c[:, 1]
    return np.stack([x * c[:, 0] - y * s[:, 0], x * s[:, 0] + y * c[:, 0], 1.0 + z], 1)


def swing(seconds: float, *, pace: float = 1.0, drag: float = 0.0, seed: int = 1) -> dict[str, Any]:
    """Columns of a recording: Verlet steps, the string a projection onto its sphere."""
    t = STEP * np.arange(round(seconds / STEP) + 1)
    q = angles(t, pace)
    s = anchors(q)
    x = s[0] - [0, 0, LENGTH]
    before = x - (s[1] - s[0])
    path = [x]
    g = np.array([0, 0, -9.81])
    for k in range(len(t) - 1):
        v = (x - before) / STEP
        after = 2 * x - before + STEP**2 * (g - drag * v)
        e, d = after - s[k + 1], x - s[k]
        over = e @ e - LENGTH**2
        if over > 0:
            b, c = e @ d, d @ d
            after = after - d * ((b - np.sqrt(max(0.0, b * b - c * over))) / c)
        before, x = x, after
        path.append(x)
    ball = np.array(path)[::EVERY]
    ball = ball + NOISE * np.random.default_rng(seed).normal(size=ball.shape)
    out = {"time": t[::EVERY], "q_yaw": q[::EVERY, 0], "q_roll": q[::EVERY, 1]}
    return out | {f"ball_{a}": ball[:, i] for i, a in enumerate("xyz")}


def write(path: Path, columns: dict[str, Any]) -> Path:
    with path.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            table.writerow(["" if np.isnan(x) else repr(float(x)) for x in row])
    return path


def write_model(path: Path, **changes: Any) -> Path:
    path.write_text(json.dumps(model(**changes)), encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """model.json, train.csv and test.csv with drag, in one folder."""
    folder = tmp_path_factory.mktemp("ball")
    write_model(folder / "model.json", length=0.2)
    write(folder / "train.csv", swing(12, drag=0.2))
    write(folder / "test.csv", swing(12, pace=1.08, drag=0.2, seed=2))
    return folder


# --- what comes out


def test_identify_finds_the_string(ball: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    text = done(
        "identify", ball / "model.json", ball / "train.csv", "--test", ball / "test.csv", "-o", run
    )
    assert "string.length" in text
    result = load(run / "result.json")
    found = {p["name"]: p for p in result["parameters"]}
    truth = {"string.length": LENGTH, "ball.linear_drag.drag": 0.2}
    truth |= {f"string.attachment_{a}": x for a, x in zip("xyz", ATTACHMENT, strict=True)}
    assert found.keys() == truth.keys()
    for name, expected in truth.items():
        p = found[name]
        assert p["identifiable"], name
        assert p["value"] == pytest.approx(expected, abs=4 * p["std"] + 2e-4), name
    assert found["string.length"]["prior"] == 0.2
    assert found["string.length"]["std"] < 1e-3
    assert result["rmse"]["units"] == {"ball": "m"}
    assert result["rmse"]["test"]["ball"] == pytest.approx(NOISE, rel=0.06)
    assert result["ball"]["extended_rms"] == pytest.approx(NOISE, rel=0.06)
    whole_files.check(run)
    fitted = load(run / "model.json")
    assert fitted["ball"]["string"]["length"] == found["string.length"]["value"]


def test_diagnose_names_drag(ball: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    done(
        "diagnose", ball / "model.json", ball / "train.csv", "--test", ball / "test.csv", "-o", run
    )
    result = load(run / "result.json")
    (cause,) = result["causes"]
    assert (cause["effect"], cause["where"]) == ("linear_drag", "ball")
    (parameter,) = cause["parameters"]
    assert parameter["ci95"][0] <= 0.2 <= parameter["ci95"][1]
    assert load(run / "model.json")["effects"][0]["effect"] == "linear_drag"
    whole_files.check(run)


# --- columns


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_two_of_three_axes_are_refused(ball: Path, tmp_path: Path, command: str) -> None:
    columns = swing(2)
    del columns["ball_z"]
    data = write(tmp_path / "flat.csv", columns)
    message = refused(tmp_path / "run", ball / "model.json", data, command=command)
    assert "flat.csv" in message
    assert "ball_z" in message


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_millimetres_are_recognised(ball: Path, tmp_path: Path, command: str) -> None:
    columns = swing(6)
    for axis in "xyz":
        columns[f"ball_{axis}"] = 1e3 * columns[f"ball_{axis}"]
    data = write(tmp_path / "mm.csv", columns)
    message = refused(tmp_path / "run", ball / "model.json", data, command=command)
    assert "mm.csv" in message
    assert "ball" in message
    assert "not in millimetres" in message


def test_a_ball_that_the_model_has_not_is_noted(tmp_path: Path) -> None:
    columns = swing(8)
    rng = np.random.default_rng(3)
    for name in ("yaw", "roll"):  # of any torques: it is not the fit that is asked
        q = columns[f"q_{name}"]
        columns[f"tau_{name}"] = 0.1 * np.gradient(q, 0.01) + 0.01 * rng.normal(size=q.size)
    data = write(tmp_path / "data.csv", columns)
    text = done(
        "identify", write_model(tmp_path / "model.json", ball=False), data, "-o", tmp_path / "run"
    )
    assert "the model has none" in text
    # Without torques nothing is left to fit, and the message says what to do.
    for name in ("yaw", "roll"):
        del columns[f"tau_{name}"]
    data = write(tmp_path / "seen.csv", columns)
    message = refused(tmp_path / "none", tmp_path / "model.json", data)
    assert "it has no ball" in message
    assert "seen.csv" in message


@pytest.mark.parametrize("command", ["identify", "diagnose"])
@pytest.mark.parametrize("torque", [True, False])
def test_effects_of_a_ball_that_is_not_shown_are_refused(
    ball: Path, tmp_path: Path, command: str, torque: bool
) -> None:
    columns = {k: v for k, v in swing(4).items() if not k.startswith("ball")}
    if torque:
        columns |= {f"tau_{name}": np.sin(columns["time"]) for name in ("yaw", "roll")}
    data = write(tmp_path / "blind.csv", columns)
    message = refused(
        tmp_path / "run",
        ball / "model.json",
        data,
        "--effects",
        "linear_drag",
        command=command,
    )
    assert "blind.csv" in message
    assert ("linear_drag" if torque else "neither torques") in message
    assert "ball_x" in message


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_held_out_data_must_show_the_ball(ball: Path, tmp_path: Path, command: str) -> None:
    columns = {k: v for k, v in swing(6, pace=1.1).items() if not k.startswith("ball")}
    blind = write(tmp_path / "blind.csv", columns)
    message = refused(
        tmp_path / "run",
        *(ball / "model.json", ball / "train.csv", "--test", blind),
        command=command,
    )
    assert "blind.csv" in message
    assert "held-out" in message
    assert "ball_x" in message


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_a_ball_that_is_never_taut_is_refused(ball: Path, tmp_path: Path, command: str) -> None:
    columns = swing(6)
    rows = len(columns["time"])
    rng = np.random.default_rng(4)
    for axis, x in zip("xyz", (0.6, 0.1, 0.7), strict=True):  # it lies on a table
        columns[f"ball_{axis}"] = x + NOISE * rng.normal(size=rows)
    data = write(tmp_path / "table.csv", columns)
    message = refused(tmp_path / "run", ball / "model.json", data, command=command)
    assert "nowhere taut" in message
    assert "the largest is" in message
    assert "table.csv" in message


# --- options


def test_a_length_that_no_string_has(ball: Path, tmp_path: Path) -> None:
    message = refused(
        tmp_path / "run", ball / "model.json", ball / "train.csv", "--fix", "string.length=-1"
    )
    assert "string.length=-1" in message
    assert "above 0" in message


@pytest.mark.parametrize("weights", ["1,1", "1,1,1,1", "1,-1,1", "1,a,1"])
def test_weights_of_the_constrained_loss_are_three(
    ball: Path, tmp_path: Path, weights: str
) -> None:
    answer = diffnea(
        *("identify", ball / "model.json", ball / "train.csv", "-o", tmp_path / "run"),
        *("--loss", "constrained", "--lambda", weights),
    )
    assert answer.returncode == WRONG_USAGE, answer.stderr
    assert "--lambda" in answer.stderr
    assert not (tmp_path / "run").exists()


def test_the_constrained_loss_is_for_a_ball(ball: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    done(
        *("identify", ball / "model.json", ball / "train.csv", "-o", run),
        *("--loss", "constrained", "--lambda", "1,1,1"),
    )
    found = {p["name"]: p["value"] for p in load(run / "result.json")["parameters"]}
    assert found["string.length"] == pytest.approx(LENGTH, abs=1e-3)


# --- Ctrl-C


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_ctrl_c_leaves_nothing_half_written(tmp_path: Path, command: str) -> None:
    source = write_model(tmp_path / "model.json", length=0.2)
    columns = swing(40, drag=0.2)
    # An outage a second: many windows, seconds of work.
    data = write(tmp_path / "data.csv", columns)
    run = tmp_path / "run"
    process = subprocess.Popen(
        [COMMAND, command, str(source), str(data), "-o", str(run)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "ball" in line or not line.startswith("opening"):
            process.send_signal(signal.SIGINT)
            break
    _, message = process.communicate(timeout=SECONDS)
    if process.returncode == DONE:
        pytest.skip("it was done before Ctrl-C came")
    assert process.returncode == INTERRUPTED, message
    assert "interrupted" in message
    if run.exists():
        names = {path.name for path in run.iterdir()}
        assert not any(name.startswith(".partial") for name in names)
        assert not names or names >= RUN_FILES - {"series.json"}
