import importlib.metadata
import subprocess
import sys
from pathlib import Path

import diffnea


def test_module_and_package_have_the_same_version() -> None:
    assert diffnea.__version__ == importlib.metadata.version("diffnea")


def test_the_command_beside_the_interpreter_runs_without_an_environment() -> None:
    # No PATH and no LD_LIBRARY_PATH: the command must find libmujoco by itself.
    command = Path(sys.executable).parent / "diffnea"
    answer = subprocess.run(
        [command, "--version"], capture_output=True, text=True, check=True, env={}
    )
    assert answer.stdout.strip() == diffnea.__version__
