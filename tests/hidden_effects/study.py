"""Hide effects in hundreds of recordings, let `diffnea diagnose` look for them, write the table.

    python3 study.py build/release --set report -o build/study
    python3 study.py build/release --set tune --count 5 --family coulomb_friction -o build/tune

BUILD holds the generators and the command. One folder a case; what is finished is not done again,
so the study can be stopped and resumed. A case is made again from its name:
hidden_effects_generate with its group's options, seed and family. `--generator rigs` takes the
cases from the second generator, which shares nothing with the first; give it a folder of its own.
Thresholds are tuned on the seeds of `tune` and reported on those of `report`; those of `suite` are
the tests' (sample_test.py). `--table` only
writes the table anew, `--rescore` judges the stored results anew. `--oracle` diagnoses each case
of named effects again with those as the only candidates, finished cases as well.
"""

import argparse
import concurrent.futures
import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))
import figures
import score as scoring

# The first seed of each set; a set holds less than FIRST_SEED["report"] - FIRST_SEED["tune"] seeds.
FIRST_SEED = {"tune": 1_000, "report": 1_000_000, "suite": 3_000_000}
# Programs that make the cases, below BUILD.
GENERATORS = {
    "first": Path("tests/hidden_effects/hidden_effects_generate"),
    "rigs": Path("tests/hidden_effects/rigs/hidden_effects_rigs"),
}
TIMEOUT = 600  # [s] for one diagnosis
NEXT_PERIOD = 10  # [s] of the motion that a diagnosis proposes


@dataclass(frozen=True)
class Group:
    """Cases that are made alike."""

    name: str
    options: tuple[str, ...] = ()
    families: tuple[str, ...] = ()  # empty: all of the joints but `none`
    ball: bool = False  # all of the ball but `ball_none`

    def chosen(self, every: list[str]) -> list[str]:
        if self.families:
            return [f for f in self.families if f in every]
        return [f for f in every if f.startswith("ball_") == self.ball and not is_none(f)]


def is_none(family: str) -> bool:
    return family in ("none", "ball_none")


GROUPS = (
    Group("main"),
    Group("none", families=("none",)),
    Group("none_noisy", ("--noise", "0.05"), ("none",)),
    # Half as long, and nothing repeats: noise is what no smooth function of the motion explains.
    Group("aperiodic", ("--aperiodic", "--duration", "20")),
    Group("aperiodic_none", ("--aperiodic", "--duration", "20"), ("none",)),
    # Around the smallest effects that can be found: expected LM of 10 to 1000.
    Group("weak", ("--smallest", "0.0003", "--largest", "0.003")),
    # Lag and delay differ to second order only: long ones.
    Group(
        "lag_or_delay",
        ("--smallest", "0.05", "--largest", "0.4"),
        ("actuator_lag", "actuator_delay"),
    ),
    # 0.3 to 3 times the unit of each effect; a tenth of that has expected LM of 10 to 1000.
    Group("ball", ball=True),
    Group("ball_unit", ("--scale", "1"), ball=True),
    Group("ball_weak", ("--smallest-ball", "0.03", "--largest-ball", "0.3"), ball=True),
    Group("ball_none", families=("ball_none",)),
)


@dataclass(frozen=True)
class Case:
    group: Group
    family: str
    seed: int

    @property
    def name(self) -> str:
        return f"{self.group.name}-{self.family}-{self.seed}"


def families(generator: Path) -> list[str]:
    return subprocess.run(
        [generator, "--list"], capture_output=True, text=True, check=True
    ).stdout.split()


def plan(args: argparse.Namespace, all_families: list[str]) -> list[Case]:
    cases = []
    for group in GROUPS:
        if args.group and group.name not in args.group:
            continue
        for family in group.chosen(all_families):
            count = args.none if is_none(family) else args.count
            if args.family and family not in args.family:
                continue
            first = FIRST_SEED[args.set] + args.skip
            cases += [Case(group, family, first + i) for i in range(count)]
    # Spread over the families, so that what is finished is always a fair sample.
    return sorted(cases, key=lambda c: (c.seed, c.name))


