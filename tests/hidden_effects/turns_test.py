"""What shows where joints turn back alone, hidden at joints that stick there.

Their turns are left out at first: without a second look, with them, each of these was NONE.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli import done, load

Generate = Callable[..., tuple[Path, dict[str, Any]]]


@pytest.mark.parametrize(("family", "seed"), [("stribeck_friction", 1005), ("backlash", 1_000_003)])
def test_it_is_found_with_the_turns(
    family: str, seed: int, generate: Generate, tmp_path: Path
) -> None:
    folder, truth = generate(family, seed)
    (hidden,) = truth["effects"]
    seen = folder / "seen"
    done(
        *("diagnose", seen / "model.xml", seen / "train.csv", "--test", seen / "test.csv"),
        *("--base", truth["base"], "-o", tmp_path / "run", "--quiet"),
    )
    finding = load(tmp_path / "run/result.json")
    (cause,) = finding["causes"]
    assert (cause["effect"], cause["where"]) == (hidden["effect"], hidden["where"])
    told = next(note for note in finding["notes"] if "was looked for with them" in note)
    assert told.startswith(family.replace("_", " "))
    size = cause["parameters"][0]
    low, high = size["ci95"]
    assert low < hidden["parameters"][size["name"]] < high
