"""A fixed sample of the study on every commit: the rates of `diffnea diagnose` do not fall.

Seeds of the set that thresholds are tuned on, half of the study's duration and rate. The whole
study is `make study`.
"""

import math
import os
import shutil
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import study
from cli import COMMAND, load

GROUP = study.Group("sample", ("--duration", "20", "--rate", "250"))
FIRST = study.FIRST_SEED["tune"]

NONE = [("none", k) for k in range(8)]
SINGLE = [
    (family, k)
    for family in (
        "coulomb_friction",
        "viscous_friction",
        "quadratic_friction",
        "asymmetric_viscous",
        "torque_offset",
        "cogging",
        "armature",
    )
    for k in range(2)
]
ABSORBED = [("absorbed", k) for k in range(3)]
OUTSIDE = [("outside", k) for k in range(2)]
TWO = [("two", k) for k in range(2)]

# What share of the cases must come out: measured on seeds FIRST to FIRST + 5 of the same families
# and options.
RIGHT_SINGLE = 0.9
COVERED = 0.8

Scores = dict[tuple[str, int], dict[str, Any]]


def least(rate: float, n: int, chance: float = 0.01) -> int:
    """Hits of n that a rate falls below with at most this chance (binomial)."""
    total = 0.0
    for hits in range(n + 1):
        total += math.comb(n, hits) * rate**hits * (1 - rate) ** (n - hits)
        if total > chance:
            return hits
    return n


@pytest.fixture(scope="module")
def scores(generator: Path, tmp_path_factory: pytest.TempPathFactory) -> Scores:
    command = Path(COMMAND if Path(COMMAND).exists() else shutil.which(COMMAND) or COMMAND)
    folder = tmp_path_factory.mktemp("sample")
    keys = NONE + SINGLE + ABSORBED + OUTSIDE + TWO

    def score(key: tuple[str, int]) -> dict[str, Any]:
        case = study.Case(GROUP, key[0], FIRST + key[1])
        problem = study.run_case(case, folder, study.Tools(generator, command))
        assert problem is None, problem
        found: dict[str, Any] = load(folder / case.name / "score.json")
        return found

    with ThreadPoolExecutor(min(2, os.cpu_count() or 1)) as pool:
        return dict(zip(keys, pool.map(score, keys), strict=True))


def shown(scores: Scores, keys: Iterable[tuple[str, int]]) -> str:
    lines = [f"{key}: {scores[key]['outcome']}, named {scores[key]['named']}" for key in keys]
    return "\n".join(lines)


def test_least_is_the_lower_bound_of_a_binomial() -> None:
    # P(X < 6) = 0.0064 and P(X < 7) = 0.0321 for 9 of 10 wanted with 0.9 (tables).
    assert least(1.0, 8) == 8
    assert least(0.5, 4) == 0
    n, rate = 14, 0.9
    below = sum(math.comb(n, k) * rate**k * (1 - rate) ** (n - k) for k in range(least(rate, n)))
    assert below <= 0.01


def test_nothing_is_named_where_nothing_is_hidden(scores: Scores) -> None:
    # At the goal of 1 % false alarms, one in 8 cases would be bad luck of 8 %: the seeds are fixed.
    assert [scores[key]["outcome"] for key in NONE] == ["right"] * len(NONE), shown(scores, NONE)


def test_effects_are_named_at_their_joints(scores: Scores) -> None:
    right = sum(scores[key]["outcome"] == "right" for key in SINGLE)
    assert right >= least(RIGHT_SINGLE, len(SINGLE)), shown(scores, SINGLE)
    assert not [key for key in SINGLE if scores[key]["outcome"] == "failed"]


def test_the_truth_lies_in_its_interval(scores: Scores) -> None:
    covered = [inside for key in SINGLE for inside in scores[key]["covered"]]
    assert len(covered) >= least(RIGHT_SINGLE, len(SINGLE))
    assert sum(covered) >= least(COVERED, len(covered)), shown(scores, SINGLE)


def test_what_the_base_absorbs_is_not_named(scores: Scores) -> None:
    outcomes = [scores[key]["outcome"] for key in ABSORBED]
    assert outcomes == ["right"] * len(ABSORBED), shown(scores, ABSORBED)


def test_two_effects_are_both_found(scores: Scores) -> None:
    assert sum(scores[key]["outcome"] in study.scoring.GOOD for key in TWO) >= 1, shown(scores, TWO)


def test_what_is_outside_the_catalogue_is_seen(scores: Scores) -> None:
    # A name is wrong there; silence would be, too.
    for key in OUTSIDE:
        assert scores[key]["outcome"] != "missed", shown(scores, OUTSIDE)
