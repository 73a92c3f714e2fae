"""Motions that never repeat: noise is what no smooth function of the motion explains."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli import done, load

Generate = Callable[..., tuple[Path, dict[str, Any]]]

ONCE = ("--aperiodic", "--duration", 20)


def diagnosed(folder: Path, truth: dict[str, Any], run: Path) -> Any:
    seen = folder / "seen"
    done(
        *("diagnose", seen / "model.xml", seen / "train.csv", "--test", seen / "test.csv"),
        *("--base", truth["base"], "-o", run, "--quiet"),
    )
    return load(run / "result.json")


@pytest.mark.parametrize(
    ("family", "seed"),
    [
        ("tip_force", 1001),  # was replaced by an encoder's offset that is nothing beside the base
        ("saturation", 1001),  # was not tried
    ],
)
def test_it_is_named(family: str, seed: int, generate: Generate, tmp_path: Path) -> None:
    folder, truth = generate(family, seed, *ONCE)
    (hidden,) = truth["effects"]
    finding = diagnosed(folder, truth, tmp_path / "run")
    (cause,) = finding["causes"]
    assert (cause["effect"], cause["where"]) == (hidden["effect"], hidden["where"])


def test_the_ends_are_no_limit(generate: Generate, tmp_path: Path) -> None:
    """The hidden limit is never met; the filter's memory of the first instants passed for one."""
    folder, truth = generate("saturation", 1003, *ONCE)
    assert truth["effects"][0]["reachable_lm"] < 1.0
    assert diagnosed(folder, truth, tmp_path / "run")["causes"] == []


def test_a_base_that_is_fixed_has_no_columns(generate: Generate, tmp_path: Path) -> None:
    folder, truth = generate("payload", 1001, *ONCE)
    assert truth["base"] == "fixed"
    (cause,) = diagnosed(folder, truth, tmp_path / "run")["causes"]
    assert cause["effect"] == "payload"


def test_half_of_a_friction_that_the_base_has_is_held(generate: Generate, tmp_path: Path) -> None:
    """What both halves have in common is the base's, which identify has fitted."""
    folder, truth = generate("asymmetric_viscous", 1004)
    seen = folder / "seen"
    data = (seen / "train.csv", "--test", seen / "test.csv")
    done("identify", seen / "model.xml", *data, "-o", tmp_path / "fit", "--quiet")
    done("diagnose", tmp_path / "fit/model.json", *data, "-o", tmp_path / "run", "--quiet")
    (cause,) = load(tmp_path / "run/result.json")["causes"]
    (hidden,) = truth["effects"]
    assert (cause["effect"], cause["where"]) == ("asymmetric_viscous", hidden["where"])
    halves = {p["name"]: p for p in cause["parameters"]}
    assert halves["viscous_negative"]["ci95"] == [0.0, 0.0]
    low, high = halves["viscous_positive"]["ci95"]
    size = hidden["parameters"]
    assert low < size["viscous_positive"] - size["viscous_negative"] < high
    assert high - low < 0.2 * high
