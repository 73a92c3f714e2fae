"""The stub file against the compiled module and the package's own types."""

import os
import re
import subprocess
import sys
from pathlib import Path

from cli import ROOT

import diffnea

# What pybind11's classes look like to stubtest, and names that only the stub needs.
EXPECTED = re.compile(
    r"is inconsistent, metaclass differs"
    r"|__init__ is inconsistent, stub does not have \*args parameter"
    r"|_core\.(Array|StrPath) is not present at runtime"
)


def mypy(module: str, cache: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a module of mypy on the installed package."""
    return subprocess.run(
        [sys.executable, "-m", module, *arguments],
        capture_output=True,
        text=True,
        cwd=cache,
        env=os.environ | {"MYPY_CACHE_DIR": str(cache)},
        check=False,
    )


def test_every_public_name_is_documented() -> None:
    for name in diffnea.__all__:
        if name != "__version__":
            assert getattr(diffnea, name).__doc__, name


def test_the_stub_says_what_the_module_has(tmp_path: Path) -> None:
    config = ("--mypy-config-file", str(ROOT / "pyproject.toml"))
    answer = mypy("mypy.stubtest", tmp_path, "diffnea._core", *config)
    errors = [line for line in answer.stdout.splitlines() if line.startswith("error:")]
    assert [line for line in errors if not EXPECTED.search(line)] == []
    assert errors or answer.returncode == 0, answer.stdout + answer.stderr


def test_the_package_agrees_with_the_stub(tmp_path: Path) -> None:
    answer = mypy("mypy", tmp_path, "--config-file", str(ROOT / "pyproject.toml"))
    assert answer.returncode == 0, answer.stdout + answer.stderr


def test_fields_of_results_have_types() -> None:
    stub = Path(diffnea.__file__).with_name("_core.pyi").read_text(encoding="utf-8")
    for line in (
        "    def verdict(self) -> Literal[",
        "    def causes(self) -> list[Cause]: ...",
        "    def ball(self) -> BallSeries | None: ...",
        "    def taut(self) -> NDArray[np.bool_]: ...",
    ):
        assert line in stub
