"""Judge what `diffnea diagnose` said of a case of hidden_effects_generate.

    python3 score.py truth.json result.json

Needs Python alone. The outcomes:

    right       the set of causes is the truth: every effect at its joint, nothing else
    class       every truth stands in the class that a cause reports, nothing else is named
    confusable  what was named explains the truth as well as the truth does: a documented
                confusion, or simpler effects beyond which its expected LM is below CONFUSABLE
    partial     some of several effects, nothing wrong
    missed      nothing named although the truth can be seen
    unknown     UNKNOWN although the truth is in the catalogue
    wrong       a cause that is not there
    false_alarm a cause, or UNKNOWN, where nothing is to be seen
    failed      no result
"""

import json
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

Json = dict[str, Any]
Cause = tuple[str, str]

# Expected LM below which an effect need not be found: the goals of the study begin here.
VISIBLE = 30.0
# Expected LM of the truth over a rival below which ΔBIC = 10 cannot be expected, two more
# parameters at ln 2000 each and the spread of a χ² with mean 20 included.
CONFUSABLE = 30.0
# EFFECTS.md, known confusions: the same to first order in frequency, or unless poses are large.
DOCUMENTED = (
    {"actuator_lag", "actuator_delay"},
    {"tip_force", "base_tilt"},
    {"presliding_dahl", "presliding_lugre"},
    {"time_shift", "actuator_delay"},
    # Of the ball: more restoring force; and what is the same while the hand hardly turns.
    {"string_bending", "string_mass", "gravity_scale"},
    {"camera_offset", "wind", "attachment_offset", "camera_rotation"},
)
# Whose effects all show in one path.
BALL = {"ball", "string", "camera"}

GOOD = ("right", "class", "confusable")


@dataclass
class Score:
    """One case judged."""

    outcome: str
    truth: list[Cause]
    named: list[Cause]
    verdict: str = ""
    expected_lm: float | None = None  # of the weakest effect that must be found
    reachable_lm: float | None = None  # the same, counting the noise of the positions
    size: float | None = None  # its share of the joint's torque
    in_class: bool | None = None  # the truth is named or in a class
    class_size: float | None = None  # mean over the causes
    witness: bool | None = None  # UNKNOWN, and with the right variables
    next_experiment: str | None = None  # outcome of the recording that it proposes
    absorbed: bool | None = None  # the absorbed effect was declared as such
    covered: list[bool] = field(default_factory=list)  # 95 % intervals that hold the truth
    explained: float | None = None  # share of the removable held-out error
    oracle: str | None = None  # outcome with the true effects as the only candidates
    oracle_gain: float | None = None  # held-out gain over that of the true effects
    seconds: float | None = None


def place(where: str) -> str:
    """Return a place that does not depend on the order of a pair."""
    return ",".join(sorted(part.strip() for part in where.split(",")))


def cause(item: Json) -> Cause:
    return item["effect"], place(item["where"])


def documented(a: Cause, b: Cause) -> bool:
    shared = {a[1], b[1]} & {"all", "base", "tip"}
    if not (a[1] == b[1] or shared or {a[1], b[1]} <= BALL):
        return False
    return a[0] != b[0] and any({a[0], b[0]} <= alike for alike in DOCUMENTED)


def near(a: Cause, b: Cause) -> bool:
    """Whether a stands at a place of b, a pair perhaps."""
    return a[1] in b[1].split(",") or {a[1], b[1]} <= BALL


def confusable(effect: Json, named: set[Cause]) -> bool:
    """Whether causes at the effect's joint explain as much as the effect itself."""
    mine = cause(effect)
    if any(documented(mine, other) for other in named):
        return True
    here = {name for name, where in named if where == mine[1] or {where, mine[1]} <= BALL}
    if {"actuator_delay", "actuator_lag"} & here:
        here.add("actuator_lag")  # the rival's column stands for both
    return any(
        set(rival["effects"]) <= here and rival["lm_beyond"] < CONFUSABLE
        for rival in effect["rivals"]
    )


def named_causes(result: Json) -> list[Json]:
    """Return what has a name: a grey box's residual has none."""
    return [c for c in result["causes"] if c["effect"] != "residual"]


def all_classes(result: Json) -> list[set[Cause]]:
    return [
        {cause(c)} | {cause(other) for other in c.get("class", [])} for c in named_causes(result)
    ]


def judge_named(truth: Json, result: Json, score: Score) -> str:
    effects = truth["effects"]
    required = [e for e in effects if e["expected_lm"] >= VISIBLE]
    optional = [e for e in effects if e["expected_lm"] < VISIBLE]
    named, classes = set(score.named), all_classes(result)
    score.in_class = all(any(cause(e) in c for c in classes) for e in required)
    if not named:
        if result["verdict"] == "UNKNOWN":
            return "unknown"
        return "missed" if required else "right"
    allowed = {cause(e) for e in effects}
    needed = {cause(e) for e in required}
    if needed <= named <= allowed:
        return "right"
    if score.in_class and all(c & allowed for c in classes):
        return "class"
    # Every cause must serve a truth, and every truth must be served.
    served = [e for e in required if cause(e) in named or confusable(e, named)]
    useful = {
        c
        for c in named
        if c in allowed
        or any(
            documented(cause(e), c)
            or (near(c, cause(e)) and confusable(e, {c} if c[1] in BALL else named))
            for e in [*served, *optional]
        )
    }
    if useful == named:
        return "confusable" if len(served) == len(required) else "partial"
    return "wrong" if required else "false_alarm"


