"""Every family of both generators and of the ball hidden once, on seeds that nobody tuned on.

What is hidden must be named, or stand in the class that is reported, and remove held-out error;
another name is a failure, also where the catalogue has none. The whole study is `make study`.
"""

import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import study
from cli import COMMAND, load

SEED = study.FIRST_SEED["suite"]
SETS = {
    # Half of the study's duration and rate.
    "first": study.Group("first", ("--duration", "20", "--rate", "250")),
    "rigs": study.Group("rigs"),
    "ball": study.Group("ball", ball=True),
}
FEWEST = {"first": 30, "rigs": 30, "ball": 14}  # families: a list that came out empty would pass
# Not named today; docs/results.md counts them. Who mends one takes it off this list.
MISSED = {
    ("first", "time_shift"): "half a sample, which a drive that holds its torque has as well",
    ("ball", "ball_string_extension"): "a string that gives by much: damping is named beside it",
    ("rigs", "presliding_lugre"): "named Coulomb friction, Dahl's in its class, of which it is one",
    ("rigs", "stribeck_friction"): "at 50 Hz no row is slow enough",
    ("rigs", "time_shift"): "its expected LM is 37",
    ("rigs", "torque_offset"): "its expected LM is 35",
}
EXPLAINED = 0.8  # share of an arm's held-out error that can be removed: less is UNKNOWN
COVERED = 0.8  # least share of 95 % intervals that hold the truth, of some hundred: 4 σ below

Scores = dict[tuple[str, str], dict[str, Any]]


@dataclass(frozen=True)
class Programs:
    """Makers of the cases of each set."""

    first: Path
    rigs: Path

    def of(self, name: str) -> Path:
        return self.rigs if name == "rigs" else self.first


def families(programs: Programs, name: str) -> list[str]:
    every = study.families(programs.of(name))
    return [f for f in every if f.startswith("ball_") == (name == "ball")]


@pytest.fixture(scope="module")
def scores(generator: Path, rigs: Path, tmp_path_factory: pytest.TempPathFactory) -> Scores:
    command = Path(COMMAND if Path(COMMAND).exists() else shutil.which(COMMAND) or COMMAND)
    folder = tmp_path_factory.mktemp("sample")
    programs = Programs(generator, rigs)
    keys = [(name, family) for name in SETS for family in families(programs, name)]

    def score(key: tuple[str, str]) -> dict[str, Any]:
        name, family = key
        case = study.Case(SETS[name], family, SEED)
        problem = study.run_case(case, folder, study.Tools(programs.of(name), command))
        assert problem is None, problem
        home = folder / case.name
        return {**load(home / "score.json"), "result": load(home / "result.json")}

    with ThreadPoolExecutor(min(2, os.cpu_count() or 1)) as pool:
        return dict(zip(keys, pool.map(score, keys), strict=True))


def outcome(score: dict[str, Any]) -> str:
    return f"{score['outcome']}: {score['verdict']}, named {score['named']}, is {score['truth']}"


@pytest.mark.parametrize("name", SETS)
def test_what_is_hidden_is_named_and_nothing_else(scores: Scores, name: str) -> None:
    mine = {family: score for (of, family), score in scores.items() if of == name}
    assert len(mine) >= FEWEST[name]
    bad = {f: outcome(s) for f, s in mine.items() if s["outcome"] not in study.scoring.GOOD}
    missed = {family for of, family in MISSED if of == name}
    assert set(bad) == missed, "\n".join(f"{f}: {text}" for f, text in bad.items())


def test_what_is_named_removes_held_out_error(scores: Scores) -> None:
    for key, score in scores.items():
        if not score["named"] or score["outcome"] not in study.scoring.GOOD:
            continue
        gain = score["result"]["gain"]
        assert gain["test_rmse_after"] < gain["test_rmse_before"], key
        if key[0] != "ball" and score["verdict"] != "UNKNOWN":
            assert gain["explained_share"] >= EXPLAINED, key
        for cause in score["result"]["causes"]:
            assert cause["gain"]["ci95"][0] > 0.0, (key, cause["effect"])


def test_the_truth_lies_in_its_interval(scores: Scores) -> None:
    covered = [inside for score in scores.values() for inside in score["covered"]]
    assert len(covered) > 80
    assert sum(covered) >= COVERED * len(covered)
