"""Hide effects in hundreds of recordings, let `diffnea diagnose` look for them, write the table.

    python3 study.py build/release --set report -o build/study
    python3 study.py build/release --set tune --count 5 --family coulomb_friction -o build/tune

BUILD holds the generator and the command. One folder a case; what is finished is not done again,
so the study can be stopped and resumed. A case is made again from its name:
hidden_effects_generate with its group's options, seed and family. Thresholds are tuned on the
seeds of `tune` and reported on those of `report`. `--table` only writes the table anew,
`--rescore` judges the stored results anew. `--oracle` diagnoses each case of named effects again
with those as the only candidates, finished cases as well.
"""

import argparse
import concurrent.futures
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))
import score as scoring

# The first seed of each set; a set holds less than FIRST_SEED["report"] - FIRST_SEED["tune"] seeds.
FIRST_SEED = {"tune": 1_000, "report": 1_000_000}
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
            return list(self.families)
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
            first = FIRST_SEED[args.set]
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

    The command line cannot name a pair of joints: of an effect of two all pairs are candidates.
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
    rows = read(home / "result.json")["preprocessing"]
    if oracle is not None and oracle["preprocessing"]["filter_hz"] != rows["filter_hz"]:
        # One of the two looked a second time, at higher frequencies.
        options += ["--filter", rows["filter_hz"], "--decimate", rows["decimated_to_hz"]]
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
    model = next(seen.glob("model.*"))  # .xml, of the ball .json
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


# --- figures


