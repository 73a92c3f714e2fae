"""The generators, built with the C++ tests."""

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli import ROOT

GENERATOR = Path(
    os.environ.get("DIFFNEA_HIDDEN_EFFECTS")
    or ROOT / "build/release/tests/hidden_effects/hidden_effects_generate"
)
RIGS = Path(
    os.environ.get("DIFFNEA_HIDDEN_EFFECTS_RIGS")
    or GENERATOR.parent / "rigs" / "hidden_effects_rigs"
)

Generate = Callable[..., tuple[Path, dict[str, Any]]]


@pytest.fixture(scope="session")
def generator() -> Path:
    if not GENERATOR.exists():
        pytest.fail(f"{GENERATOR} is not built: make test, or name it in DIFFNEA_HIDDEN_EFFECTS")
    return GENERATOR


@pytest.fixture(scope="session")
def generate(generator: Path, tmp_path_factory: pytest.TempPathFactory) -> Generate:
    """Return a function that makes a case and returns its folder and its truth."""

    def make(family: str, seed: int, *options: object) -> tuple[Path, dict[str, Any]]:
        folder = tmp_path_factory.mktemp(family)
        command = [generator, "--family", family, "--seed", seed, "-o", folder, *options]
        subprocess.run([str(word) for word in command], check=True, timeout=300)
        return folder, json.loads((folder / "truth/truth.json").read_text(encoding="utf-8"))

    return make


@pytest.fixture(scope="session")
def rigs() -> Path:
    if not RIGS.exists():
        pytest.fail(f"{RIGS} is not built: make test, or name it in DIFFNEA_HIDDEN_EFFECTS_RIGS")
    return RIGS
