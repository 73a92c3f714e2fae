"""``beyond`` on the command line: its options, its table and its page."""

from __future__ import annotations

import argparse
import dataclasses
import html
import json
import statistics
import sys
from collections import Counter
from importlib import resources

import numpy as np

from .beyond import ABOUT, QUICK, After, Options, Row, study
from .beyond_work import STRING, VARIED
from .jobs import Job, Json, Results, write_text
from .numbers import bootstrap, share
from .run import Report

__all__ = ["ABOUT", "add_options", "jobs", "publish"]

SCHEMA = "diffnea/beyond/1"
HEAD = (
    "string",
    "rope",
    "extended by",
    "robots",
    "before",
    "after",
    "change",
    "path before",
    "path after",
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what changes the study's size."""
    full = Options()
    parser.add_argument("--quick", action="store_true", help="2 robots, 12 policies, 40 cm, mid")
    for name, about in (
        ("robots", "drawn from the surrogate"),
        ("first_robot", "its number; what was developed on is below"),
        ("seeds", "policies of each robot, before and after"),
        ("observed", "policies whose recordings are diagnosed"),
    ):
        option = f"--{name.replace('_', '-')}"
        parser.add_argument(option, type=int, help=f"{about} (default: {getattr(full, name)})")
    for name, of in (("lengths", _floats), ("ropes", _words), ("each", _words)):
        default = ",".join(map(str, getattr(full, name))) or "none"
        about = f"; effects that extend alone, of {', '.join(STRING)}" if name == "each" else ""
        parser.add_argument(
            f"--{name}", type=of, metavar="A,B,…", help=f"default: {default}{about}"
        )
    parser.add_argument("--surrogate", help=f"of the robot (default: {full.surrogate})")


def _words(text: str) -> tuple[str, ...]:
    return tuple(part for part in text.split(",") if part)


def _floats(text: str) -> tuple[float, ...]:
    return tuple(float(part) for part in _words(text))


def options_of(args: argparse.Namespace) -> Options:
    """Those of the command line over the study's defaults."""
    given = {
        option.name: value
        for option in dataclasses.fields(Options)
        if (value := getattr(args, option.name, None)) is not None
    }
    return dataclasses.replace(QUICK if args.quick else Options(), **given)


def jobs(args: argparse.Namespace) -> list[Job]:
    """All jobs of the study."""
    return study(options_of(args)).jobs


def publish(args: argparse.Namespace, results: Results, report: Report) -> None:
    """Write table.json, table.csv and report.html; print the table."""
    rows = [
        found
        for row in study(options_of(args)).rows
        for k in range(len(row.units[0].after))
        if (found := _row(row, k, results))
    ]
    table: Json = {
        "schema": SCHEMA,
        "rows": rows,
        "failed": {job.name: why for job, why in report.failed.items()},
    }
    lines = [HEAD, *(_cells(row) for row in rows)]
    write_text(args.output / "table.json", json.dumps(table, indent=1, allow_nan=False) + "\n")
    write_text(args.output / "table.csv", "".join(",".join(line) + "\n" for line in lines))
    write_text(args.output / "report.html", _page(table))
    widths = [max(len(line[k]) for line in lines) for k in range(len(HEAD))]
    for line in lines:
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)))
    for row in rows:
        if not row["robust"]:
            print(f"{row['title']}, {row['effects']}: {_named(row)}")
    print(f"open {args.output / 'report.html'}", file=sys.stderr)


def _row(row: Row, k: int, results: Results) -> Json | None:
    """Figures of one extension; None: no robot is finished."""
    done = [
        unit
        for unit in row.units
        if results.has(unit.before) and results.has(unit.after[k].transfer)
    ]
    if not done:
        return None
    before = [_policies(unit.before, results) for unit in done]
    after = [_policies(unit.after[k].transfer, results) for unit in done]
    gains = [
        statistics.mean(p["success"] for p in a) - statistics.mean(p["success"] for p in b)
        for a, b in zip(after, before, strict=True)
    ]
    named: Counter[str] = Counter()
    values: dict[str, list[float]] = {}
    for unit in done:
        found = _diagnosed(unit.after[k], results)
        for cause in found["causes"]:
            named[cause["effect"]] += 1
            for name, (value, _, _) in cause["parameters"].items():
                values.setdefault(f"{cause['effect']}.{name}", []).append(value)
    return {
        "title": row.title,
        "length": row.length,
        "rope": row.rope,
        "effects": done[0].after[k].effects,
        "robust": done[0].after[k].robust,
        "robots": len(done),
        "before": share([[p["success"] for p in of] for of in before]).to_dict(),
        "after": share([[p["success"] for p in of] for of in after]).to_dict(),
        "change": bootstrap([[gain] for gain in gains]).to_dict(),
        "path_before": _median_path(before),
        "path_after": _median_path(after),
        "named": dict(named.most_common()),
        "values": {name: statistics.median(of) for name, of in values.items()},
        "sentences": [_diagnosed(unit.after[k], results)["sentence"] for unit in done],
    }