def judge_unknown(truth: Json, result: Json, score: Score) -> str:
    effect = truth["effects"][0]
    if effect["expected_lm"] < VISIBLE and not score.named:
        return "right"
    if result["verdict"] == "UNKNOWN" or (not score.named and result.get("witness")):
        wanted = set(effect["variables"])
        score.witness = any(
            wanted <= set(w["variables"]) and place(w["where"]) == place(effect["where"])
            for w in result.get("witness", [])
        )
        return "right"
    if not score.named:
        return "missed"
    return "confusable" if confusable(effect, set(score.named)) else "wrong"


def judge_absorbed(truth: Json, result: Json, score: Score) -> str:
    hidden = cause(truth["effects"][0])
    listed = {cause(a) for a in result.get("absorbed", [])}
    score.absorbed = hidden in listed or any(
        name == hidden[0] and where in ("all", "tip") for name, where in listed
    )
    quiet = not score.named and result["verdict"] in ("NONE", "NOT_IDENTIFIABLE")
    return "right" if quiet else "false_alarm"


def judge_audit(truth: Json, result: Json, score: Score) -> str:
    hidden = cause(truth["effects"][0])
    found = {(a["fault"], place(a["where"])) for a in result.get("audit", [])}
    if score.named or result["verdict"] == "UNKNOWN":
        return "false_alarm"
    return "right" if hidden in found else "missed"


def intervals(truth: Json, result: Json) -> Iterable[bool]:
    """Whether each parameter of each cause that is right lies in its 95 % interval."""
    true = {cause(e): e["parameters"] for e in truth["effects"]}
    for item in result["causes"]:
        values = true.get(cause(item), {})
        for parameter in item["parameters"]:
            value, interval = values.get(parameter["name"]), parameter.get("ci95")
            if isinstance(value, float) and interval and None not in interval:
                yield interval[0] <= value <= interval[1]


def judge(truth: Json, result: Json | None) -> Score:
    """Judge a result, None where `diagnose` gave none."""
    effects = truth["effects"]
    required = [e for e in effects if e["expected_lm"] >= VISIBLE] or effects
    score = Score("failed", [cause(e) for e in effects], [])
    if required and truth["kind"] != "audit":
        weakest = min(required, key=lambda e: e["expected_lm"])
        score.expected_lm, score.size = weakest["expected_lm"], weakest["size"]
        score.reachable_lm = min(e["reachable_lm"] for e in required)
    if result is None:
        return score
    score.verdict = result["verdict"]
    score.named = sorted({cause(c) for c in named_causes(result)})
    if score.named:
        sizes = [len(c) for c in all_classes(result)]
        score.class_size = sum(sizes) / len(sizes)
    if truth["kind"] == "none":
        alarm = score.named or score.verdict == "UNKNOWN"
        score.outcome = "false_alarm" if alarm else "right"
    else:
        judges = {
            "named": judge_named,
            "unknown": judge_unknown,
            "absorbed": judge_absorbed,
            "audit": judge_audit,
        }
        score.outcome = judges[truth["kind"]](truth, result, score)
    score.covered = list(intervals(truth, result))
    shares = [c["gain"]["explained_share"] for c in named_causes(result) if c.get("gain")]
    score.explained = shares[-1] if shares else None
    return score


def held_out_error(result: Json, which: str, noise: dict[str, float]) -> float:
    """Mean square torque error over the joint's noise variance, summed over the joints."""
    squares = ((j[which] / noise[j["joint"]]) ** 2 for j in result["joints"])
    return float(sum(squares))


def oracle_gain(result: Json, oracle: Json) -> float | None:
    """Held-out error that the result removes, over what the oracle's causes remove from the same.

    None where the oracle removes nothing. Both are measured in the oracle's noise: that of the
    diagnosis holds what it missed, if no periods tell the noise.
    """
    noise = {j["joint"]: j["noise_floor"] for j in oracle["joints"]}
    before = held_out_error(result, "base", noise)
    removable = before - held_out_error(oracle, "extended", noise)
    if removable <= 0.0:
        return None
    return (before - held_out_error(result, "extended", noise)) / removable


def judge_oracle(truth: Json, result: Json, oracle: Json | None, score: Score) -> None:
    """Compare with a diagnosis whose candidates were the true effects; it must accept them."""
    score.oracle = judge(truth, oracle).outcome
    if oracle is not None and oracle["causes"] and score.oracle == "right":
        score.oracle_gain = oracle_gain(result, oracle)


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    truth, result = (json.loads(Path(path).read_text(encoding="utf-8")) for path in sys.argv[1:])
    print(json.dumps(asdict(judge(truth, result)), indent=1))


if __name__ == "__main__":
    main()
