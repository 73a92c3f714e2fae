"""The table: figures of every row, as JSON, CSV, LaTeX and text."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from .jobs import Job, Json, Result, Results, in_order, plain
from .numbers import best, bootstrap, share, wilson
from .paper import paper_row
from .table1 import SIMULATION, TITLES, Row, Study

SCHEMA = "diffnea/table1/1"
BEST = 10


def table_of(study: Study, results: Results) -> Json:
    """Figures of all rows from the result files that are there, schema ``diffnea/table1/1``."""
    o = study.options
    content = {
        "schema": SCHEMA,
        "options": {
            "models": o.models,
            "seeds": o.seeds,
            "lengths": o.lengths,
            "simulated_lengths": o.simulated_lengths,
            "surrogates": o.surrogates,
            "kinds": o.kinds,
            "trained_models": o.trained_models,
            "rope": o.rope,
            "arm_seconds": o.arm_seconds,
            "ball_seconds": o.ball_seconds,
            "ball_repetitions": o.ball_repetitions,
            "repetitions": o.repetitions,
            "search": o.search,
            "training": o.training,
        },
        "rows": [row_of(row, results) for row in study.rows],
    }
    found: Json = plain(content)
    return found


def row_of(row: Row, results: Results) -> Json:
    """Figures of one row; what is not finished is left out and counted."""
    groups, repetitions = [], []
    for unit in row.units:
        done = [results.read(job) for job in unit.transfers if results.has(job)]
        if done:
            groups.append([policy for result in done for policy in result.data["policies"]])
        if results.has(unit.repeat):
            repetitions.append(results.read(unit.repeat).data["repetitions"])
    asked = sum(len(job.settings["seeds"]) for unit in row.units for job in unit.learned)
    policies = [policy for group in groups for policy in group]
    before = [policy for group in groups for policy in best(group, "expected", BEST)]
    after = [policy for group in groups for policy in best(group, "reward_wide", BEST)]
    repeated = [[bool(r["success"]) for r in group] for group in repetitions if group]
    printed = paper_row(row.system == SIMULATION, row.kind, row.length)
    rewards = _rewards(policies)
    errors = [p["path_error"] for p in policies if p["path_error"] is not None]
    return {
        "system": row.system,
        "length": row.length,
        "model": row.kind,
        "not_run": row.not_run or (None if policies else "not run yet"),
        "models": len(groups),
        "policies": len(policies),
        "asked": asked,
        "solved_in_model": share([[p["solved"] for p in g] for g in groups]).to_dict(),
        "best": {
            "count": BEST,
            "chosen_before": _selection(before),
            "chosen_after": _selection(after),
        },
        "all": {
            "reward": bootstrap([_rewards(g) for g in groups]).to_dict(),
            "spread": float(np.std(rewards)) if rewards else None,
            "transfer": share([[p["success"] for p in g] for g in groups]).to_dict(),
        },
        "repeatability": {
            "policies": len(repeated),
            "repetitions": sum(map(len, repeated)),
            **share(repeated).to_dict(),
        },
        "path_error": float(np.median(errors)) if errors else None,
        "outcomes": {
            outcome: sum(p["outcome"] == outcome for p in policies)
            for outcome in sorted({str(p["outcome"]) for p in policies})
        },
        "paper": None
        if printed is None
        else {
            "reward": printed.reward,
            "spread": printed.spread,
            "transfer": printed.transfer / 100,
            "repeatability": None if printed.repeatability is None else printed.repeatability / 100,
        },
    }


def _rewards(policies: list[Any]) -> list[float]:
    """At the paper's ε; a rollout that the world's solver failed has none."""
    return [p["reward_wide"] for p in policies if p["reward_wide"] is not None]


def _selection(policies: list[Any]) -> Json:
    rewards = _rewards(policies)
    won = [bool(p["success"]) for p in policies]
    return {
        "policies": len(policies),
        "reward": float(np.mean(rewards)) if rewards else None,
        "spread": float(np.std(rewards)) if rewards else None,
        "transfer": wilson(sum(won), len(won)).value,
    }


def cost_of(study: Study, full: Study, results: Results) -> Json:
    """Processor time that was spent, and what the full study takes by it.

    Every kind of job takes a multiple of what was expected of it; the same multiple is taken for
    the jobs of the full study.
    """
    spent: dict[str, list[tuple[Job, Result]]] = {}
    for job in in_order(study.jobs):
        if results.has(job):
            spent.setdefault(job.kind, []).append((job, results.read(job)))
    ratios = {
        kind: sum(r.cpu_seconds for _, r in found) / expected
        for kind, found in spent.items()
        if (expected := sum(job.cost for job, _ in found)) > 0  # no repetitions: nothing to do
    }
    kinds: Json = {
        kind: {
            "jobs": len(found),
            "cpu_seconds": sum(r.cpu_seconds for _, r in found),
            "seconds": sum(float(r.content["seconds"]) for _, r in found),
        }
        for kind, found in spent.items()
    }
    hours, unknown = 0.0, set()
    for job in in_order(full.jobs):
        if job.kind in ratios:
            hours += job.cost * ratios[job.kind] / 3600
        else:
            unknown.add(job.kind)
    return {
        "kinds": kinds,
        "cpu_hours": sum(kind["cpu_seconds"] for kind in kinds.values()) / 3600,
        "full": {
            "jobs": len(in_order(full.jobs)),
            "cpu_hours": hours,
            "hours_on_2_cores": hours / 2,
            "not_measured": sorted(unknown),
        },
        "builds": sorted({r.content["build"] for found in spent.values() for _, r in found}),
        "hosts": sorted({r.content["host"] for found in spent.values() for _, r in found}),
    }


HEAD = (
    "system",
    "string",
    "model",
    "reward, best ten",
    "transferred, best ten",
    "paper: reward",
    "paper: transfer",
    "reward, all",
    "transferred, all",
    "repeatability",
    "paper: repeat.",
    "models × policies",
)


def cells(row: Json) -> list[str]:
    """Texts of a row of the table, in the order of ``HEAD``."""
    paper = row["paper"] or {}
    where = [
        row["system"] if row["system"] == SIMULATION else f"surrogate {row['system']}",
        f"{100 * row['length']:.0f} cm",
        TITLES[row["model"]],
    ]
    printed = f"{paper['reward']:.2f} ± {paper['spread']:.2f}" if paper else "–"
    if row["not_run"]:
        ours = [row["not_run"], ""]
        rest = ["", "", "", percent(paper.get("repeatability")), ""]
    else:
        chosen = row["best"]["chosen_before"]
        ours = [spread_of(chosen), percent(chosen["transfer"])]
        repeated = row["repeatability"]
        rest = [
            _ranged(row["all"]["reward"]),
            _shared(row["all"]["transfer"]),
            _shared(repeated) if repeated["repetitions"] else "–",
            percent(paper.get("repeatability")),
            f"{row['models']} × {row['policies'] // max(1, row['models'])}",
        ]
    return [*where, *ours, printed, percent(paper.get("transfer")), *rest]


def spread_of(chosen: Json) -> str:
    """Return mean and standard deviation of a choice's rewards; no world may have given one."""
    if chosen["reward"] is None:
        return "–"
    return f"{chosen['reward']:.2f} ± {chosen['spread']:.2f}"


