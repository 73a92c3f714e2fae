# ruff: noqa: E501
"""Ball in a cup, learned in a model and transferred to MuJoCo, by the command; figures of docs/results.md.

    python3 tests/studies/ball_in_cup.py build/release/apps/diffnea STUDY... [--seeds N] [--folder F]

STUDY: model       solved in the model: 35, 40, 45 cm with two joints, 40 cm with four
       nominal     transfer of policies learned with nominal parameters, 40 cm, ropes heavy, mid, light, none
       surrogate   surrogate A, rope mid, 35, 40, 45 cm: learned in the identified and in the nominal model, each in the same worlds
       settings    what the settings were chosen by: weights of the string's slack, nominal parameters, 40 cm, rope mid, seeds 1 to 30
       string      nominal parameters, 40 cm: the model's string extended by hand by what a rope does, ropes mid and heavy, seeds 31 to 46
       robust      surrogate A, 40 cm, robots 6 and on, ropes mid and heavy: learned in the identified model alone, in draws of its posterior, and in draws that vary
                   what its string may lack; the same number of rollouts, the same seeds
       loop        one loop from nothing, timed

No policy is chosen by its result, and no setting on these seeds. Shares with 95 % intervals (Wilson); those of differences are bootstrapped over worlds, whose
policies are not independent. What is finished is kept in the folder, and not repeated. Needs Python alone.
"""

import argparse
import json
import random
import statistics
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

Json = dict[str, Any]
NAME = "wam4_ball_in_cup"
FIRST_SEED = 1000  # settings were chosen on 1 to 30


def wilson(k: int, n: int) -> str:
    if n == 0:
        return "0 of 0"
    z, p = 1.96, k / n
    middle, half = (
        (p + z * z / (2 * n)) / (1 + z * z / n),
        z * (p * (1 - p) / n + z * z / (4 * n * n)) ** 0.5 / (1 + z * z / n),
    )
    return (
        f"{k} of {n} ({100 * p:.0f} %, {100 * (middle - half):.0f}-{100 * (middle + half):.0f} %)"
    )


class Study:
    def __init__(self, program: Path, folder: Path, options: Sequence[str]) -> None:
        self.program, self.folder, self.options = program, folder, options
        folder.mkdir(parents=True, exist_ok=True)
        model = subprocess.run(
            [program, "worlds", "--json"], check=True, capture_output=True, text=True
        ).stdout
        self.model = next(
            w["file"] for w in json.loads(model)["worlds"] if w["world"] == f"mujoco:{NAME}"
        )

    def run(self, name: str, *words: object) -> Json:
        """Run a command whose last option is -o, unless its result is there."""
        out = self.folder / name
        result = out / "result.json"
        if not result.exists():
            subprocess.run(
                [self.program, *map(str, words), "-o", out, "--quiet"],
                check=True,
                stdout=subprocess.DEVNULL,
            )
        return json.loads(result.read_text(encoding="utf-8"))

    def learn(self, name: str, model: object, seeds: int, *words: object) -> Json:
        return self.run(
            name, "learn", "ball-in-cup", model, "--seeds", seeds, *self.options, *words
        )

    def transfer(self, name: str, policies: str, world: str) -> Json:
        return self.run(
            name, "transfer", self.folder / policies, "--world", world, "--repetitions", 0
        )


def successes(transfer: Json) -> list[bool]:
    return [bool(p["success"]) for p in transfer["policies"]]


def solved_in_the_model(study: Study, seeds: int) -> None:
    for length, joints in ((0.35, 2), (0.40, 2), (0.45, 2), (0.40, 4)):
        words: list[object] = ["--string", length, "--seed", FIRST_SEED]
        if joints == 4:
            words += [
                "--joints",
                "joint1,joint2,joint3,joint4",
                "--samples",
                120,
                "--iterations",
                140,
                "--weight-std",
                0.2,
            ]
        r = study.learn(f"model_{int(100 * length)}_{joints}", study.model, seeds, *words)
        policies = r["policies"]
        print(
            f"{100 * length:.0f} cm, {joints} joints: solved {wilson(sum(p['solved'] for p in policies), len(policies))}; "
            f"median {statistics.median(p['seconds'] for p in policies):.2f} s, "
            f"{statistics.median(p['rollouts'] for p in policies):.0f} rollouts a seed",
            flush=True,
        )


