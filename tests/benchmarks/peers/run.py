# ruff: noqa: E501
"""All measurements beside the peers, then table and plots: see README.md in this folder.

run.py OUT [--python .venv/bin/python] [--rounds 3] [--skip-sysid] [--skip-mjx]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCE = HERE.parents[2]
SERVO_RUNS = SOURCE / "build" / "release" / "tests" / "studies" / "servo_runs"


def overlay(python: Path, folder: Path) -> Path:
    """A folder that holds diffnea's package alone: the rest of its environment is not the peers'."""
    words = "import diffnea, sys; print(sys.version_info[:2], diffnea.__path__[0], sep='|')"
    found = subprocess.run([python, "-c", words], check=True, capture_output=True, text=True)
    version, package = found.stdout.strip().split("|")
    if version != str(sys.version_info[:2]):
        raise SystemExit(
            f"run.py: diffnea is built for Python {version}, the peers' environment has {sys.version_info[:2]}: "
            "make it with the same Python"
        )
    folder.mkdir(parents=True, exist_ok=True)
    link = folder / "diffnea"
    link.unlink(missing_ok=True)
    link.symlink_to(package)
    return folder


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--python", type=Path, default=SOURCE / ".venv" / "bin" / "python")
    parser.add_argument("--servo-runs", type=Path, default=SERVO_RUNS, help="the study, built")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--skip-sysid", action="store_true")
    parser.add_argument("--skip-mjx", action="store_true")
    args = parser.parse_args()
    out = args.out.resolve()
    env = os.environ | {"PYTHONPATH": str(overlay(args.python, out / "overlay"))}
    identify = ["--rounds", args.rounds, "--diffnea", args.python.parent / "diffnea"]
    if args.skip_sysid:
        identify += ["--only", "diffnea", "least_squares", "figaroh"]
    servos = ["--diffnea", args.python.parent / "diffnea", "--servo-runs", args.servo_runs]
    if args.skip_sysid:
        servos += ["--only", "servo_diffnea", "servo_cmaes"]
    rollouts = ["--mjx", "--mjx-contacts", "--brax"] if args.skip_mjx else []
    for script, options in (
        ("dynamics", []),
        ("identify", identify),
        ("servos", servos),
        ("rollouts", rollouts),
        ("table", []),
        ("plots", []),
    ):
        words = [sys.executable, HERE / f"{script}.py", out, *options]
        subprocess.run(list(map(str, words)), check=True, env=env)


if __name__ == "__main__":
    main()
