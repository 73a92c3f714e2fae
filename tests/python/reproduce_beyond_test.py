"""The step beyond as a study: its jobs, its table and its page."""

import argparse
import json

import pytest

import diffnea
from diffnea.reproduce import beyond, beyond_command, beyond_work, command
from diffnea.reproduce.jobs import SCHEMA, Results, execute, in_order
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
    assert model.to_dict()["ball"]["string"]["length"] == pytest.approx(0.4, abs=0.05)
    assert found["ball_before"] > 0


def test_robust_policies_vary_what_was_named_of_the_string(results) -> None:
    unit = beyond.study(TINY).rows[0].units[0]
    plain, robust = unit.after[:2]
    assert plain.diagnosed.key == robust.diagnosed.key
    causes = results.read(robust.diagnosed).data["causes"]
    vary = results.read(robust.learned).data["vary"]
    assert vary == {name: list(of) for name, of in beyond_work.varied(causes).items()}
    for policy in results.read(robust.learned).data["policies"]:
        assert policy["policy"]["in_draws"]["draws"] > 1


def cause(effect: str, where: str, **parameters: float) -> dict:
    """Return one as a diagnosis leaves it; its intervals are not looked at."""
    return {
        "effect": effect,
        "where": where,
        "parameters": {n: [v, 0, 1] for n, v in parameters.items()},
    }


def test_one_effect_of_an_impact_is_varied_with_those_it_may_stand_for() -> None:
    found = [
        cause("string_wrap", "string", size=2.0),
        cause("actuator_delay", "joint1", delay=0.002),
    ]
    assert beyond_work.varied(found) == {
        "string.string_wrap.size": (0.0, 3.0),
        "string.string_rebound.restitution": (0.0, pytest.approx(0.3)),
        "string.string_folding.resistance": (0.0, pytest.approx(0.03)),
    }
    assert beyond_work.varied([cause("string_mass", "string", mass_ratio=0.02)]) == {
        "string.string_mass.mass_ratio": (0.0, 0.03)
    }
    assert beyond_work.varied(found[1:]) == {}


def test_what_is_varied_is_what_effects_take() -> None:
    found = [cause("string_rebound", "string", restitution=0.55)]
    found.append(cause("string_folding", "string", resistance=0.09))
    vary = beyond_work.varied(found)
    nominal = diffnea.models.path("wam4_ball_in_cup.xml")
    search = {"samples": 16, "iterations": 2, "progress": False}
    learned = diffnea.learn(nominal, string=0.4, robust=True, draws=8, vary=vary, **search)
    assert len(learned.policies) == 1


def made(folder, study: beyond.Study) -> Results:
    """Return results of two robots of three, made by hand: 1 and 2 of 4 before, 3 and 4 after."""
    out = Results(folder)
    out.folder.mkdir()

    def write(job, result) -> None:
        content = {"schema": SCHEMA, "result": result, "build": "b", "cpu_seconds": 2.0}
        out.file(job).write_text(json.dumps(content))

    def policies(won: int) -> dict:
        return {"policies": [{"success": k < won, "path_error": 0.01 * k} for k in range(4)]}

    delays = [cause("actuator_delay", f"joint{k}", delay=0.002 * k) for k in (1, 2)]
    for n, unit in enumerate(study.rows[0].units[:2]):
        write(unit.before, policies(1 + n))
        for after in unit.after:
            write(after.transfer, policies(3 + n))
        causes = [cause("string_wrap", "string", size=1.0 + n), *delays]
        write(unit.after[0].diagnosed, {"causes": causes, "sentence": "<named>"})
    return out


def test_figures_are_of_robots_that_are_finished(tmp_path, monkeypatch, capsys) -> None:
    options = beyond.Options(robots=3, seeds=4, observed=4, lengths=(0.40,), ropes=("mid",))
    results = made(tmp_path / "results", beyond.study(options))
    monkeypatch.setattr(beyond_command, "options_of", lambda args: options)
    beyond_command.publish(argparse.Namespace(output=tmp_path), results, Report())
    row = json.loads((tmp_path / "table.json").read_text())["rows"][0]
    assert (row["robots"], row["asked"]) == (2, 3)
    assert (row["before"]["value"], row["after"]["value"]) == (3 / 8, 7 / 8)
    assert row["change"]["low"] < row["change"]["value"] == 0.5 < row["change"]["high"]
    assert row["path_before"] == pytest.approx(0.015)
    # A cause at two joints is two causes, each of them of both robots.
    assert row["named"] == {
        "string_wrap": 2,
        "actuator_delay@joint1": 2,
        "actuator_delay@joint2": 2,
    }
    assert row["values"]["string_wrap.size"] == 1.5
    assert row["values"]["actuator_delay@joint2.delay"] == 0.004
    page = (tmp_path / "report.html").read_text()
    assert "2 of 6 robots are not there yet" in page
    assert "too few to know" in page
    assert "&lt;named&gt;" in page
    assert "string_wrap 2 of 2 (size 1.5)" in capsys.readouterr().out
    figures = (tmp_path / "table.csv").read_text().splitlines()
    assert figures[0].startswith("title,length,rope,effects,robust,asked,robots,before.value")
    assert len(figures) == 3


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
        (["--seeds", "501"], "of seeds 500 at most"),
        (["--ropes", "mid,thick"], "rope = 'thick'"),
        (["--surrogate", "Z"], "perturb = 'Z'; choices: none, A, B, C"),
        (["--lengths", "0.40,0"], "--lengths: got 0 m, expected above 0"),
    ],
)
def test_mistakes_are_named(tmp_path, capsys, words, message) -> None:
    assert command.main(["beyond", "-o", str(tmp_path / "out"), *words]) == command.BAD_INPUT
    assert message in capsys.readouterr().err
