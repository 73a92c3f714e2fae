"""Runs jobs in the order of their needs, on any executor."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from dataclasses import dataclass, field
from typing import Any

from .executors import Workers
from .jobs import Job, Results, execute, in_order
from .progress import Progress

ATTEMPTS = 2
"""Of a job whose worker dies; one that raises is not tried again."""


@dataclass
class Report:
    """What became of jobs."""

    done: list[Job] = field(default_factory=list)
    """Run now."""
    kept: list[Job] = field(default_factory=list)
    """Found."""
    failed: dict[Job, str] = field(default_factory=dict)
    """And why."""
    skipped: dict[Job, Job] = field(default_factory=dict)
    """And which failed job they need."""


def run(jobs: Sequence[Job], results: Results, workers: Workers, progress: Progress) -> Report:
    """Run what is missing.

    Of what could run, a worker gets that on which the longest chain of work waits. A job that
    raises costs itself and what needs it. One whose worker dies is tried once more.
    """
    results.folder.mkdir(parents=True, exist_ok=True)
    everything = in_order(jobs)
    report = Report()
    report.kept = [job for job in everything if results.has(job)]
    missing = in_order(jobs, without=results.has)
    progress.begin(missing, len(report.kept), workers.count)

    users: dict[str, list[Job]] = {job.key: [] for job in everything}
    unmet: dict[str, int] = {}
    for job in missing:
        open_needs = {need.key for need in job.needs if not results.has(need)}
        unmet[job.key] = len(open_needs)
        for key in open_needs:
            users[key].append(job)
    urgency = _urgency(missing, users)
    ready = [job for job in missing if not unmet[job.key]]
    attempts: dict[str, int] = {}
    running: dict[Future[Any], Job] = {}
    dropped: set[str] = set()

    def drop(job: Job, cause: Job) -> None:
        for user in users[job.key]:
            if user.key not in dropped:
                dropped.add(user.key)
                report.skipped[user] = cause
                progress.skipped(user)
                drop(user, cause)

    while ready or running:
        ready.sort(key=lambda job: -urgency[job.key])
        while ready and len(running) < workers.count + workers.ahead:
            job = ready.pop(0)
            attempts[job.key] = attempts.get(job.key, 0) + 1
            running[workers.executor.submit(execute, results.call(job))] = job
            progress.started(job)
        finished, _ = wait(running, timeout=1.0, return_when=FIRST_COMPLETED)
        progress.tick()
        for future in finished:
            job = running.pop(future)
            error = CancelledError() if future.cancelled() else future.exception()
            if error is None or results.has(job):  # its worker may have died with the answer
                report.done.append(job)
                progress.done(job, results.read(job).content["seconds"])
                for user in users[job.key]:
                    unmet[user.key] -= 1
                    if not unmet[user.key] and user.key not in dropped:
                        ready.append(user)
                continue
            if _worker_died(error) and attempts[job.key] < ATTEMPTS:
                progress.note(f"{job.name}: its worker died; once more")
                ready.append(job)
                continue
            report.failed[job] = (
                f"its worker died, {attempts[job.key]} times"
                if _worker_died(error)
                else _text(error)
            )
            progress.failed(job, report.failed[job])
            drop(job, job)
    progress.end()
    return report


def _urgency(jobs: Sequence[Job], users: dict[str, list[Job]]) -> dict[str, float]:
    """Length of the longest chain that begins with a job [s]."""
    out: dict[str, float] = {}
    for job in reversed(jobs):
        out[job.key] = job.cost + max((out[user.key] for user in users[job.key]), default=0.0)
    return out


def _worker_died(error: BaseException) -> bool:
    """Whether the job was lost rather than wrong; Dask's errors by name, it may not be there."""
    lost = {"KilledWorker", "CommClosedError", "FutureCancelledError"}
    return isinstance(error, BrokenExecutor | CancelledError) or bool(
        lost & {kind.__name__ for kind in type(error).__mro__}
    )


def _text(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
