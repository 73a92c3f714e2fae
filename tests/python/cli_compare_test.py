"""`diffnea compare` as a program sees it."""

import json
import shutil
from pathlib import Path

import pytest
from cli import BAD_INPUT, PENDULUM, diffnea, done


def test_a_fit_compared_with_itself_has_not_changed(run: Path) -> None:
    comparison = json.loads(done("compare", run, run, "--json"))
    assert comparison["schema"] == "diffnea/compare/1"
    assert not comparison["changed"]
    assert comparison["not_comparable"] == 0
    assert all(change["p"] == 1 for change in comparison["base_parameters"])


def test_compare_finds_more_friction_and_nothing_else(
    recordings: Path, run: Path, tmp_path: Path
) -> None:
    heavier = tmp_path / "heavier.urdf"
    text = PENDULUM.read_text()
    joint = text.index('<joint name="elbow"')
    at = text.index("<limit", joint)
    heavier.write_text(text[:at] + '<dynamics damping="0.3"/>' + text[at:])
    motion, data = tmp_path / "motion.csv", tmp_path / "data.csv"
    done("excite", PENDULUM, "--duration", 10, "--seed", 1, "-o", motion)
    done("simulate", heavier, "--trajectory", motion, "--noise", 1, "--seed", 9, "-o", data)
    done("identify", PENDULUM, data, "-o", tmp_path / "RUN")
    comparison = json.loads(done("compare", run, tmp_path / "RUN", "--json"))
    significant = [item for item in comparison["parameters"] if item["significant"]]
    assert [item["name"] for item in significant] == ["elbow.viscous_friction.viscous"]
    difference = significant[0]["after"] - significant[0]["before"]
    assert difference == pytest.approx(0.3, abs=4 * significant[0]["std"])
    assert comparison["changed"]
    assert "elbow.viscous_friction" in done("compare", run, tmp_path / "RUN")


def test_compare_says_that_a_fit_that_holds_worse_hides_changes(run: Path, tmp_path: Path) -> None:
    motion, data, noisy = tmp_path / "motion.csv", tmp_path / "data.csv", tmp_path / "noisy"
    done("excite", PENDULUM, "--duration", 10, "--seed", 1, "-o", motion)
    done("simulate", PENDULUM, "--trajectory", motion, "--noise", 20, "--seed", 9, "-o", data)
    done("identify", PENDULUM, data, "-o", noisy)
    comparison = json.loads(done("compare", run, noisy, "--json"))
    elbow = {item["joint"]: item for item in comparison["left_over"]}["elbow"]
    assert elbow["after"] > 2 * elbow["before"]
    assert comparison["std_ratio"] > 3
    text = done("compare", run, noisy)
    assert "elbow: the second fit leaves" in text
    assert "the standard errors of the second are" in text
    assert "leaves" not in done("compare", run, run)


def test_compare_refuses_different_robots(run: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(run, other)
    text = (other / "result.json").read_text()
    (other / "result.json").write_text(text.replace('"elbow"', '"wrist"'))
    answer = diffnea("compare", run, other)
    assert answer.returncode == BAD_INPUT
    assert "elbow" in answer.stderr
    assert "wrist" in answer.stderr
