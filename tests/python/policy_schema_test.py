"""Files of `diffnea learn` and `diffnea transfer` against docs/schema."""

from pathlib import Path

import jsonschema
import pytest
from cli import MODELS, diffnea, done, load, schema
from drawings import Places


@pytest.fixture(scope="module", params=["plain", "robust"])
def runs(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("policies")
    search: tuple[object, ...] = ("--seeds", 2, "--samples", 24, "--iterations", 3)
    if request.param == "robust":
        search += ("--robust", "--quantile", 0.25, "--vary", "string.length=0.39:0.41")
    # Three iterations need not catch the ball: the files are there all the same.
    diffnea("learn", "ball-in-cup", MODELS / "wam4_ball.xml", *search, "-o", folder / "learn")
    done("transfer", folder / "learn", "-o", folder / "transfer")
    return folder


def check(path: Path, schema_name: str) -> None:
    jsonschema.Draft202012Validator.check_schema(schema(schema_name))
    jsonschema.validate(load(path), schema(schema_name))


@pytest.mark.parametrize("command", ["learn", "transfer"])
def test_results_and_policies_are_what_the_schemas_say(runs: Path, command: str) -> None:
    check(runs / command / "result.json", command)
    policies = sorted((runs / command).glob("policy_*.json"))
    assert len(policies) == 2
    for path in policies:
        check(path, "policy")
    assert load(runs / command / "series.json")["schema"] == f"diffnea/{command}-series/1"


@pytest.mark.parametrize("command", ["learn", "transfer"])
def test_every_place_of_the_page_is_drawn(runs: Path, command: str) -> None:
    page = (runs / command / "report.html").read_text(encoding="utf-8")
    kinds = [kind for kind, _ in Places(page).drawn()]
    expected = {"learn": ["strip", "player"] + ["curve"] * 6}
    shown = ["strip", "distance"] * (kinds.count("strip") or 1)
    expected["transfer"] = ["scatter", "player", *shown]
    assert sorted(kinds) == sorted(expected[command])


@pytest.mark.parametrize("command", ["learn", "transfer"])
def test_the_page_can_be_built_again(runs: Path, command: str) -> None:
    page = runs / command / "report.html"
    before = page.read_text(encoding="utf-8")
    page.unlink()
    done("report", runs / command)
    assert page.read_text(encoding="utf-8") == before