def percent(value: float | None) -> str:
    """Return a share in percent."""
    return "–" if value is None else f"{100 * value:.0f} %"


def _ranged(found: Json) -> str:
    if found["value"] is None:
        return "–"
    return f"{found['value']:.2f} ({found['low']:.2f} to {found['high']:.2f})"


def _shared(found: Json) -> str:
    return f"{percent(found['value'])} ({100 * found['low']:.0f}–{100 * found['high']:.0f})"


def table_csv(rows: Sequence[Json]) -> str:
    """One line a row: every figure as a number."""
    lines = [_flat(row) for row in rows]
    names = list(dict.fromkeys(name for line in lines for name in line))
    stream = io.StringIO()
    writer = csv.DictWriter(stream, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return stream.getvalue()


def _flat(value: Json, before: str = "") -> Json:
    out: Json = {}
    for key, entry in value.items():
        if key == "outcomes":
            out[before + key] = " ".join(f"{k}:{v}" for k, v in entry.items())
        elif isinstance(entry, dict):
            out |= _flat(entry, f"{before}{key}.")
        else:
            out[before + key] = entry
    return out


def table_tex(table: Json) -> str:
    """Return a tabular with booktabs, as the paper's."""
    lines = [
        r"\begin{tabular}{lll" + "c" * (len(HEAD) - 3) + "}",
        r"\toprule",
        " & ".join(HEAD) + r" \\",
        r"\midrule",
    ]
    lines += [" & ".join(cells(row)) + r" \\" for row in table["rows"]]
    lines += [r"\bottomrule", r"\end{tabular}"]
    text = "\n".join(lines) + "\n"
    for symbol, written in (("%", r"\%"), ("±", r"$\pm$"), ("–", "--"), ("×", r"$\times$")):
        text = text.replace(symbol, written)
    return text


def table_text(table: Json) -> str:
    """Return the table for a terminal."""
    return aligned(HEAD, [cells(row) for row in table["rows"]])


def aligned(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return columns under their names, which are broken at commas."""
    head = [list(name.split(", ")) for name in names]
    depth = max(map(len, head))
    lines = [[name[k] if k < len(name) else "" for name in head] for k in range(depth)]
    lines += [list(row) for row in rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(names))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )
