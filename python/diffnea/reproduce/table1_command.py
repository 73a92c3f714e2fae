"""``table1`` on the command line: its options, its table and its page."""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from typing import Any

from .._core import Error
from . import log
from .jobs import Job, Json, Results, write_text
from .page import write_page
from .run import Report
from .table import cost_of, table_csv, table_of, table_tex, table_text
from .table1 import ABOUT, QUICK, Options, Study, study

__all__ = ["ABOUT", "add_options", "jobs", "publish"]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what changes the study's size; the defaults are the paper's."""
    full = Options()

    def number(name: str, about: str) -> None:
        default = getattr(full, name)
        parser.add_argument(
            f"--{name.replace('_', '-')}",
            type=type(default) if default is not None else int,
            metavar="N",
            help=f"{about} (default: {default})",
        )

    def several(name: str, about: str, of: Any) -> None:
        default = getattr(full, name)
        parser.add_argument(
            f"--{name.replace('_', '-')}",
            type=lambda text: tuple(of(part) for part in text.split(",") if part),
            metavar="A,B,…",
            help=f"{about} (default: {','.join(map(str, default))})",
        )

    parser.add_argument(
        "--quick",
        action="store_true",
        help=f"a small version: {QUICK.models} models, {QUICK.seeds} seeds, 40 cm, one network of"
        " each kind; other options still count",
    )
    number("models", "recordings, robots and initial guesses")
    number("seeds", "policies of each model")
    several("lengths", "strings on the surrogates [m]", float)
    several("simulated_lengths", "strings in simulation [m]", float)
    several("surrogates", "surrogates of the physical system", str)
    several("kinds", "models of the ball", str)
    number("trained_models", "networks of each kind; None: as many as models")
    parser.add_argument("--rope", help=f"of the worlds (default: {full.rope})")
    number("arm_seconds", "recording of the arm [s]")
    number("ball_seconds", "recording of the ball [s]")
    number("ball_repetitions", "of it, averaged")
    number("repetitions", "of the best policy, with noise")
    number("chunk", "policies a job")
    for name, what in (("search", "learn"), ("training", "blackbox.train")):
        parser.add_argument(
            f"--{name}",
            action="append",
            metavar="KEY=VALUE",
            help=f"an option of `{what}`, in place of its default; may be repeated",
        )


def options_of(args: argparse.Namespace) -> Options:
    """Those of the command line over the study's defaults."""
    given: Json = {}
    for option in dataclasses.fields(Options):
        value = getattr(args, option.name)
        if option.name in ("search", "training") and value is not None:
            value = dict(_setting(option.name, text) for text in value)
        if value is not None:
            given[option.name] = value
    return dataclasses.replace(QUICK if args.quick else Options(), **given)


def _setting(name: str, text: str) -> tuple[str, Any]:
    key, equals, value = text.partition("=")
    if not equals:
        raise Error(f"--{name}: got {text!r}, expected KEY=VALUE")
    try:
        return key, json.loads(value)
    except ValueError:
        return key, value


def jobs(args: argparse.Namespace) -> list[Job]:
    """All jobs of the study."""
    return study(options_of(args)).jobs


def publish(args: argparse.Namespace, results: Results, report: Report) -> None:
    """Write table.json, table.csv, table.tex and report.html; print the table."""
    described = study(options_of(args))
    table = table_of(described, results)
    table["cost"] = cost_of(described, _full(described), results)
    table["cost"]["runs"] = log.entries(args.output)
    table["failed"] = {job.name: why for job, why in report.failed.items()}
    folder = args.output
    texts = {
        "table.json": json.dumps(table, indent=1, allow_nan=False) + "\n",
        "table.csv": table_csv(table["rows"]),
        "table.tex": table_tex(table),
    }
    for name, text in texts.items():
        write_text(folder / name, text)
    write_page(folder / "report.html", described, table, results)
    print(table_text(table))
    print(f"open {folder / 'report.html'}", file=sys.stderr)


def _full(described: Study) -> Study:
    """Describe the paper's size, with this study's search and rope."""
    o = described.options
    full = Options(rope=o.rope, search=o.search, training=o.training, kinds=o.kinds)
    return study(dataclasses.replace(full, surrogates=o.surrogates))
