"""``beyond`` on the command line: its options, its table and its page."""

from __future__ import annotations

import argparse
import dataclasses
import html
import json
import sys

from .beyond import ABOUT, QUICK, Options, study
from .beyond_table import HEAD, cells, said, table_of, verdict
from .beyond_work import STRING, VARIED
from .jobs import Job, Json, Results, write_text
from .page import frame, made_by, several_builds
from .run import Report
from .table import aligned, table_csv

__all__ = ["ABOUT", "add_options", "jobs", "publish"]


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
    options = options_of(args)
    table = table_of(study(options), results)
    table["options"] = dataclasses.asdict(options)
    table["failed"] = {job.name: why for job, why in report.failed.items()}
    rows = [
        {key: value for key, value in row.items() if key not in ("named", "values", "sentences")}
        for row in table["rows"]
    ]
    write_text(args.output / "table.json", json.dumps(table, indent=1, allow_nan=False) + "\n")
    write_text(args.output / "table.csv", table_csv(rows))
    write_text(args.output / "report.html", _page(table))
    print(aligned(HEAD, [cells(row) for row in table["rows"]]))
    for row in _finished(table):
        if not row["robust"]:
            print(f"{row['title']}, {row['effects']}: {said(row)}")
    print(f"open {args.output / 'report.html'}", file=sys.stderr)


def _finished(table: Json) -> list[Json]:
    return [row for row in table["rows"] if row["robots"]]


def _page(table: Json) -> str:
    escape, finished = html.escape, _finished(table)
    parts = ["<h1>Beyond: what the model lacked, named, and what it is worth</h1>"]
    parts += [
        f'<p class="verdict">{escape(verdict(row))}</p>'
        for row in finished
        if row["effects"] == "all"
    ]
    parts += [f'<p class="warning">{escape(text)}</p>' for text in _warnings(table)]
    head = "".join(f"<th>{name}</th>" for name in HEAD)
    lines = ("".join(f"<td>{escape(cell)}</td>" for cell in cells(row)) for row in table["rows"])
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    parts.append(
        f'<div class="wide"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )
    parts.append(
        '<p class="faint">Shares of all policies, none chosen, with 95 % intervals (bootstrap over'
        " robots and the policies in each; of shares Wilson's at least); path: median distance of"
        " imagined and obtained ball before the catch. Policies after have seeds of their own;"
        " robots are the same. Robust: learned, with as many rollouts, in draws of the extended"
        " model in which what was named of the string, and what acts at the same impacts, lies"
        f" anywhere between none and {VARIED:g} of what was found or of what ropes have.</p>"
        "<h2>What was named</h2>"
    )
    for row in finished:
        if row["robust"]:
            continue
        parts.append(
            f"<h3>{escape(row['title'])}, {escape(row['effects'])}</h3><p>{escape(said(row))}</p>"
        )
        parts += [f'<p class="faint">{escape(text)}</p>' for text in row["sentences"]]
    parts.append(made_by(table["builds"]))
    return frame("beyond", parts)


def _warnings(table: Json) -> list[str]:
    missing = sum(row["asked"] - row["robots"] for row in table["rows"])
    out = []
    if missing:
        asked = sum(row["asked"] for row in table["rows"])
        out.append(f"{missing} of {asked} robots are not there yet; the same command goes on.")
    out += [f"{name} failed: {why}." for name, why in table["failed"].items()]
    out += several_builds(table["builds"])
    few = min((row["robots"] for row in _finished(table)), default=0)
    if 0 < few < 5:
        out.append(f"Intervals are over {few} robots a row: too few to know how robots differ.")
    return out
