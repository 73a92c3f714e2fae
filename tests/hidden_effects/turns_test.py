"""Friction that shows where a joint turns back alone, hidden at one that sticks there."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from cli import done, load

Generate = Callable[..., tuple[Path, dict[str, Any]]]


def test_it_is_found_though_the_joint_sticks(generate: Generate, tmp_path: Path) -> None:
    folder, truth = generate("stribeck_friction", 1005)
    (hidden,) = truth["effects"]
    seen = folder / "seen"
    done(
        *("diagnose", seen / "model.xml", seen / "train.csv", "--test", seen / "test.csv"),
        *("--base", truth["base"], "-o", tmp_path / "run", "--quiet"),
    )
    finding = load(tmp_path / "run/result.json")
    (cause,) = finding["causes"]
    assert (cause["effect"], cause["where"]) == (hidden["effect"], hidden["where"])
    size = cause["parameters"][0]
    low, high = size["ci95"]
    assert low < hidden["parameters"][size["name"]] < high
