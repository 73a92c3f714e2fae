"""What `diffnea diagnose` takes each effect for: the tables of docs/effects/confusions.md.

    python3 effect_rivals.py build/release -o build/effects [--seeds 1 2] [--family NAME …]

Every family of hidden_effects_generate is hidden in a recording and diagnosed: what is named, what
cannot be told from it (its class), the next rivals with how much worse they are, what the base
absorbs. A second diagnosis may name an effect of another kind alone, so that its witness says on
what the error depends. Finished cases are not done again; some seconds each.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

Json = dict[str, Any]
JOINT_SIZE = ("--smallest", "0.05", "--largest", "0.05")  # of the joint's torque
BALL_SIZE = ("--scale", "2")  # of the unit of each effect
SKIPPED = {"none", "ball_none", "two", "three", "outside", "absorbed"}
TIMEOUT = 600  # [s]


def run(*words: object) -> None:
    subprocess.run([str(w) for w in words], check=True, timeout=TIMEOUT, capture_output=True)


def read(path: Path) -> Json:
    out: Json = json.loads(path.read_text(encoding="utf-8"))
    return out


def beside_the_point(family: str) -> str:
    """Return a candidate that explains nothing of the family, or hardly anything."""
    if family.startswith("ball_"):
        return "dry_drag" if family == "ball_camera_delay" else "camera_delay"
    return "armature" if family.endswith("_offset") else "torque_offset"


def diagnosed(command: Path, home: Path, base: str, run_folder: str, *options: object) -> Json:
    seen, out = home / "seen", home / run_folder
    model = next(seen.glob("model.*"))
    words = (command, "diagnose", model, seen / "train.csv", "--test", seen / "test.csv")
    run(*words, "--base", base, "-o", out, "--quiet", "--threads", 1, *options)
    return read(out / "result.json")


def case(build: Path, home: Path, family: str, seed: int) -> Json:
    """Make and diagnose one case, or read what it gave before."""
    told = home / "told.json"
    if told.exists():
        return read(told)
    command = build / "apps" / "diffnea"
    size = BALL_SIZE if family.startswith("ball_") else JOINT_SIZE
    generator = build / "tests" / "hidden_effects" / "hidden_effects_generate"
    run(generator, "--seed", seed, "--family", family, *size, "-o", home)
    truth = read(home / "truth" / "truth.json")
    result = diagnosed(command, home, truth["base"], "run")
    alone = ("--effects", beside_the_point(family), "--no-grey-box")
    witness = diagnosed(command, home, truth["base"], "witness", *alone)["witness"]
    out = {
        "family": family,
        "hidden": [[e["effect"], e["where"]] for e in truth["effects"]],
        "expected_lm": [e["expected_lm"] for e in truth["effects"]],
        "audit": [[a["fault"], a["where"]] for a in result["audit"]],
        "absorbed": [[a["effect"], a["where"]] for a in result["absorbed"]],
        "verdict": result["verdict"],
        "causes": result["causes"],
        "witness": witness,
    }
    told.write_text(json.dumps(out, indent=1) + "\n", encoding="utf-8")
    return out


def place(name: str, where: str, here: str) -> str:
    return f"`{name}`" if where == here else f"`{name}` at {where}"


def row(told: Json) -> str:
    effect, where = told["hidden"][0]
    causes = told["causes"]
    named = ", ".join(place(c["effect"], c["where"], where) for c in causes)
    alike = [m for c in causes for m in c["class"]]
    rivals = [r for c in causes[:1] for r in c["rivals"]][:3]
    faults = ", ".join(f"audit: {f}" for f, _ in told["audit"])
    absorbed = [e for e, w in told["absorbed"] if e == effect and w == where]
    if absorbed:
        faults = ", ".join(filter(None, [faults, "absorbed"]))
    witness = "; ".join(" and ".join(w["variables"]) for w in told["witness"][:1])
    return " | ".join(
        [
            f"| `{effect}`",
            named or faults or told["verdict"],
            ", ".join(place(m["effect"], m["where"], where) for m in alike),
            ", ".join(
                f"{place(r['effect'], r['where'], where)} {r['delta_bic']:.0f}" for r in rivals
            ),
            f"{witness} |",
        ]
    )


def left_by_rivals(home: Path) -> str:
    """Return, of what the base leaves of a ball's effect, the share that the nearest rivals leave.

    By the generator's own simulation: derivatives of the path, states, length and attachment
    projected out.
    """
    effect = read(home / "truth" / "truth.json")["effects"][0]
    rivals = sorted(effect["rivals"], key=lambda r: r["lm_beyond"])[:4]
    shares = [f"`{r['effects'][0]}` {r['lm_beyond'] / effect['expected_lm']:.2g}" for r in rivals]
    return f"| `{effect['effect']}` | {effect['visible_share']:.2f} | {', '.join(shares)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", type=Path)
    parser.add_argument("-o", type=Path, required=True, dest="folder")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--family", nargs="*", default=[])
    args = parser.parse_args()
    generator = args.build / "tests" / "hidden_effects" / "hidden_effects_generate"
    listed = subprocess.run([generator, "--list"], capture_output=True, text=True, check=True)
    families = [f for f in listed.stdout.split() if f not in SKIPPED]
    for seed in args.seeds:
        print(f"\nseed {seed}\n")
        print("| hidden | named | class | next rivals, ΔBIC | witness |\n|---|---|---|---|---|")
        for family in args.family or families:
            try:
                told = case(args.build, args.folder / f"{family}-{seed}", family, seed)
            except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
                print(f"{family}: {error}", file=sys.stderr)
                continue
            print(row(told), flush=True)
        print("\n| hidden | visible share | left by the nearest rivals |\n|---|---|---|")
        for family in args.family or families:
            if family.startswith("ball_") and (args.folder / f"{family}-{seed}").exists():
                print(left_by_rivals(args.folder / f"{family}-{seed}"))


if __name__ == "__main__":
    main()
