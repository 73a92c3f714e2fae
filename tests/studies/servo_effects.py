"""Hide effects in servos of which no torque is logged, and count what `diffnea diagnose` says.

    .venv/bin/python tests/studies/servo_effects.py --first 3000 --seeds 10 -o build/servo_effects
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "hidden_effects"))
from servo_bench import SIZES, write_case  # noqa: E402

COMMAND = Path(sys.executable).parent / "diffnea"


def outcome(effect: str, finding: Any) -> str:
    """Judge one finding: right, class, more, wrong, missed, false alarm."""
    named = [cause["effect"] for cause in finding["causes"]]
    if effect == "none":
        return "false alarm" if named else "right"
    if named == [effect]:
        return "right"
    if not named:
        return "missed"
    members = {m["effect"] for cause in finding["causes"] for m in cause["class"]}
    if effect in named:
        return "more"
    return "class" if effect in members else "wrong"


def run(case: tuple[str, int, Path]) -> dict[str, Any]:
    """Make a case and diagnose it."""
    effect, seed, folder = case
    bench = write_case(folder, effect, seed)
    begin = time.monotonic()
    data = [folder / "train.csv", "--test", folder / "test.csv"]
    command = [COMMAND, "diagnose", folder / "bench.urdf", *data, "-o", folder / "run", "--quiet"]
    answer = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    row = {"effect": effect, "seed": seed, "seconds": time.monotonic() - begin}
    if answer.returncode != 0:
        return row | {"outcome": "failed", "said": answer.stderr.strip()}
    finding = json.loads((folder / "run/result.json").read_text(encoding="utf-8"))
    (joint,) = finding["joints"]
    row["outcome"] = outcome(effect, finding)
    row |= {key: 1e3 * joint[key] for key in ("base", "extended", "noise_floor")}
    row["named"] = [cause["effect"] for cause in finding["causes"]]
    row["verdict"] = finding["verdict"]
    if row["named"] == [effect] and effect not in ("cogging", "asymmetric_viscous"):
        low, high = finding["causes"][0]["parameters"][0]["ci95"]
        row["holds"] = low <= bench.size <= high
    return row


def main() -> None:
    """Run all cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=3000, help="first seed")
    parser.add_argument("--seeds", type=int, default=10, help="cases of each effect")
    parser.add_argument("--effects", nargs="+", default=list(SIZES), choices=SIZES)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("-o", type=Path, required=True, dest="folder")
    options = parser.parse_args()
    cases = [
        (effect, seed, options.folder / f"{effect}-{seed}")
        for seed in range(options.first, options.first + options.seeds)
        for effect in options.effects
    ]
    rows = []
    with ThreadPoolExecutor(options.jobs) as pool:
        for row in pool.map(run, cases):
            rows.append(row)
            print(json.dumps(row), flush=True)
    (options.folder / "rows.json").write_text(json.dumps(rows), encoding="utf-8")
    print()
    for effect in options.effects:
        of = [row for row in rows if row["effect"] == effect]
        counts: dict[str, int] = {}
        for row in of:
            counts[row["outcome"]] = counts.get(row["outcome"], 0) + 1
        held = [row["holds"] for row in of if "holds" in row]
        print(f"{effect:20s} {counts}" + (f", intervals {sum(held)} of {len(held)}" if held else ""))


if __name__ == "__main__":
    main()
