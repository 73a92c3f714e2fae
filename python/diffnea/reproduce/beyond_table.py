"""Table of the step beyond: a line a string, a rope and a way to extend the model."""

from __future__ import annotations

import math
import statistics
from collections import Counter

import numpy as np

from .beyond import Row, Study
from .jobs import Job, Json, Results, in_order
from .numbers import difference, share
from .table import percent

HEAD = (
    "string",
    "rope",
    "extended by",
    "robots",
    "before",
    "after",
    "change, points",
    "path, before",
    "path, after",
)


def table_of(study: Study, results: Results) -> Json:
    """All rows, finished or not, and which builds made them."""
    done = [results.read(job) for job in in_order(study.jobs) if results.has(job)]
    return {
        "schema": "diffnea/beyond/1",
        "rows": [
            _row(row, k, results) for row in study.rows for k in range(len(row.units[0].after))
        ],
        "builds": sorted({result.content["build"] for result in done}),
        "cpu_seconds": sum(result.cpu_seconds for result in done),
    }


def _row(row: Row, k: int, results: Results) -> Json:
    """Figures of one extension, of the robots that are finished."""
    done = [
        unit
        for unit in row.units
        if results.has(unit.before) and results.has(unit.after[k].transfer)
    ]
    extension = row.units[0].after[k]
    out: Json = {
        "title": row.title,
        "length": row.length,
        "rope": row.rope,
        "effects": extension.effects,
        "robust": extension.robust,
        "asked": len(row.units),
        "robots": len(done),
    }
    if not done:
        return out
    first = [_policies(unit.before, results) for unit in done]
    later = [_policies(unit.after[k].transfer, results) for unit in done]
    before, after = ([[p["success"] for p in of] for of in groups] for groups in (first, later))
    diagnosed = [results.read(unit.after[k].diagnosed).data for unit in done]
    return out | {
        "before": share(before).to_dict(),
        "after": share(after).to_dict(),
        "change": difference(before, after).to_dict(),
        "path_before": _median_path(first),
        "path_after": _median_path(later),
        **_named(diagnosed),
        "sentences": [found["sentence"] for found in diagnosed],
    }


def _policies(job: Job, results: Results) -> list[Json]:
    found: list[Json] = results.read(job).data["policies"]
    return found


def _median_path(groups: list[list[Json]]) -> float | None:
    """Distance of imagined and obtained ball before the catch [m]."""
    found = [p["path_error"] for of in groups for p in of if p["path_error"] is not None]
    return float(np.median(found)) if found else None


def _named(diagnosed: list[Json]) -> Json:
    """In how many robots which cause was named, and with what values (median over these)."""
    named: Counter[str] = Counter()
    values: dict[str, list[float]] = {}
    for found in diagnosed:
        for cause in found["causes"]:
            of_ball = cause["where"] in ("string", "ball")
            name = cause["effect"] + ("" if of_ball else f"@{cause['where']}")
            named[name] += 1
            for parameter, (value, _, _) in cause["parameters"].items():
                if value is not None and math.isfinite(value):
                    values.setdefault(f"{name}.{parameter}", []).append(value)
    return {
        "named": dict(named.most_common()),
        "values": {name: statistics.median(of) for name, of in values.items()},
    }


def cells(row: Json) -> list[str]:
    """Texts of a row."""

    def shown(of: Json | None, sign: str = "") -> str:
        if of is None:
            return "–"
        low, high = (f"{100 * of[key]:{sign}.0f}" for key in ("low", "high"))
        unit = "" if sign else " %"
        return f"{100 * of['value']:{sign}.0f}{unit} ({low} to {high})"

    def millimetres(x: float | None) -> str:
        return "–" if x is None else f"{1e3 * x:.0f} mm"

    return [
        f"{100 * row['length']:.0f} cm",
        row["rope"],
        f"{row['effects']} (robust)" if row["robust"] else row["effects"],
        str(row["robots"]),
        shown(row.get("before")),
        shown(row.get("after")),
        shown(row.get("change"), "+"),
        millimetres(row.get("path_before")),
        millimetres(row.get("path_after")),
    ]


def said(row: Json) -> str:
    """Say of a finished row what was named, in how many robots."""
    if not row["named"]:
        return "nothing was named"
    parts = []
    for effect, count in row["named"].items():
        values = ", ".join(
            f"{name.removeprefix(effect + '.')} {value:.3g}"
            for name, value in row["values"].items()
            if name.startswith(f"{effect}.")
        )
        parts.append(f"{effect} {count} of {row['robots']} ({values})")
    return "; ".join(parts)


def verdict(row: Json) -> str:
    """Return the finding of a finished row in a sentence."""
    how = ", learned robustly" if row["robust"] else ""
    return (
        f"{row['title']}: {row['robots']} robots; {percent(row['before']['value'])} of the policies"
        f" transferred before, {percent(row['after']['value'])} after{how}."
    )
