"""The step beyond as a study: its jobs, its table and its page."""

import argparse
import json

import pytest

import diffnea
from diffnea.reproduce import beyond, beyond_command, beyond_work, command
from diffnea.reproduce.jobs import Results, execute, in_order
from diffnea.reproduce.run import Report

# Far too short to catch anything: what is tested is the same for any size.
TINY = beyond.Options(
    robots=1,
    seeds=4,
    observed=4,
    lengths=(0.40,),
    ropes=("none",),
    each=("string_rebound",),
    arm_seconds=5,
    ball_seconds=5,
    ball_repetitions=1,
    search={"samples": 16, "iterations": 3},
)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Return the results of a tiny study."""
    out = Results(tmp_path_factory.mktemp("beyond") / "results")
    out.folder.mkdir()
    for job in in_order(beyond.study(TINY).jobs):
        execute(out.call(job))
    return out


def test_policies_after_have_seeds_that_nobody_used(results) -> None:
    unit = beyond.study(TINY).rows[0].units[0]
    before = {p["seed"] for p in results.read(unit.before).data["policies"]}
    for after in unit.after:
        later = {p["seed"] for p in results.read(after.transfer).data["policies"]}
        assert len(later) == TINY.seeds
        assert not before & later
    assert unit.before.settings["world"] == unit.after[0].transfer.settings["world"]


def test_what_is_diagnosed_is_what_sensors_saw(results) -> None:
    unit = beyond.study(TINY).rows[0].units[0]
    observed = results.read(unit.observed)
    assert observed.data["seeds"] == unit.learned.settings["seeds"][: TINY.observed]
    assert observed.arrays["ball_3"].shape == (len(observed.arrays["time_3"]), 3)
    found = results.read(unit.after[0].diagnosed).data
    model = diffnea.Model.from_dict(found["model"])
    named = {cause["effect"] for cause in found["causes"]}
    assert named <= {effect["effect"] for effect in model.to_dict()["effects"]}


def test_robust_policies_vary_what_was_named_of_the_string(results) -> None:
    unit = beyond.study(TINY).rows[0].units[0]
    plain, robust = unit.after[:2]
    assert plain.diagnosed == robust.diagnosed
    named = {
        f"string.{cause['effect']}.{name}": [0.0, beyond_work.VARIED * value]
        for cause in results.read(robust.diagnosed).data["causes"]
        if cause["effect"] in beyond_work.STRING
        for name, (value, _, _) in cause["parameters"].items()
    }
    assert results.read(robust.learned).data["vary"] == named
    for policy in results.read(robust.learned).data["policies"]:
        assert policy["policy"]["in_draws"]["draws"] > 1


def test_table_and_page(results, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(beyond_command, "options_of", lambda args: TINY)
    beyond_command.publish(argparse.Namespace(output=tmp_path), results, Report())
    table = json.loads((tmp_path / "table.json").read_text())
    assert [(row["effects"], row["robust"]) for row in table["rows"]] == [
        ("all", False),
        ("all", True),
        ("string_rebound", False),
    ]
    for row in table["rows"]:
        assert row["robots"] == 1
        assert 0 <= row["before"]["low"] <= row["before"]["value"] <= row["before"]["high"] <= 1
        assert row["change"]["value"] == pytest.approx(
            row["after"]["value"] - row["before"]["value"]
        )
    page = (tmp_path / "report.html").read_text()
    assert "40 cm, none rope" in page
    assert "http" not in page
    assert "40 cm" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--observed", "3"], "--observed: expected 4 or more"),
        (["--quick", "--observed", "13"], "expected 12 at most"),
        (["--each", "viscous_friction"], "choices: string_wrap"),
    ],
)
def test_mistakes_are_named(tmp_path, capsys, words, message) -> None:
    assert command.main(["beyond", "-o", str(tmp_path / "out"), *words]) == command.BAD_INPUT
    assert message in capsys.readouterr().err
