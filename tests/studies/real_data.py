"""Identify the measured robots, by the command, and print the figures of docs/results.md.

    python3 tests/studies/real_data.py build/release/apps/diffnea [NAME …]

NAME: emps, panda, ur10e, payload, double_pendulum; all if none is given. The recordings are not part of the project:
DIFFNEA_DATA names their folder, else ../shared/data beside the project. Needs Python alone. Every command is printed.
"""

import csv
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("DIFFNEA_DATA", SOURCE.parent / "shared" / "data"))
MODELS = SOURCE / "models"
PROGRAM = ""


def identify(title, folder, model, train, *options):
    """Run `diffnea identify`, print the command, return result.json."""
    run = folder / f"run_{len(list(folder.glob('run_*')))}"
    files = [str(f) for f in (train if isinstance(train, list) else [train])]
    arguments = ["identify", str(model), *files, *map(str, options), "-o", str(run)]
    shown = " ".join(a.replace(str(folder), "TMP").replace(str(DATA), "DATA").replace(str(SOURCE) + "/", "")
                     for a in arguments)
    print(f"\n{title}\n  $ diffnea {shown}", flush=True)
    done = subprocess.run([PROGRAM, *arguments, "--quiet", "--json"], capture_output=True, text=True)
    if done.returncode != 0:
        print(f"  exit code {done.returncode}: {done.stderr.strip()}")
    result = json.loads((run / "result.json").read_text())
    return run, result
