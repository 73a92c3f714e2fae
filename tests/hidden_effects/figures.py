"""Figures of a study of hidden effects: rates with their intervals, and the table.

A score here is what score.json of a case holds, and its group, family and kind.
"""

import math
import statistics
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from typing import Any

import score as scoring


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
