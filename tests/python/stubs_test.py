"""The stub file against the compiled module: names, arguments, defaults."""

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
    r"|_core\.(Array|StrPath|Verdict) is not present at runtime"
)


def test_every_public_name_is_documented() -> None:
    for name in diffnea.__all__:
        if name != "__version__":
            assert getattr(diffnea, name).__doc__, name


def test_the_stub_says_what_the_module_has(tmp_path: Path) -> None:
    config = ("--mypy-config-file", str(ROOT / "pyproject.toml"))
    answer = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "diffnea._core", *config],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=os.environ | {"MYPY_CACHE_DIR": str(tmp_path)},
        check=False,
    )
    errors = [line for line in answer.stdout.splitlines() if line.startswith("error:")]
    assert [line for line in errors if not EXPECTED.search(line)] == []
    assert errors or answer.returncode == 0, answer.stdout + answer.stderr
