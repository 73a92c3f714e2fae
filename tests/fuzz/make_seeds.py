#!/usr/bin/env python3
"""Makes the seeds that are folders of runs: small runs of every command, cut to a few kB each.

    tests/fuzz/make_seeds.py [COMMAND]      COMMAND: build/release/apps/diffnea

The other seeds are written by hand. Needed again when a schema changes.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
SEEDS = ROOT / "tests" / "fuzz" / "seeds"
LONG = 40  # a longer list is a column, or a list of its like: its first entries tell as much
KEPT = 3


def cut(value: Any) -> Any:
    """Long lists lose all but their first entries, numbers all but six digits."""
    if isinstance(value, dict):
        return {key: cut(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [cut(entry) for entry in (value[:KEPT] if len(value) > LONG else value)]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def write_seed(target: str, name: str, folder: Path, *files: str) -> None:
    text = ""
    for file in files:
        data = json.loads((folder / file).read_text(encoding="utf-8"))
        exact = file.startswith("policy_")  # a covariance stays one
        if text:
            text += f"=== {file}\n"
        text += json.dumps(data if exact else cut(data), separators=(",", ":")) + "\n"
    path = SEEDS / target / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    print(f"{path.relative_to(ROOT)}: {len(text)} bytes")


def main(command: str) -> None:
    def run(*arguments: object) -> None:
        done = subprocess.run(
            [command, *map(str, arguments), "--quiet"], cwd=folder, stdout=subprocess.DEVNULL
        )
        if done.returncode not in (0, 3):  # 3: written, but no ball was caught so soon
            raise SystemExit(f"{arguments}: exit code {done.returncode}")

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        arm = ROOT / "models" / "double_pendulum.urdf"
        run("excite", arm, "--duration", 4, "-o", "motion.csv")
        run("simulate", arm, "--trajectory", "motion.csv", "--noise", 1, "-o", "arm.csv")
        run("identify", arm, "arm.csv", "-o", "FIT")
        write_seed("fit_run", "arm", folder / "FIT", "result.json", "series.json", "model.json")
        run("diagnose", arm, "arm.csv", "-o", "DIAGNOSIS")
        write_seed("diagnose_run", "arm", folder / "DIAGNOSIS", "result.json", "series.json")
        cart = ROOT / "models" / "cart_pole.xml"
        run("excite", cart, "--duration", 4, "-o", "cart_motion.csv")
        run("simulate", cart, "--trajectory", "cart_motion.csv", "-o", "cart.csv", "--world",
            "mujoco:cart_pole,perturb=none,effect=coulomb_friction@cart:coulomb=2")  # fmt: skip
        run("diagnose", cart, "cart.csv", "-o", "CART")
        write_seed("diagnose_run", "cart", folder / "CART", "result.json", "series.json")
        run("learn", "ball-in-cup", "wam4_ball_in_cup", "--iterations", 2, "--samples", 4,
            "--bases", 5, "-o", "LEARNED")  # fmt: skip
        common = ("model.json", "controller.json", "policy_0.json")
        write_seed("learn_run", "wam", folder / "LEARNED", "result.json", "series.json", *common)
        run("transfer", "LEARNED", "--repetitions", 1, "-o", "TRANSFER")
        write_seed("transfer_run", "wam", folder / "TRANSFER", "result.json", "series.json",
                   *common)  # fmt: skip
        write_seed("policy", "wam", folder / "LEARNED", "policy_0.json")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "build" / "release" / "apps" / "diffnea"))
