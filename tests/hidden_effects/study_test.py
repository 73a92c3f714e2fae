"""The study's figures against published or exact ones, and its way through the cases."""

import argparse
import json
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import figures
import pytest
import study


def test_wilson_interval() -> None:
    # Brown, Cai, DasGupta 2001: 0 of 10 gives 0 to 0.2775.
    low, high = figures.wilson(0, 10)
    assert (low, high) == (0.0, pytest.approx(0.2775, abs=1e-3))
    low, high = figures.wilson(5, 10)
    assert low == pytest.approx(1 - high)


def test_upper_bound_is_exact_for_no_hits_and_grows_with_them() -> None:
    assert figures.upper_bound(0, 400) == pytest.approx(1 - 0.05 ** (1 / 400), rel=1e-9)
    assert figures.upper_bound(1, 400) > figures.upper_bound(0, 400)
    assert figures.upper_bound(3, 3) == 1.0


def test_size_named_in_finds_the_curve_it_was_drawn_from() -> None:
    rng = random.Random(1)
    middle, slope = 0.004, 3.0
    scores = []
    for _ in range(4000):
        size = 0.0003 * 300 ** rng.random()
        p = 1 / (1 + (middle / size) ** slope)
        scores.append({"size": size, "outcome": "right" if rng.random() < p else "missed"})
    truth = middle * 9 ** (1 / slope)  # logit 0.9 = ln 9
    # 4000 draws: 3 % of spread in the size.
    assert figures.size_named_in(0.9, scores) == pytest.approx(truth, rel=0.1)
    assert figures.size_named_in(0.9, scores[:5]) is None


def test_the_sets_share_no_seed() -> None:
    tune, report = study.FIRST_SEED["tune"], study.FIRST_SEED["report"]
    assert report - tune > 100_000


def test_seeds_that_were_looked_at_are_left_out() -> None:
    words = {"group": ["main"], "family": None, "count": 2, "none": 0, "set": "report"}
    planned = study.plan(argparse.Namespace(**words, skip=5), ["cogging"])
    first = study.FIRST_SEED["report"]
    assert [case.seed for case in planned] == [first + 5, first + 6]


@pytest.fixture
def build(generator: Path, tmp_path: Path) -> Path:
    """A build folder whose command names Coulomb friction at the elbow, or what it is told to."""
    build = tmp_path / "build"
    (build / "tests/hidden_effects").mkdir(parents=True)
    (build / "tests/hidden_effects/hidden_effects_generate").symlink_to(generator)
    command = build / "apps/diffnea"
    command.parent.mkdir()
    command.write_text(
        f"""#!{sys.executable}
import json, pathlib, sys
words = sys.argv[1:]
run = pathlib.Path(words[words.index("-o") + 1])
run.mkdir(exist_ok=True)
named, left = "coulomb_friction@elbow", 2.0
if "--effects" in words:  # obeys
    named, left = words[words.index("--effects") + 1], 1.0
effect, _, where = named.partition("@")
joint = {{"joint": "elbow", "base": 3.0, "extended": left, "noise_floor": 1.0}}
answer = {{
    "verdict": "NAMED",
    "causes": [{{"effect": effect, "where": where or "shoulder,elbow", "parameters": []}}],
    "joints": [joint],
}}
(run / "result.json").write_text(json.dumps(answer))
with pathlib.Path({str(tmp_path / "calls")!r}).open("a") as calls:
    calls.write(" ".join(words) + "\\n")
"""
    )
    command.chmod(0o755)
    return build


