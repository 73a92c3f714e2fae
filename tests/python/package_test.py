import importlib.metadata
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from cli import ROOT

import diffnea
from diffnea._readers.packages import install_command, requirements

with (ROOT / "pyproject.toml").open("rb") as file:
    EXTRAS: dict[str, list[str]] = tomllib.load(file)["project"]["optional-dependencies"]


def test_module_and_package_have_the_same_version() -> None:
    assert diffnea.__version__ == importlib.metadata.version("diffnea")


def test_the_command_beside_the_interpreter_runs_without_an_environment() -> None:
    # No PATH and no LD_LIBRARY_PATH: the command must find libmujoco by itself.
    command = Path(sys.executable).parent / "diffnea"
    answer = subprocess.run(
        [command, "--version"], capture_output=True, text=True, check=True, env={}
    )
    assert answer.stdout.strip() == diffnea.__version__


@pytest.mark.parametrize("extra", EXTRAS)
def test_a_command_that_installs_an_extra_names_its_packages(extra: str) -> None:
    """Beside a checkout and beside a wheel: diffnea itself is on no package index."""
    assert requirements(extra) == EXTRAS[extra]
    words = shlex.split(install_command(extra))
    assert words == [sys.executable, "-m", "pip", "install", *EXTRAS[extra]]


def test_a_command_that_installs_an_extra_is_one_that_pip_takes() -> None:
    """Asked without a network, for packages that the tests need themselves."""
    pytest.importorskip("matplotlib")
    subprocess.run(
        [*shlex.split(install_command("plots")), "--dry-run", "--no-index", "--quiet"],
        check=True,
        capture_output=True,
    )


def test_no_message_asks_for_diffnea_by_name() -> None:
    """``pip install diffnea[…]`` finds nothing, or somebody else's package."""
    sources = [*(ROOT / "python").rglob("*.py"), *(ROOT / "apps").glob("*.cpp")]
    sources += [*(ROOT / "python").glob("*.cpp"), *(ROOT / "src").rglob("*.cpp")]
    assert len(sources) > 100
    found = [path for path in sources if "diffnea[" in path.read_text(encoding="utf-8")]
    assert not found
