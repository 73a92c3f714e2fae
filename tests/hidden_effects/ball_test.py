"""The ball's families: a ball on a string of the arm that the model describes."""

import csv
import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Generate = Callable[..., tuple[Path, dict[str, Any]]]
Array = np.ndarray[Any, np.dtype[np.float64]]

JOINTS = ["joint1", "joint2", "joint3", "joint4"]
NOISE = 1.5e-3  # [m], of the camera
SHORT = ("--duration", 10)

# Two motions of one seed differ in vigour, as the effect moves the ball: 30 % of LM observed.
LM_TOLERANCE = 0.5


def turn(axis: int, angle: Array) -> Array:
    c, s, out = np.cos(angle), np.sin(angle), np.zeros((len(angle), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[:, axis, axis] = 1.0
    out[:, i, i], out[:, j, j], out[:, i, j], out[:, j, i] = c, c, -s, s
    return out


def hand(model: dict[str, Any], q: Array) -> tuple[Array, Array]:
    """Position and orientation of the last link, by the model's file."""
    position, rotation = np.zeros((len(q), 3)), np.tile(np.eye(3), (len(q), 1, 1))
    for link in model["links"]:
        joint = link["joint"]
        position = position + rotation @ np.array(joint["pose"]["position"])
        for axis in (2, 1, 0):
            rotation = rotation @ turn(axis, np.full(len(q), joint["pose"]["rpy"][axis]))
        if "name" in joint:
            rotation = rotation @ turn(2, q[:, JOINTS.index(joint["name"])])
    return position, rotation


def recorded(folder: Path, name: str = "train") -> tuple[Array, Array, Array]:
    """Time, joints and ball at the rows at which the ball was seen."""
    with (folder / "seen" / f"{name}.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["ball_x"]]
    channels = (["time"], [f"q_{j}" for j in JOINTS], ["ball_x", "ball_y", "ball_z"])
    time, q, ball = (np.array([[float(r[c]) for c in group] for r in rows]) for group in channels)
    return time[:, 0], q, ball


def test_columns_and_rates(generate: Generate) -> None:
    folder, _ = generate("ball_none", 1, *SHORT)
    assert {path.name for path in (folder / "seen").iterdir()} == {
        "model.json",
        "train.csv",
        "test.csv",
    }
    lines = (folder / "seen" / "train.csv").read_text().splitlines()
    assert lines[0] == "time,q_joint1,q_joint2,q_joint3,q_joint4,ball_x,ball_y,ball_z"
    assert len(lines) == 1 + 10 * 500
    time, _, _ = recorded(folder)
    assert len(time) == 10 * 100
    assert np.diff(time) == pytest.approx(0.01)


@pytest.mark.parametrize("seed", [1, 4])
def test_without_an_effect_the_string_has_one_length(generate: Generate, seed: int) -> None:
    folder, truth = generate("ball_none", seed)
    assert truth["kind"] == "none"
    assert truth["effects"] == []
    assert truth["recording"]["slack_share"] == 0.0  # of these seeds
    assert 20.0 < np.degrees(truth["recording"]["largest_angle"]) < 45.0
    model = json.loads((folder / "seen/model.json").read_text())
    string = truth["string"]
    for name in ("train", "test"):
        _, q, ball = recorded(folder, name)
        position, rotation = hand(model, q)
        anchor = position + rotation @ np.array(string["attachment"])
        off = np.linalg.norm(ball - anchor, axis=1) - string["length"]
        # Mean and spread of 4000 rows: 1.6 and 1.1 % of it; the joints' noise adds 0.1 mm of 1.5.
        assert abs(off.mean()) < 5 * NOISE / np.sqrt(len(off))
        assert off.std() == pytest.approx(NOISE, rel=0.06)
    # The nominal model's string is another one.
    nominal = model["ball"]["string"]
    assert nominal["link"] == model["links"][-1]["name"]
    assert 1e-4 < abs(nominal["length"] - string["length"]) < 0.02


def test_the_ball_falls_about_its_anchor_as_a_pendulum(generate: Generate) -> None:
    """Across the string the ball has no acceleration but gravity's: differences of the rows."""
    folder, truth = generate("ball_none", 1)
    time, _, ball = recorded(folder)
    model = json.loads((folder / "seen/model.json").read_text())
    position, rotation = hand(model, recorded(folder)[1])
    to_ball = ball - (position + rotation @ np.array(truth["string"]["attachment"]))
    u = to_ball / np.linalg.norm(to_ball, axis=1)[:, None]
    # Over 0.1 s the noise is 1.5 mm · √6 / (0.1 s)² = 0.37 m/s² a row.
    k = 10
    a = (ball[2 * k :] - 2 * ball[k:-k] + ball[: -2 * k]) / (time[k] - time[0]) ** 2
    u = u[k:-k]
    across = a - np.array([0.0, 0.0, -9.81])
    across -= u * np.sum(u * across, axis=1)[:, None]
    swing = a - u * np.sum(u * a, axis=1)[:, None]
    # The parabola leaves out (0.1 s · 5 1/s)²/12 = 2 % of it.
    assert across.std() < 0.45
    assert swing.std() > 2 * across.std()


@pytest.mark.parametrize(
    ("family", "parameters", "place"),
    [
        ("linear_drag", ["drag"], "ball"),
        ("wind", ["wind_x", "wind_y", "wind_z"], "ball"),
        ("string_mass", ["mass_ratio"], "string"),
        ("camera_delay", ["delay"], "camera"),
    ],
)
def test_the_truth_is_told_in_the_catalogues_words(
    generate: Generate, family: str, parameters: list[str], place: str
) -> None:
    folder, truth = generate(f"ball_{family}", 1, *SHORT, "--scale", 1)
    (effect,) = truth["effects"]
    assert (truth["kind"], truth["base"]) == ("named", "refit")
    assert (effect["effect"], effect["where"], effect["size"]) == (family, place, 1.0)
    assert list(effect["parameters"]) == parameters
    unit = {"camera_delay": 0.01}.get(family, 0.05)
    assert np.linalg.norm(list(effect["parameters"].values())) == pytest.approx(unit)
    assert 0.0 < effect["expected_lm"] <= effect["raw_lm"]
    assert all(r["lm_beyond"] <= effect["expected_lm"] for r in effect["rivals"])
    assert family not in (folder / "seen/model.json").read_text()


def test_evidence_grows_with_the_square_of_the_size(generate: Generate) -> None:
    lm = {}
    for size in (0.3, 1.0):
        _, truth = generate("ball_camera_scale", 3, *SHORT, "--scale", size)
        lm[size] = truth["effects"][0]["expected_lm"]
    assert lm[1.0] / lm[0.3] == pytest.approx(1 / 0.3**2, rel=LM_TOLERANCE)


def test_the_known_classes_are_alike_and_others_are_not(generate: Generate) -> None:
    _, truth = generate("ball_gravity_scale", 1, "--scale", 1)
    (effect,) = truth["effects"]
    beyond = {r["effects"][0]: r["lm_beyond"] for r in effect["rivals"]}
    assert beyond["string_bending"] < 0.01 * effect["expected_lm"]
    assert beyond["string_mass"] < 0.1 * effect["expected_lm"]
    assert beyond["linear_drag"] > 0.5 * effect["expected_lm"]


def test_an_attachment_is_accused_with_a_base_that_is_held(generate: Generate) -> None:
    folder, truth = generate("ball_attachment_offset", 1, *SHORT)
    assert truth["base"] == "fixed"
    nominal = json.loads((folder / "seen/model.json").read_text())["ball"]["string"]
    assert nominal["length"] == truth["string"]["length"]
    assert nominal["attachment"] == truth["string"]["attachment"]


def test_some_motions_let_the_string_go_slack(generate: Generate) -> None:
    slack = []
    for seed in range(8):
        _, truth = generate("ball_none", seed, *SHORT)
        slack.append(truth["recording"]["slack_share"])
    # A fifth of all cases; of 8 none or all with a chance of 17 %: these seeds are fixed.
    assert 0 < sum(s > 0.0 for s in slack) < len(slack)
    assert all(s == 0.0 or 0.01 < s < 0.3 for s in slack)


def test_a_ball_family_that_there_is_not_is_answered_with_those_there_are(
    generator: Path, tmp_path: Path
) -> None:
    command = [generator, "--family", "ball_gremlins", "-o", tmp_path / "case"]
    answer = subprocess.run(command, capture_output=True, text=True)
    assert answer.returncode == 1
    assert "ball_linear_drag" in answer.stderr
