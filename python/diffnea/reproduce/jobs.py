"""Jobs: descriptions that can be pickled, one result file each.

    >>> record = Job("record-0", study.record, {"seed": 0})
    >>> fit = Job("fit-0", study.fit, {}, needs=(record,))
    >>> result = Results(folder).read(fit)  # once it was run

A result file is named after what it was computed from: the job's name, and a hash of function,
settings, inputs and version. What is there is therefore never computed again, and what is there
of other settings is never taken for it. Files appear whole or not at all.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache, cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from .. import _core

SCHEMA = "diffnea/job/1"
# Of what jobs compute: a change that makes earlier results wrong is a new number.
REVISION = 2
# How the name of a file ends that is being written.
UNFINISHED = ".tmp"
DAY = 86400.0

Json: TypeAlias = "dict[str, Any]"
Arrays: TypeAlias = "dict[str, np.ndarray[Any, Any]]"


@dataclass(frozen=True)
class Output:
    """What a job's function gives back."""

    data: Json
    """Plain values, for the result file."""
    arrays: Arrays = field(default_factory=dict)
    """Series, for the ``.npz`` beside it."""


@dataclass(frozen=True)
class Result:
    """A result file that was read."""

    file: Path
    content: Json

    @property
    def data(self) -> Json:
        """What the function gave."""
        found: Json = self.content["result"]
        return found

    @cached_property
    def arrays(self) -> Arrays:
        """Its series, float64."""
        path = self.file.with_suffix(".npz")
        if not path.exists():
            return {}
        with np.load(path, allow_pickle=False) as file:
            return {name: np.asarray(file[name], dtype=np.float64) for name in file.files}

    @property
    def cpu_seconds(self) -> float:
        """Processor time it took."""
        return float(self.content["cpu_seconds"])


Function: TypeAlias = "Callable[[Json, list[Result]], Output]"


@dataclass(frozen=True, eq=False)
class Job:
    """One run: a function of settings and of other jobs' results."""

    name: str
    """Readable, unique in a study; begins the file's name."""
    function: Function
    """Of a module that workers can import."""
    settings: Json
    """What the result depends on: JSON values."""
    needs: tuple[Job, ...] = ()
    """Whose results it reads, in this order."""
    cost: float = 1.0
    """Processor seconds to expect, for the order and the time that is left."""

    @property
    def kind(self) -> str:
        """Name of the function."""
        return self.function.__name__

    @cached_property
    def key(self) -> str:
        """Hash of all that the result depends on."""
        described = [
            f"{self.function.__module__}.{self.function.__qualname__}",
            self.settings,
            [need.key for need in self.needs],
            _core.__version__,
            REVISION,
        ]
        text = json.dumps(described, sort_keys=True, allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    @property
    def stem(self) -> str:
        """Of the result file."""
        return f"{self.name}-{self.key}"


def in_order(jobs: Iterable[Job], without: Callable[[Job], bool] = lambda job: False) -> list[Job]:
    """All jobs and what they need, each once (by key), needs first.

    Those that ``without`` is true of are left out, and what only they need.
    """
    out: dict[str, Job] = {}

    def add(job: Job) -> None:
        if job.key not in out and not without(job):
            for need in job.needs:
                add(need)
            out[job.key] = job

    for job in jobs:
        add(job)
    return list(out.values())


@dataclass(frozen=True)
class Call:
    """What travels to a worker."""

    name: str
    stem: str
    function: Function
    settings: Json
    needs: list[str]
    folder: str


class Results:
    """A folder of result files; workers on other machines must see it, too."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def file(self, job: Job) -> Path:
        """Where the job's result is, or will be."""
        return self.folder / f"{job.stem}.json"

    def has(self, job: Job) -> bool:
        """Whether it was run."""
        return self.file(job).exists()

    def read(self, job: Job) -> Result:
        """Read the result of a job that was run."""
        return read_result_file(self.file(job))

    def call(self, job: Job) -> Call:
        """Return what a worker is sent."""
        stems = [need.stem for need in job.needs]
        folder = os.fspath(self.folder.resolve())
        return Call(job.name, job.stem, job.function, job.settings, stems, folder)


def read_result_file(path: Path) -> Result:
    """Read a job's result."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise _core.FileError(
            f"{path}: is no result ({error}); remove it, and the job runs again"
        ) from error
    if content.get("schema") != SCHEMA:
        raise _core.FileError(f"{path}: schema: got {content.get('schema')!r}, expected {SCHEMA!r}")
    return Result(path, content)


def execute(call: Call) -> float:
    """Run a job where this is called and write its result; return the seconds that it took.

    Series first, then the JSON file: where there is one, there is everything. A cluster that has
    lost a worker may ask again for what that worker had finished: its file answers.
    """
    folder = Path(call.folder)
    path = folder / f"{call.stem}.json"
    if path.exists():
        return float(read_result_file(path).content["seconds"])
    needs = [read_result_file(folder / f"{stem}.json") for stem in call.needs]
    begin, processor = time.monotonic(), time.process_time()
    output = call.function(call.settings, needs)
    seconds, cpu_seconds = time.monotonic() - begin, time.process_time() - processor
    if output.arrays:
        series: Any = output.arrays
        write_whole(path.with_suffix(".npz"), lambda file: np.savez_compressed(file, **series))
    content = {
        "schema": SCHEMA,
        "job": call.name,
        "function": f"{call.function.__module__}.{call.function.__qualname__}",
        "settings": call.settings,
        "needs": [f"{stem}.json" for stem in call.needs],
        "result": plain(output.data),
        "seconds": seconds,
        "cpu_seconds": cpu_seconds,
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "host": platform.node(),
        "version": _core.__version__,
        "build": build(),
    }
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    write_text(path, text)
    return seconds


@cache
def build() -> str:
    """Checksum of the compiled part: results of another build are told apart by it."""
    assert _core.__file__
    return hashlib.sha256(Path(_core.__file__).read_bytes()).hexdigest()[:12]


def plain(value: Any) -> Any:
    """Return JSON values: numbers that do not exist are null."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(v) for v in value]
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value


def write_whole(path: Path, write: Callable[[Any], object]) -> None:
    """Write beside the file, onto the disk, then put it in its place."""
    beside = path.with_name(f".{path.name}.{platform.node()}.{os.getpid()}{UNFINISHED}")
    try:
        with beside.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
    except OSError as error:
        # Of the file that was asked for; the one beside it is gone.
        raise OSError(error.errno, error.strerror or str(error), os.fspath(path)) from error
    finally:
        beside.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text whole or not at all."""
    write_whole(path, lambda file: file.write(text.encode()))


def remove_abandoned(folder: Path) -> None:
    """Remove what processes that were killed had begun to write.

    Of this machine's processes one can tell whether they live; of others' files, whether they
    are older than any write takes.
    """
    for path in folder.glob(f".*{UNFINISHED}"):
        _, _, pid = path.name.removesuffix(UNFINISHED).rpartition(".")
        here = path.name.removesuffix(f".{pid}{UNFINISHED}").endswith(f".{platform.node()}")
        try:
            if not pid.isdecimal():
                continue
            if (here and not _lives(int(pid))) or time.time() - path.stat().st_mtime > DAY:
                path.unlink()
        except OSError:  # its process is done with it
            pass


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True