@dataclass(frozen=True)
class Tools:
    """What makes and diagnoses the cases."""

    generator: Path
    command: Path
    keep: bool = False  # recordings and RUN folders
    oracle: bool = False

    def make(self, case: Case, home: Path) -> list[Any]:
        """Return the command that makes a case; its last word is the folder."""
        words: list[Any] = [self.generator, "--seed", str(case.seed), "--family", case.family]
        return [*words, *case.group.options, "-o", home]


def run_case(case: Case, folder: Path, tools: Tools) -> str | None:
    """Make, diagnose and judge one case; return what went wrong."""
    home = folder / case.name
    finished = (home / "score.json").exists()
    keep = tools.keep or (finished and (home / "seen").exists())
    message = "" if finished else first_look(case, home, tools)
    if tools.oracle and not message:
        message = ask_oracle(case, home, tools)
    if not keep:
        for made_there in ("seen", "run", "next", "oracle"):
            shutil.rmtree(home / made_there, ignore_errors=True)
    return f"{case.name}: {message}" if message else None


def first_look(case: Case, home: Path, tools: Tools) -> str:
    shutil.rmtree(home, ignore_errors=True)
    make = tools.make(case, home)
    made = subprocess.run(make, capture_output=True, text=True)
    if made.returncode != 0:
        return made.stderr.strip()
    truth = read(home / "truth" / "truth.json")
    begun = time.monotonic()
    message, result = diagnose(
        tools.command, home, truth["base"], "--test", home / "seen" / "test.csv"
    )
    seconds = time.monotonic() - begun
    score = scoring.judge(truth, result)
    if result is not None:
        shutil.copy(home / "run" / "result.json", home / "result.json")
        follow_up(home, make, tools.command, truth, result, score)
    write_score(home, score, seconds)
    return message


def ask_oracle(case: Case, home: Path, tools: Tools) -> str:
    """Diagnose again with the true effects as the only candidates, on the rows of the first look.

    Of an effect of two joints all pairs are candidates.
    """
    truth = read(home / "truth" / "truth.json")
    if (home / "oracle.json").exists() or not (home / "result.json").exists():
        return ""
    if truth["kind"] != "named" or case.family.startswith("ball_"):
        return ""  # the error of a ball has no joints
    if not (home / "seen").exists():
        made = subprocess.run(tools.make(case, home), capture_output=True, text=True)
        if made.returncode != 0:
            return made.stderr.strip()
    effects = {
        e["effect"] if "," in e["where"] else f"{e['effect']}@{e['where']}"
        for e in truth["effects"]
    }
    options: list[Any] = ["--test", home / "seen" / "test.csv", "--effects", ",".join(effects)]
    message, oracle = diagnose(tools.command, home, truth["base"], *options, run="oracle")
    if oracle is not None:
        shutil.copy(home / "oracle" / "result.json", home / "oracle.json")
        rescore(home)
    return message


def read(path: Path) -> scoring.Json:
    out: scoring.Json = json.loads(path.read_text(encoding="utf-8"))
    return out


