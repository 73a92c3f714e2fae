"""The command under test, and what its tests share."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
MODELS = ROOT / "models"
COMMAND = os.environ.get("DIFFNEA_COMMAND") or str(Path(sys.executable).parent / "diffnea")
SECONDS = float(os.environ.get("DIFFNEA_COMMAND_SECONDS", "120"))  # sanitizers take longer

DONE, BAD_INPUT, WRONG_USAGE, NO_USABLE_RESULT, INTERRUPTED = 0, 1, 2, 3, 130


def diffnea(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command to its end, whatever that is."""
    return subprocess.run(
        [COMMAND, *map(str, arguments)], capture_output=True, text=True, cwd=cwd, timeout=SECONDS
    )


def done(*arguments: object, cwd: Path | None = None) -> str:
    """Run the command, which must succeed; return its standard output."""
    answer = diffnea(*arguments, cwd=cwd)
    assert answer.returncode == DONE, answer.stderr
    return answer.stdout


def load(path: Path) -> Any:
    """Read JSON strictly: NaN and Infinity are no JSON."""

    def refuse(constant: str) -> None:
        raise ValueError(f"{path}: {constant} is no JSON")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