def _policies(job: Job, results: Results) -> list[Json]:
    found: list[Json] = results.read(job).data["policies"]
    return found


def _diagnosed(after: After, results: Results) -> Json:
    return results.read(after.diagnosed).data


def _median_path(groups: list[list[Json]]) -> float | None:
    """Distance of imagined and obtained ball before the catch [m]."""
    found = [p["path_error"] for of in groups for p in of if p["path_error"] is not None]
    return float(np.median(found)) if found else None


def _cells(row: Json) -> tuple[str, ...]:
    def percent(of: Json, sign: str = "") -> str:
        low, high = (f"{100 * of[key]:{sign}.0f}" for key in ("low", "high"))
        return f"{100 * of['value']:{sign}.0f} % ({low} to {high})"

    def millimetres(x: float | None) -> str:
        return "–" if x is None else f"{1e3 * x:.0f} mm"

    return (
        f"{100 * row['length']:.0f} cm",
        row["rope"],
        f"{row['effects']} (robust)" if row["robust"] else row["effects"],
        str(row["robots"]),
        percent(row["before"]),
        percent(row["after"]),
        percent(row["change"], "+"),
        millimetres(row["path_before"]),
        millimetres(row["path_after"]),
    )


def _named(row: Json) -> str:
    """Say what was found, of how many robots."""
    if not row["named"]:
        return "nothing was named"
    parts = []
    for effect, count in row["named"].items():
        values = ", ".join(
            f"{name.partition('.')[2]} {value:.3g}"
            for name, value in row["values"].items()
            if name.startswith(f"{effect}.")
        )
        parts.append(f"{effect} {count} of {row['robots']} ({values})")
    return "; ".join(parts)


def _page(table: Json) -> str:
    css = resources.files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    escape = html.escape
    parts = ["<h1>Beyond: what the model lacked, named, and what it is worth</h1>"]
    for row in table["rows"]:
        if row["effects"] == "all":
            parts.append(
                f'<p class="verdict">{escape(row["title"])}: {row["robots"]} robots;'
                f" {escape(_cells(row)[4])} of the policies transferred before,"
                f" {escape(_cells(row)[5])} after{', learned robustly' * row['robust']}.</p>"
            )
    parts += [
        f'<p class="warning">{escape(n)} failed: {escape(w)}</p>'
        for n, w in table["failed"].items()
    ]
    head = "".join(f"<th>{name}</th>" for name in HEAD)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in _cells(row))}</tr>"
        for row in table["rows"]
    )
    parts.append(
        f'<div class="wide"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )
    parts.append(
        '<p class="faint">Shares of all policies, none chosen, with 95 % intervals (bootstrap over'
        " robots, Wilson at least); path: median distance of imagined and obtained ball before the"
        " catch. Policies after have seeds of their own; robots are the same. Robust: learned in"
        " draws of the extended model, in which what was named of the string lies anywhere between"
        f" none and {VARIED:g} of what was found; as many rollouts.</p><h2>What was named</h2>"
    )
    for row in table["rows"]:
        if row["robust"]:
            continue
        parts.append(
            f"<h3>{escape(row['title'])}, {escape(row['effects'])}</h3><p>{escape(_named(row))}</p>"
        )
        parts += [f'<p class="faint">{escape(text)}</p>' for text in row["sentences"]]
    joined = "\n".join(parts)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>beyond</title>'
        f"<style>{css}</style></head>\n<body><main>\n{joined}\n</main></body></html>\n"
    )