def run_study(build: Path, folder: Path, *options: str) -> str:
    command = [sys.executable, study.__file__, str(build), "-o", str(folder), *options]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_a_study_goes_through_its_cases_once(build: Path, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    options = ("--count", "2", "--none", "1", "--group", "none", "--group", "main")
    options += ("--family", "none", "--family", "coulomb_friction")
    text = run_study(build, folder, *options)
    calls = (tmp_path / "calls").read_text().splitlines()
    assert len(calls) == 3
    assert all(call.startswith("diagnose ") and "--test" in call for call in calls)
    assert not any("truth" in call.split(" --base")[0] for call in calls)
    assert "| none | 1 | 1 |" in text  # the command always cries
    assert (folder / "tune.md").read_text() == text.rstrip("\n") + "\n"
    for case in ("none-none-1000", "main-coulomb_friction-1000", "main-coulomb_friction-1001"):
        assert {path.name for path in (folder / case).iterdir()} == {
            "truth",
            "result.json",
            "score.json",
        }
    assert run_study(build, folder, *options) == text
    assert len((tmp_path / "calls").read_text().splitlines()) == 3


def test_the_oracle_is_asked_of_finished_cases_once(
    build: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "study"
    options = ["--count", "1", "--group", "main"]
    options += ["--family", "coulomb_friction", "--family", "cable_differential_friction"]
    assert "given alone" not in run_study(build, folder, *options)
    calls = tmp_path / "calls"
    calls.unlink()
    text = run_study(build, folder, *options, "--oracle")
    asked = calls.read_text().splitlines()
    assert len(asked) == 2
    truth = json.loads((folder / "main-coulomb_friction-1000/truth/truth.json").read_text())
    joint = truth["effects"][0]["where"]
    assert sum(f"--effects coulomb_friction@{joint} " in call for call in asked) == 1
    assert sum("--effects cable_differential_friction " in call for call in asked) == 1
    score = json.loads((folder / "main-coulomb_friction-1000/score.json").read_text())
    assert score["oracle"] == "right"
    assert score["oracle_gain"] == pytest.approx(5 / 8)
    assert not (folder / "main-coulomb_friction-1000/seen").exists()
    calls.unlink()
    assert run_study(build, folder, *options, "--oracle") == text
    assert not calls.exists()


def test_the_table_has_the_worst_family_of_the_oracles() -> None:
    def case(family: str, gain: float | None) -> dict[str, Any]:
        return {"family": family, "oracle": "missed" if gain is None else "right"} | {
            "oracle_gain": gain
        }

    scores = [case("cogging", 1.0), case("cogging", 0.98), case("armature", 0.5)]
    text = "\n".join(figures.oracle_lines([*scores, case("backlash", None)]))
    assert "accepted | 3/4 |" in text
    assert "median | 0.980 |" in text
    assert "worst family | 0.500 (armature) |" in text
    assert figures.oracle_lines([{"oracle": None}]) == []


def test_groups_of_the_ball_and_of_joints_share_no_family() -> None:
    every = ["none", "armature", "ball_none", "ball_wind"]
    chosen = {group.name: group.chosen(every) for group in study.GROUPS}
    assert chosen["main"] == chosen["weak"] == ["armature"]
    assert chosen["ball"] == chosen["ball_weak"] == ["ball_wind"]
    assert (chosen["none"], chosen["ball_none"]) == (["none"], ["ball_none"])


def test_the_ball_has_figures_of_its_own() -> None:
    def case(family: str, outcome: str, lm: float | None, kind: str = "named") -> dict[str, Any]:
        return {"group": "ball", "family": family, "kind": kind, "outcome": outcome} | {
            **{"truth": [[family, "ball"]], "named": [], "verdict": "", "size": 1.0},
            **{"expected_lm": lm, "in_class": True, "class_size": None, "covered": [True]},
            **{"explained": None, "absorbed": None, "seconds": 1.0, "next_experiment": None},
        }

    scores = [case("ball_wind", "right", 500.0), case("ball_wind", "confusable", 50.0)]
    scores += [case("ball_none", "false_alarm", None, "none")]
    text = figures.table(scores, "ball")
    assert "| right effect, LM ≥ 100 | 1/1" in text
    assert "| right effect, LM 30–100 | 0/1" in text
    assert "false alarms | 1/1" in text
    assert "| right effect and joint, expected LM ≥ 100 | – |" in text
    assert "| ball_wind | 1/1" in text
    assert "## Ball" not in figures.table([], "nothing yet")


def test_an_empty_study_has_a_table() -> None:
    text = figures.table([], "nothing yet")
    assert "| none | 0 | 0 | – |" in text
