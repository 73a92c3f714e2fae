"""The command: finds the study, runs what is missing of it, writes its table and page."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import FrameType, ModuleType

from .._core import Error
from . import beyond_command, log, table1_command
from .executors import CHOICES, Workers, workers
from .jobs import Job, Json, Results, remove_abandoned
from .progress import Progress
from .run import Report, run

STUDIES: dict[str, ModuleType] = {"table1": table1_command, "beyond": beyond_command}
"""By name. A study has ABOUT, add_options(parser), jobs(args) and publish(args, run)."""

DONE, BAD_INPUT, INCOMPLETE, INTERRUPTED = 0, 1, 3, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    args = _parser().parse_args(arguments)
    if args.list:
        for name, study in STUDIES.items():
            print(f"{name}  {study.ABOUT}")
        return DONE
    if args.study is None:
        _parser().error("which study? --list names them")
    before = signal.signal(signal.SIGTERM, _like_ctrl_c)
    try:
        return _run(args, STUDIES[args.study])
    except Error as error:
        print(error, file=sys.stderr)
        return BAD_INPUT
    except OSError as error:  # a disk that is full, say
        print(f"{error.filename or args.output}: {error.strerror or error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(
            f"interrupted: the same command goes on from what is finished in {args.output}",
            file=sys.stderr,
        )
        return INTERRUPTED
    finally:
        signal.signal(signal.SIGTERM, before)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m diffnea.reproduce", description="Run a study again, or go on with it."
    )
    parser.add_argument("--list", action="store_true", help="the studies that there are")
    studies = parser.add_subparsers(dest="study", metavar="STUDY")
    for name, study in STUDIES.items():
        own = studies.add_parser(name, help=study.ABOUT, description=study.ABOUT)
        own.add_argument("-o", "--output", type=Path, required=True, help="folder")
        own.add_argument(
            "--executor",
            default="processes",
            help=f"where jobs run: {', '.join(CHOICES)} (default: a process for each core)",
        )
        own.add_argument("--quiet", action="store_true", help="print no progress")
        own.add_argument(
            "--page-only",
            action="store_true",
            help="run nothing; table and page of the results that are there",
        )
        study.add_options(own)
    return parser


def _run(args: argparse.Namespace, study: ModuleType) -> int:
    jobs: list[Job] = study.jobs(args)
    results = Results(args.output / "results")
    try:
        results.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"--output: {args.output}: {error.strerror}") from error
    for folder in (args.output, results.folder):
        remove_abandoned(folder)
    try:
        return _run_and_publish(args, study, jobs, results)
    finally:  # a killed run's workers outlive it for an instant, and may have been writing
        for folder in (args.output, results.folder):
            remove_abandoned(folder)


def _run_and_publish(
    args: argparse.Namespace, study: ModuleType, jobs: list[Job], results: Results
) -> int:
    report = Report()
    if not args.page_only:
        progress = Progress(args.quiet)
        begin = time.monotonic()
        try:
            with workers(args.executor) as found:
                report = run(jobs, results, found, progress)
        finally:
            progress.end()
        _log(args, report, results, found, time.monotonic() - begin)
    for job, why in report.failed.items():
        print(f"{job.name} failed: {why}", file=sys.stderr)
    if report.skipped:
        print(f"{len(report.skipped)} jobs that need failed ones were not run", file=sys.stderr)
    study.publish(args, results, report)
    return INCOMPLETE if report.failed else DONE


def _log(
    args: argparse.Namespace, report: Report, results: Results, found: Workers, seconds: float
) -> None:
    """Append to runs.jsonl what this run did: the workers' busy share is the scaling reached."""
    if not report.done:
        return
    done = [results.read(job).content for job in report.done]
    busy = sum(float(content["seconds"]) for content in done)
    entry: Json = {
        "executor": args.executor,
        "workers": found.count,
        "jobs": len(done),
        "failed": len(report.failed),
        "seconds": seconds,
        "busy_seconds": busy,
        "cpu_seconds": sum(float(content["cpu_seconds"]) for content in done),
        "busy_share": busy / (seconds * found.count),
    }
    log.append(args.output, entry)


def _like_ctrl_c(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