def nominal(study: Study, seeds: int) -> None:
    study.learn("nominal_40", study.model, seeds, "--string", 0.4, "--seed", FIRST_SEED)
    for rope in ("heavy", "mid", "light", "none"):
        t = study.transfer(
            f"nominal_40_{rope}", "nominal_40", f"mujoco:{NAME},perturb=none,rope={rope}"
        )
        won = successes(t)
        print(f"nominal parameters, 40 cm, rope {rope}: {wilson(sum(won), len(won))}", flush=True)


def settings(study: Study) -> None:
    cases = [(slack, 1.0, 0.02) for slack in (0, 10, 20, 30, 100)] + [(20, 1.5, 0.02), (0, 1.0, 0.002)]  # fmt: skip
    for slack, duration, lambda_qd in cases:
        name = f"settings_{slack}_{duration}_{lambda_qd}"
        words = ("--slack", slack, "--duration", duration, "--lambda-qd", lambda_qd)
        study.learn(name, study.model, 30, "--string", 0.4, "--seed", 1, *words)
        won = successes(study.transfer(f"{name}_mid", name, f"mujoco:{NAME},perturb=none,rope=mid"))
        print(f"slack {slack}, {duration} s, lambda_qd {lambda_qd}: {wilson(sum(won), len(won))}", flush=True)  # fmt: skip


