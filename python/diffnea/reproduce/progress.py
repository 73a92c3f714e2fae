"""What is shown while jobs run: a bar where tqdm is installed, or else lines; time that is left."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Any

from .jobs import Job

EVERY = 20.0
"""Seconds between two lines."""


class Progress:
    """On standard error; ``quiet`` shows failures alone."""

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet
        self._bar: Any = None
        self._left: dict[str, Job] = {}
        self._taken: dict[str, list[float]] = {}
        self._total = self._done = 0
        self._workers = 1
        self._last = self._begin = time.monotonic()

    def begin(self, jobs: Sequence[Job], kept: int, workers: int) -> None:
        """Know the jobs that are to run."""
        self._left = {job.key: job for job in jobs}
        self._total, self._workers = len(jobs), workers
        self._begin = self._last = time.monotonic()
        if self.quiet:
            return
        found = f", {kept} found" if kept else ""
        self._say(f"{len(jobs)} jobs on {workers} {'workers' if workers > 1 else 'worker'}{found}")
        if not sys.stderr.isatty():
            return
        try:
            from tqdm import tqdm
        except ImportError:
            return
        self._bar = tqdm(total=self._total, unit="job", file=sys.stderr)

    def started(self, job: Job) -> None:
        """Show the job's name."""
        if self._bar is not None:
            self._bar.set_description_str(job.name)

    def done(self, job: Job, seconds: float) -> None:
        """Count a job and learn what its kind takes."""
        self._taken.setdefault(job.kind, []).append(seconds / max(job.cost, 1e-9))
        self._count(job)

    def skipped(self, job: Job) -> None:
        """Count a job that will not run."""
        self._count(job)

    def failed(self, job: Job, why: str) -> None:
        """Say why."""
        self._count(job)
        self._say(f"{job.name} failed: {why}")

    def note(self, text: str) -> None:
        """Say something."""
        if not self.quiet:
            self._say(text)

    def tick(self) -> None:
        """Show how far it is, from time to time."""
        if self.quiet or self._done == self._total:
            return
        now = time.monotonic()
        if self._bar is not None:
            self._bar.set_postfix_str(f"about {_span(self.seconds_left())} left")
        elif now - self._last > EVERY:
            self._last = now
            self._say(
                f"{self._done} of {self._total} jobs after {_span(now - self._begin)},"
                f" about {_span(self.seconds_left())} left"
            )

    def end(self) -> None:
        """Close the bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def seconds_left(self) -> float:
        """Estimate from what each kind took, of what was expected of it."""
        ratios = {kind: sum(taken) / len(taken) for kind, taken in self._taken.items()}
        usual = sum(ratios.values()) / len(ratios) if ratios else 1.0
        work = sum(job.cost * ratios.get(job.kind, usual) for job in self._left.values())
        return work / self._workers

    def _count(self, job: Job) -> None:
        self._left.pop(job.key, None)
        self._done += 1
        if self._bar is not None:
            self._bar.update(1)

    def _say(self, text: str) -> None:
        if self._bar is not None:
            self._bar.write(text, file=sys.stderr)
        else:
            print(text, file=sys.stderr, flush=True)


def _span(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = seconds / 60
    return f"{minutes:.0f} min" if minutes < 90 else f"{minutes / 60:.1f} h"