def wilson(hits: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """95 % interval of a rate (Wilson 1927)."""
    if n == 0:
        return 0.0, 1.0
    p, d = hits / n, 1.0 + z * z / n
    middle = (p + z * z / (2 * n)) / d
    half = z / d * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(0.0, middle - half), min(1.0, middle + half)


def upper_bound(hits: int, n: int, confidence: float = 0.95) -> float:
    """One-sided upper bound of a rate (Clopper and Pearson 1934)."""
    if hits >= n:
        return 1.0

    def at_most(p: float) -> float:
        return sum(math.comb(n, k) * p**k * (1 - p) ** (n - k) for k in range(hits + 1))

    low, high = hits / n, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if at_most(middle) > 1 - confidence else (low, middle)
    return high


def rate(scores: list[dict[str, Any]], good: Callable[[dict[str, Any]], bool]) -> str:
    if not scores:
        return "–"
    hits = sum(map(good, scores))
    low, high = wilson(hits, len(scores))
    return f"{hits}/{len(scores)} ({100 * low:.0f}–{100 * high:.0f} %)"


def size_named_in(share: float, scores: list[dict[str, Any]]) -> float | None:
    """Size at which `share` of the cases is named: a logistic curve over its logarithm.

    Newton's steps with a weak prior (slope 2 ± 2 per e-fold), without which perfect separation has
    no maximum. None where fewer than 8 cases, or none at all, were named, or it would be above 1.
    """
    points = [(math.log(s["size"]), s["outcome"] in scoring.GOOD) for s in scores if s["size"]]
    if len(points) < 8 or not any(y for _, y in points):
        return None
    mean = sum(x for x, _ in points) / len(points)
    a, b = 0.0, 2.0
    for _ in range(50):
        ga, gb, haa, hab, hbb = -a / 25, -(b - 2) / 4, 1 / 25, 0.0, 1 / 4
        for x, y in points:
            u = x - mean
            p = 1 / (1 + math.exp(-max(-500.0, min(500.0, a + b * u))))
            ga, gb = ga + y - p, gb + (y - p) * u
            w = p * (1 - p)
            haa, hab, hbb = haa + w, hab + w * u, hbb + w * u * u
        det = haa * hbb - hab * hab
        da, db = (hbb * ga - hab * gb) / det, (haa * gb - hab * ga) / det
        step = min(1.0, 2.0 / (abs(da) + abs(db) + 1e-12))
        a, b = a + step * da, max(0.1, b + step * db)
    size = math.exp(mean + (math.log(share / (1 - share)) - a) / b)
    return size if size <= 1.0 else None  # all of the torque: the curve says nothing


def good(s: dict[str, Any]) -> bool:
    return s["outcome"] in scoring.GOOD


def right(s: dict[str, Any]) -> bool:
    return s["outcome"] == "right"


def by_power(
    scores: list[dict[str, Any]], low: float, high: float, lm: str = "expected_lm"
) -> list[dict[str, Any]]:
    return [s for s in scores if s.get(lm) is not None and low <= s[lm] < high]


def mean(values: Iterable[float | None]) -> str:
    known = [v for v in values if v is not None]
    return f"{sum(known) / len(known):.2f}" if known else "–"


def oracle_lines(scores: list[dict[str, Any]]) -> list[str]:
    """Held-out gain over the true effects', of cases in which those were diagnosed alone."""
    asked = [s for s in scores if s.get("oracle")]
    if not asked:
        return []
    gains: dict[str, list[float]] = defaultdict(list)
    for s in asked:
        if s["oracle_gain"] is not None:
            gains[s["family"]].append(s["oracle_gain"])
    medians = {family: statistics.median(mine) for family, mine in gains.items()}
    accepted = sum(map(len, gains.values()))
    lines = [f"| the true effects given alone are accepted | {accepted}/{len(asked)} |"]
    if accepted:
        worst = min(medians, key=lambda family: medians[family])
        median = statistics.median(g for mine in gains.values() for g in mine)
        lines += [
            f"| held-out gain over theirs where they are, median | {median:.3f} |",
            f"| …, median of the worst family | {medians[worst]:.3f} ({worst}) |",
        ]
    return lines


def ball_lines(scores: list[dict[str, Any]]) -> list[str]:
    """The goals for the ball, and its families."""
    named = [s for s in scores if s["kind"] == "named"]
    strong, weak = by_power(named, 100, math.inf), by_power(named, 30, 100)
    unit = [s for s in named if 0.7 <= (s["size"] or 0.0) <= 1.4]
    absorbed = [s for s in scores if s["kind"] == "absorbed"]
    none = [s for s in scores if s["kind"] == "none"]
    alarms = sum(s["outcome"] != "right" for s in none)
    bound = f", at most {100 * upper_bound(alarms, len(none)):.2f} %" if none else ""
    in_class = rate(by_power(named, 30, math.inf), lambda s: bool(s["in_class"]))
    covered = [{"hit": c} for s in scores if right(s) for c in s["covered"]]
    lines = ["", "## Ball", "", "| figure | value |", "|---|---|"]
    for title, mine in (("LM ≥ 100", strong), ("LM 30–100", weak), ("0.7–1.4 of the unit", unit)):
        lines += [
            f"| right effect, {title} | {rate(mine, right)} |",
            f"| …, or a class or confusion that holds it | {rate(mine, good)} |",
        ]
    lines += [
        f"| truth in a reported class, LM ≥ 30 | {in_class} |",
        f"| nothing hidden: false alarms | {alarms}/{len(none)}{bound} |",
        f"| absorbed: no cause | {rate(absorbed, right)} |",
        f"| absorbed: declared | {rate(absorbed, lambda s: bool(s['absorbed']))} |",
        f"| 95 % intervals that hold the truth | {rate(covered, lambda c: c['hit'])} |",
        f"| explained share, mean | {mean(s['explained'] for s in named)} |",
        f"| seconds a diagnosis, mean | {mean(s['seconds'] for s in scores)} |",
        f"| no result | {sum(s['outcome'] == 'failed' for s in scores)} |",
    ]
    return lines


def table(every: list[dict[str, Any]], title: str) -> str:
    scores = [s for s in every if not s["family"].startswith("ball_")]
    ball = [s for s in every if s["family"].startswith("ball_")]
    named = [s for s in scores if s["kind"] == "named"]
    every_single = [s for s in named if len(s["truth"]) == 1]
    single = [s for s in every_single if s["group"] != "aperiodic"]
    aperiodic = by_power([s for s in every_single if s["group"] == "aperiodic"], 100, math.inf)
    lines = [f"# {title}", "", f"{len(every)} cases. Rates with 95 % intervals (Wilson).", ""]

    lines += ["| nothing hidden | cases | false alarms | 95 % upper bound |", "|---|---|---|---|"]
    for group in ("none", "none_noisy", "aperiodic_none"):
        mine = [s for s in scores if s["group"] == group]
        alarms = sum(s["outcome"] != "right" for s in mine)
        bound = f"{100 * upper_bound(alarms, len(mine)):.2f} %" if mine else "–"
        lines.append(f"| {group} | {len(mine)} | {alarms} | {bound} |")

    strong, weak = by_power(single, 100, math.inf), by_power(single, 30, 100)
    reachable = by_power(single, 100, math.inf, "reachable_lm")
    catalogue = by_power(named, 30, math.inf)
    unknown = [s for s in scores if s["kind"] == "unknown" and (s["expected_lm"] or 0) >= 30]
    absorbed = [s for s in scores if s["kind"] == "absorbed"]
    audit = [s for s in scores if s["kind"] == "audit"]
    lag = [s for s in scores if s["group"] == "lag_or_delay"]
    followed = [s for s in scores if s.get("next_experiment")]

    def alone(s: dict[str, Any]) -> bool:
        return str(s["next_experiment"]) == "right"

    in_class = rate(catalogue, lambda s: bool(s["in_class"]))
    covered = [{"hit": c} for s in scores if right(s) for c in s["covered"]]
    lines += [
        "",
        "| figure | value |",
        "|---|---|",
        f"| right effect and joint, expected LM ≥ 100 | {rate(strong, right)} |",
        f"| the same, motions that never repeat | {rate(aperiodic, right)} |",
        f"| …, or a class or confusion that holds it | {rate(strong, good)} |",
        f"| right effect and joint, reachable LM ≥ 100 | {rate(reachable, right)} |",
        f"| …, or a class or confusion that holds it | {rate(reachable, good)} |",
        f"| right effect and joint, expected LM 30–100 | {rate(weak, right)} |",
        f"| …, or a class or confusion that holds it | {rate(weak, good)} |",
        f"| truth in a reported class, LM ≥ 30 | {in_class} |",
        f"| mean class size | {mean(s['class_size'] for s in catalogue)} |",
    ]
    for family in ("two", "three"):
        mine = [s for s in named if s["family"] == family]
        lines.append(f"| exact set, {family} effects | {rate(mine, right)} |")
    lines += [
        f"| outside the catalogue: UNKNOWN | {rate(unknown, right)} |",
        f"| …, with the right variables | {rate(unknown, lambda s: bool(s['witness']))} |",
        "| in the catalogue, called UNKNOWN "
        f"| {rate(catalogue, lambda s: s['outcome'] == 'unknown')} |",
        f"| absorbed: no cause | {rate(absorbed, right)} |",
        f"| absorbed: declared | {rate(absorbed, lambda s: bool(s['absorbed']))} |",
        f"| channel fault found by the audit | {rate(audit, right)} |",
        f"| long lag told from long delay | {rate(lag, right)} |",
        f"| the next experiment, where one is proposed, is right | {rate(followed, alone)} |",
        f"| 95 % intervals that hold the truth | {rate(covered, lambda c: c['hit'])} |",
        f"| explained share, mean | {mean(s['explained'] for s in named)} |",
        *oracle_lines(catalogue),
        f"| seconds a diagnosis, mean | {mean(s['seconds'] for s in scores)} |",
        f"| no result | {sum(s['outcome'] == 'failed' for s in scores)} |",
    ]

    if ball:
        lines += ball_lines(ball)

    scores = every
    named = [s for s in every if s["kind"] == "named"]
    lines += ["", "## By family", ""]
    lines += [
        "| family | right, LM ≥ 100 | acceptable | right, LM 30–100 | acceptable "
        "| size named in 90 % |",
        "|---|---|---|---|---|---|",
    ]
    for family in sorted({s["family"] for s in named}):
        mine = [s for s in named if s["family"] == family]
        a, b = by_power(mine, 100, math.inf), by_power(mine, 30, 100)
        size = size_named_in(0.9, [s for s in mine if s["group"] in ("main", "weak")])
        shown = f"{100 * size:.2g} %" if size else "–"
        lines.append(
            f"| {family} | {rate(a, right)} | {rate(a, good)} | {rate(b, right)} "
            f"| {rate(b, good)} | {shown} |"
        )

    lines += ["", "## What was named instead", "", "| truth | named | cases |", "|---|---|---|"]
    confusion: dict[str, Counter[str]] = defaultdict(Counter)
    for s in scores:
        if right(s):
            continue
        answer = "+".join(sorted({e for e, _ in s["named"]})) or s["verdict"] or "no result"
        if s["named"] and {e for e, _ in s["named"]} == {e for e, _ in s["truth"]}:
            answer += " elsewhere"
        truth = "+".join(sorted({e for e, _ in s["truth"]})) or "nothing"
        confusion[truth][f"{answer} ({s['outcome']})"] += 1
    for truth in sorted(confusion):
        for answer, count in confusion[truth].most_common():
            lines.append(f"| {truth} | {answer} | {count} |")
    return "\n".join(lines) + "\n"


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
    parser.add_argument("--set", choices=FIRST_SEED, default="tune", help="which seeds")
    parser.add_argument("--count", type=int, default=20, help="cases a family and group")
    parser.add_argument("--none", type=int, default=400, help="cases that hide nothing")
    parser.add_argument("--family", action="append", help="only this one; may be repeated")
    parser.add_argument("--group", action="append", choices=[g.name for g in GROUPS])
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--keep", action="store_true", help="keep recordings and RUN folders")
    parser.add_argument("--oracle", action="store_true", help="diagnose with the truth given, too")
    parser.add_argument("--rescore", action="store_true", help="judge stored results anew")
    parser.add_argument("--table", action="store_true", help="only write the table")
    parser.add_argument("-o", dest="folder", type=Path, required=True, help="folder of the study")
    args = parser.parse_args()

    generator = (args.build / "tests/hidden_effects/hidden_effects_generate").resolve()
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
    first = FIRST_SEED[args.set]
    title = f"Hidden effects, set `{args.set}` (seeds from {first})"
    text = table(stored(cases, args.folder), title)
    (args.folder / f"{args.set}.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