def diagnose(
    command: Path, home: Path, base: str, *options: Any, run: str = "run"
) -> tuple[str, scoring.Json | None]:
    """What went wrong, or nothing, and the result."""
    seen = home / "seen"
    model = next(seen.glob("model.*"))  # .xml or .urdf, of the ball .json
    look: list[Any] = [command, "diagnose", model, seen / "train.csv"]
    look += ["--base", base, "-o", home / run, *map(str, options), "--quiet", "--threads", "1"]
    try:
        looked = subprocess.run(look, capture_output=True, text=True, timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        return f"no answer within {TIMEOUT} s", None
    if looked.returncode != 0:
        return looked.stderr.strip(), None
    return "", read(home / run / "result.json")


def follow_up(
    home: Path,
    make: list[Any],
    command: Path,
    truth: scoring.Json,
    result: scoring.Json,
    score: scoring.Score,
) -> None:
    """Record the next experiment that the diagnosis proposes, and diagnose it by itself."""
    proposed = result.get("next_experiment") or {}
    if not proposed.get("trajectory") or truth["family"].startswith("ball_"):
        return  # the motions of the ball's families are drawn
    home_next = home / "next"
    motion = home / "run" / proposed["trajectory"]
    again = [*make[:-1], home_next, "--motion", motion, "--motion-period", str(NEXT_PERIOD)]
    if subprocess.run(again, capture_output=True).returncode != 0:
        return  # the robot cannot follow it
    _, second = diagnose(command, home_next, truth["base"])
    score.next_experiment = scoring.judge(truth, second).outcome


def write_score(home: Path, score: scoring.Score, seconds: float | None) -> None:
    score.seconds = seconds
    partial = home / "score.json.tmp"
    partial.write_text(json.dumps(asdict(score), indent=1) + "\n", encoding="utf-8")
    partial.replace(home / "score.json")


def rescore(home: Path) -> None:
    truth, before = read(home / "truth" / "truth.json"), read(home / "score.json")
    stored, oracle = home / "result.json", home / "oracle.json"
    result = read(stored) if stored.exists() else None
    score = scoring.judge(truth, result)
    score.next_experiment = before.get("next_experiment")
    if result is not None and oracle.exists():
        scoring.judge_oracle(truth, result, read(oracle), score)
    write_score(home, score, before["seconds"])


def stored(cases: list[Case], folder: Path) -> list[dict[str, Any]]:
    out = []
    for case in cases:
        home = folder / case.name
        if not (home / "score.json").exists():
            continue
        s, truth = read(home / "score.json"), read(home / "truth" / "truth.json")
        out.append(s | {"group": case.group.name, "family": case.family, "kind": truth["kind"]})
    return out


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("build", type=Path, help="build folder with the generator and the command")
    parser.add_argument("--generator", choices=GENERATORS, default="first")
    parser.add_argument("--set", choices=FIRST_SEED, default="tune", help="which seeds")
    parser.add_argument("--count", type=int, default=20, help="cases a family and group")
    parser.add_argument("--none", type=int, default=400, help="cases that hide nothing")
    parser.add_argument(
        "--skip", type=int, default=0, help="seeds of each family that were looked at"
    )
    parser.add_argument("--family", action="append", help="only this one; may be repeated")
    parser.add_argument("--group", action="append", choices=[g.name for g in GROUPS])
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--keep", action="store_true", help="keep recordings and RUN folders")
    parser.add_argument("--oracle", action="store_true", help="diagnose with the truth given, too")
    parser.add_argument("--rescore", action="store_true", help="judge stored results anew")
    parser.add_argument("--table", action="store_true", help="only write the table")
    parser.add_argument("-o", dest="folder", type=Path, required=True, help="folder of the study")
    args = parser.parse_args()
    if args.skip < 0:
        parser.error(f"--skip: got {args.skip}, expected how many seeds of a family to leave out")

    generator = (args.build / GENERATORS[args.generator]).resolve()
    command = (args.build / "apps/diffnea").resolve()
    tools = Tools(generator, command, args.keep, args.oracle)
    cases = plan(args, families(generator))
    args.folder.mkdir(parents=True, exist_ok=True)
    if not (args.table or args.rescore):
        with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
            jobs = [pool.submit(run_case, case, args.folder, tools) for case in cases]
            for done, job in enumerate(concurrent.futures.as_completed(jobs), start=1):
                if message := job.result():
                    print(message, file=sys.stderr)
                if done % 20 == 0 or done == len(jobs):
                    print(f"{done} of {len(jobs)} cases", file=sys.stderr)
    if args.rescore:
        for case in cases:
            if (args.folder / case.name / "score.json").exists():
                rescore(args.folder / case.name)
    first = FIRST_SEED[args.set] + args.skip
    title = f"Hidden effects, generator `{args.generator}`, set `{args.set}` (seeds from {first})"
    text = figures.table(stored(cases, args.folder), title)
    (args.folder / f"{args.set}.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