def surrogate(study: Study, seeds: int, lengths: Sequence[float]) -> None:
    each = 10
    for length in lengths:
        won: dict[str, list[list[bool]]] = {"identified": [], "nominal": []}
        for world in range(1, seeds // each + 1):
            name = f"surrogate_{int(100 * length)}_{world}"
            where = f"mujoco:{NAME},perturb=A,rope=mid,seed={world}"
            loop = study.folder / name
            if not (loop / "transfer" / "result.json").exists():
                subprocess.run(
                    [study.program, "experiment", "ball-in-cup", "--string", str(length), "--world", where, "--seeds", str(each),
                     "--seed", str(100 * world), "--repetitions", "0", *study.options, "-o", loop, "--quiet"],
                    check=True, stdout=subprocess.DEVNULL,
                )  # fmt: skip
            transfer = json.loads((loop / "transfer" / "result.json").read_text(encoding="utf-8"))
            won["identified"].append(successes(transfer))
            study.learn(f"{name}/nominal", study.model, each, "--string", length, "--seed", 100 * world)  # fmt: skip
            won["nominal"].append(
                successes(study.transfer(f"{name}/nominal_transfer", f"{name}/nominal", where))
            )
            counts = {k: (sum(map(sum, v)), sum(map(len, v))) for k, v in won.items()}
            print(f"  {name}: {counts}", flush=True)
        for k, v in won.items():
            print(
                f"surrogate A, {100 * length:.0f} cm, mid rope, {k}: {wilson(sum(map(sum, v)), sum(map(len, v)))}"
            )
        gains = [100 * (sum(i) - sum(n)) / len(i) for i, n in zip(won["identified"], won["nominal"], strict=True)]  # fmt: skip
        low, high = interval(gains)
        print(
            f"  identified less nominal: {statistics.mean(gains):+.0f} points (95 % {low:+.0f} to {high:+.0f})",
            flush=True,
        )


# What a massless string that becomes taut without rebound may lack; 1 is the cup's size.
LACKING = {
    "string.string_wrap.size": (0.0, 1.2),
    "string.string_rebound.restitution": (0.0, 0.3),
    "string.string_folding.resistance": (0.0, 0.03),
}


def string(study: Study) -> None:
    model: Path | str = study.model
    for values in ((0, 0, 0), (1.0, 0.15, 0), (1.0, 0.2, 0.015), (1.2, 0.15, 0.03)):
        name = "string_" + "_".join(f"{v:g}" for v in values)
        effects = [
            {
                "effect": parameter.split(".")[1],
                "where": "string",
                "parameters": [{"name": parameter.split(".")[2], "value": value}],
            }
            for parameter, value in zip(LACKING, values, strict=True)
            if value
        ]
        if effects:  # what was learned in without them, as `learn` wrote it
            plain = json.loads((study.folder / "string_0_0_0" / "model.json").read_text("utf-8"))
            model = study.folder / f"{name}.json"
            plain["effects"] += effects
            model.write_text(json.dumps(plain), encoding="utf-8")
        study.learn(name, model, 16, "--controller", study.model, "--string", 0.4, "--seed", 31)
        for rope in ("mid", "heavy"):
            t = study.transfer(f"{name}_{rope}", name, f"mujoco:{NAME},perturb=none,rope={rope}")
            won = successes(t)
            print(f"{name}, rope {rope}: {sum(won)} of {len(won)}, path {path(t):.0f} mm", flush=True)  # fmt: skip


def path(transfer: Json) -> float:
    """Distance of imagined and obtained ball at the catch, median [mm]."""
    found = [p["path_error"]["at_capture"] for p in transfer["policies"]]
    return 1e3 * statistics.median(e for e in found if e is not None)


def robust(study: Study, seeds: int) -> None:
    each = 20
    vary = [w for name, (low, high) in LACKING.items() for w in ("--vary", f"{name}={low}:{high}")]
    cases: dict[str, list[str]] = {
        "plain": [],
        "posterior": ["--robust"],
        "string": ["--robust", *vary],
    }
    won: dict[tuple[str, str], list[list[bool]]] = {}
    for world in range(6, 6 + max(1, seeds // each)):  # settings were tried on robots 4 and 5
        name, where = f"robust_{world}", f"mujoco:{NAME},perturb=A,rope=mid,seed={world}"
        loop = study.folder / name
        model = loop / "identify-ball" / "model.json"
        if not model.exists():
            subprocess.run(
                [study.program, "experiment", "ball-in-cup", "--string", "0.40", "--world", where, "--seed", str(100 * world),
                 "--repetitions", "0", *study.options, "-o", loop, "--quiet"], check=True, stdout=subprocess.DEVNULL)  # fmt: skip
        for case, words in cases.items():
            common = ("--controller", study.model, "--string", 0.40, "--seed", FIRST_SEED)
            run = study.learn(f"{name}/{case}", model, each, *common, *words)
            for rope in ("mid", "heavy"):
                on = where.replace("rope=mid", f"rope={rope}")
                t = study.transfer(f"{name}/{case}_{rope}", f"{name}/{case}", on)
                won.setdefault((case, rope), []).append(successes(t))
                print(
                    f"  robot {world}, {case}, rope {rope}: {sum(won[case, rope][-1])} of {each}, path {path(t):.0f} mm; "
                    f"{run['summary']['rollouts']} rollouts",
                    flush=True,
                )
    for (case, rope), by_robot in won.items():
        k, n = sum(map(sum, by_robot)), sum(map(len, by_robot))
        gains = [100 * (sum(b) - sum(a)) / each for a, b in zip(won["plain", rope], by_robot, strict=True)]  # fmt: skip
        low, high = interval(gains)
        print(f"{case}, rope {rope}: {wilson(k, n)}; against plain {statistics.mean(gains):+.0f} points (95 % {low:+.0f} to {high:+.0f} over robots)")  # fmt: skip


def interval(gains: Sequence[float]) -> tuple[float, float]:
    """95 % interval of their mean, bootstrapped."""
    rng = random.Random(0)
    means = sorted(statistics.mean(rng.choices(gains, k=len(gains))) for _ in range(4000))
    return means[100], means[3900]


def loop(study: Study) -> None:
    start = time.monotonic()
    subprocess.run(
        [study.program, "experiment", "ball-in-cup", "--string", "0.40", "--world", f"mujoco:{NAME},perturb=A,rope=mid,seed=1",
         *study.options, "--seeds", "4", "-o", study.folder / f"loop_{int(start)}"], check=True)  # fmt: skip
    print(f"the loop from nothing: {time.monotonic() - start:.0f} s", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("program", type=Path)
    parser.add_argument(
        "study",
        nargs="+",
        choices=("model", "nominal", "settings", "surrogate", "string", "robust", "loop"),
    )
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--lengths", type=float, nargs="+", default=(0.40, 0.35, 0.45))
    parser.add_argument("--folder", type=Path, default=Path("build/ball_in_cup"))
    parser.add_argument("--option", action="append", default=[], help="of `learn`, e.g. --option=--duration=1.0")  # fmt: skip
    args = parser.parse_args()
    study = Study(args.program, args.folder, args.option)
    if "model" in args.study:
        solved_in_the_model(study, args.seeds)
    if "nominal" in args.study:
        nominal(study, args.seeds)
    if "settings" in args.study:
        settings(study)
    if "surrogate" in args.study:
        surrogate(study, args.seeds, args.lengths)
    if "string" in args.study:
        string(study)
    if "robust" in args.study:
        robust(study, args.seeds)
    if "loop" in args.study:
        loop(study)


if __name__ == "__main__":
    main()
