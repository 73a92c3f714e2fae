"""The job layer: one result file each, nothing twice, a dead worker costs its own run."""

import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace

import pytest
import small_jobs
from cli import SECONDS

import diffnea
from diffnea.reproduce import command, executors, jobs, log
from diffnea.reproduce.executors import Workers, workers
from diffnea.reproduce.jobs import Job, Results, in_order
from diffnea.reproduce.progress import Progress
from diffnea.reproduce.run import Report, run


def squares(log: Path, count: int = 4) -> list[Job]:
    return [Job(f"square-{x}", small_jobs.square, {"x": x, "log": str(log)}) for x in range(count)]


def run_on(name: str, jobs: list[Job], results: Results) -> Report:
    with workers(name) as found:
        return run(jobs, results, found, Progress(quiet=True))


class Here(Workers):
    """Runs a job when it is submitted."""

    def __init__(self) -> None:
        super().__init__(self, 1, 0)

    def submit(self, fn, /, *args):
        future = Future()
        try:
            future.set_result(fn(*args))
        except Exception as error:
            future.set_exception(error)
        return future


def test_any_executor_runs_jobs_in_the_order_of_their_needs(tmp_path) -> None:
    parts = squares(tmp_path / "log")
    total = Job("total", small_jobs.total, {}, needs=tuple(parts))
    results = Results(tmp_path / "results")
    report = run([total], results, Here(), Progress(quiet=True))
    assert [job.name for job in report.done] == [*(p.name for p in parts), "total"]
    assert results.read(total).data == {"sum": 0 + 1 + 4 + 9}
    content = results.read(parts[2]).content
    assert content["settings"] == parts[2].settings
    assert content["cpu_seconds"] >= 0
    assert results.read(parts[2]).arrays["series"].tolist() == [0, 1, 2]


def test_a_file_is_of_one_description(tmp_path) -> None:
    def job(x: int = 1, needs: tuple[Job, ...] = ()) -> Job:
        return Job("a", small_jobs.square, {"x": x}, needs)

    stems = {job().stem, job(2).stem, job(1, (job(2),)).stem, job(1, (job(3),)).stem}
    assert len(stems) == 4
    assert job().stem == job().stem
    other = Job("a", small_jobs.total, {"x": 1})
    assert other.stem not in stems
    assert [found.settings["x"] for found in in_order([job(1, (job(2),)), job(2)])] == [2, 1]


def test_what_is_there_is_not_computed_again(tmp_path) -> None:
    log = tmp_path / "log"
    results = Results(tmp_path / "results")
    run(squares(log, 3), results, Here(), Progress(quiet=True))
    report = run(squares(log, 4), results, Here(), Progress(quiet=True))
    assert [job.name for job in report.done] == ["square-3"]
    assert len(report.kept) == 3
    assert log.read_text().split() == ["0", "1", "2", "3"]


def test_a_result_that_nobody_asks_for_again_needs_no_inputs(tmp_path) -> None:
    parts = squares(tmp_path / "log", 2)
    total = Job("total", small_jobs.total, {}, needs=tuple(parts))
    results = Results(tmp_path / "results")
    run([total], results, Here(), Progress(quiet=True))
    results.file(parts[0]).unlink()
    assert run([total], results, Here(), Progress(quiet=True)).done == []


def test_a_job_that_raises_costs_itself_and_what_needs_it(tmp_path) -> None:
    bad = Job("bad", small_jobs.fail, {})
    after = Job("after", small_jobs.total, {}, needs=(bad,))
    later = Job("later", small_jobs.total, {}, needs=(after,))
    results = Results(tmp_path / "results")
    report = run([later, *squares(tmp_path / "log", 2)], results, Here(), Progress(quiet=True))
    assert report.failed == {bad: "ValueError: a mistake in the job"}
    assert report.skipped == {after: bad, later: bad}
    assert len(report.done) == 2
    assert not results.has(bad)


def test_a_result_that_is_there_counts_whatever_became_of_the_answer(tmp_path) -> None:
    class Lost(Future):
        def exception(self, timeout=None):
            return TypeError("cannot unpack non-iterable float object")  # Dask loses some so

    def submit(fn, /, *args):
        fn(*args)
        lost = Lost()
        lost.set_result(None)
        return lost

    total = Job("total", small_jobs.total, {}, needs=tuple(squares(tmp_path / "log", 3)))
    results = Results(tmp_path / "results")
    workers = Workers(SimpleNamespace(submit=submit), 1, 0)
    report = run([total], results, workers, Progress(quiet=True))
    assert report.failed == {}
    assert results.read(total).data == {"sum": 5}


def test_half_a_file_is_never_there(tmp_path) -> None:
    results = Results(tmp_path / "results")
    report = run([Job("odd", small_jobs.not_json, {})], results, Here(), Progress(quiet=True))
    assert list(report.failed.values()) == [
        "TypeError: Object of type object is not JSON serializable"
    ]
    assert [file.suffix for file in results.folder.iterdir()] == [".npz"]


def test_what_a_killed_worker_had_begun_to_write_goes_and_what_others_write_stays(
    tmp_path,
) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    here = platform.node()
    names = {
        f".a.json.{here}.{ended.pid}.tmp": False,
        f".a.npz.{here}.{ended.pid}.tmp": False,
        f".a.json.{here}.{os.getpid()}.tmp": True,
        f".a.json.elsewhere.{ended.pid}.tmp": True,
        ".old.json.elsewhere.17.tmp": False,
        ".of.somebody.else.tmp": True,
        "a.json": True,
    }
    for name in names:
        (tmp_path / name).touch()
    yesterday = time.time() - 90000
    os.utime(tmp_path / ".old.json.elsewhere.17.tmp", (yesterday, yesterday))
    jobs.remove_abandoned(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {n for n, kept in names.items() if kept}


def test_what_a_killed_runs_worker_leaves_during_the_next_run_goes(tmp_path, monkeypatch) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    late = tmp_path / "results" / f".a.json.{platform.node()}.{ended.pid}.tmp"
    study = SimpleNamespace(
        ABOUT="", add_options=lambda _: None, jobs=lambda _: [], publish=lambda *_: late.touch()
    )
    monkeypatch.setitem(command.STUDIES, "study", study)
    assert command.main(["study", "-o", str(tmp_path), "--page-only"]) == 0
    assert list(late.parent.iterdir()) == []


def test_half_a_line_in_the_log_costs_that_line(tmp_path) -> None:
    log.append(tmp_path, {"jobs": 1})
    log.append(tmp_path, {"jobs": 2})
    file = tmp_path / log.NAME
    file.write_bytes(file.read_bytes()[:-5])
    assert log.entries(tmp_path) == [{"jobs": 1}]
    log.append(tmp_path, {"jobs": 3})
    assert log.entries(tmp_path) == [{"jobs": 1}, {"jobs": 3}]
    assert log.entries(tmp_path / "nowhere") == []


def test_a_result_that_is_no_json_is_named(tmp_path) -> None:
    path = tmp_path / "a.json"
    path.write_text('{"schema"', encoding="utf-8")
    with pytest.raises(diffnea.FileError, match=r"a\.json: is no result .* runs again"):
        jobs.read_result_file(path)


def test_a_file_that_cannot_be_written_is_named_and_nothing_is_left(tmp_path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old", encoding="utf-8")

    def full(file: object) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left on device") as caught:
        jobs.write_whole(path, full)
    assert caught.value.filename == str(path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]
    assert path.read_text(encoding="utf-8") == "old"


def test_a_worker_that_is_killed_costs_only_its_own_run(tmp_path) -> None:
    """One that dies once, one that always dies, and beside them jobs that must run once."""
    log = tmp_path / "log"
    once = Job("once", small_jobs.die, {"times": 1, "count": str(tmp_path / "once")})
    always = Job("always", small_jobs.die, {"times": 99, "count": str(tmp_path / "always")})
    after = Job("after", small_jobs.total, {}, needs=(always,))
    others = squares(log, 6)
    results = Results(tmp_path / "results")
    report = run_on("processes:2", [*others[:3], once, always, after, *others[3:]], results)
    assert report.failed == {always: "its worker died, 2 times"}
    assert (tmp_path / "always").read_text() == "xx"
    assert report.skipped == {after: always}
    assert results.read(once).data == {"survived": 1}
    assert sorted(log.read_text().split()) == list("012345")  # each of them once

    report = run_on("processes:1", [*others, once], results)
    assert report.done == []
    assert len(report.kept) == 7


def test_a_process_that_cannot_be_started_costs_its_job(tmp_path, monkeypatch) -> None:
    """Also where it is a job's end that starts it, and nobody is there to see the error."""
    begin = executors._Worker.submit

    def submit(self, fn, /, call):
        if call.name == "never":
            raise BlockingIOError("Resource temporarily unavailable")
        return begin(self, fn, call)

    monkeypatch.setattr(executors._Worker, "submit", submit)
    never = Job("never", small_jobs.total, {}, cost=1.0)
    first, *others = squares(tmp_path / "log", 3)
    with workers("processes:1") as found:
        crowded = Workers(found.executor, 1, ahead=3)
        jobs = [first, never, *others]
        report = run(jobs, Results(tmp_path / "results"), crowded, Progress(quiet=True))
    assert report.failed == {never: "BlockingIOError: Resource temporarily unavailable"}
    assert len(report.done) == 3


def test_processes_end_with_the_one_that_started_them(tmp_path) -> None:
    """Killed outright, it can tell nobody; a worker that lives on would keep its output open."""
    script = tmp_path / "study.py"
    script.write_text(
        "import os, signal, sys, threading\n"
        "import small_jobs\n"
        "from pathlib import Path\n"
        "from diffnea.reproduce.executors import SeparateProcesses\n"
        "if __name__ == '__main__':\n"
        "    pool = SeparateProcesses(1)\n"
        "    print(pool.submit(os.getpid).result(), flush=True)\n"
        "    pool.submit(small_jobs.sleep, {'seconds': 600}, [])\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n",
        encoding="utf-8",
    )
    path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    answer = subprocess.run(
        [sys.executable, script],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": path},
        check=False,
        timeout=SECONDS,
    )
    assert answer.returncode == -signal.SIGKILL
    assert answer.stdout.strip().isdigit()


@pytest.mark.parametrize("name", ["threads", "processes:0", "processes:x"])
def test_an_executor_that_there_is_not_is_named(name) -> None:
    with pytest.raises(diffnea.Error, match="--executor"), workers(name):
        pass


def test_a_scheduler_that_there_is_not_is_named() -> None:
    pytest.importorskip("distributed", reason="dask is an extra: diffnea[dask]")
    with pytest.raises(diffnea.Error, match="--executor: nowhere:x"), workers("dask:nowhere:x"):
        pass


@pytest.mark.filterwarnings("default")  # Dask's own
def test_dask_runs_jobs_and_survives_a_dead_worker(tmp_path) -> None:
    pytest.importorskip("distributed", reason="dask is an extra: diffnea[dask]")
    log = tmp_path / "log"
    others = squares(log, 4)
    total = Job("total", small_jobs.total, {}, needs=tuple(others))
    once = Job("once", small_jobs.die, {"times": 1, "count": str(tmp_path / "once")})
    results = Results(tmp_path / "results")
    report = run_on("dask", [total, once], results)
    assert report.failed == {}
    assert results.read(total).data == {"sum": 14}
    assert results.read(once).data == {"survived": 1}
    assert sorted(log.read_text().split()) == list("0123")


def test_mpi_runs_jobs(tmp_path) -> None:
    pytest.importorskip("mpi4py.futures", reason="mpi4py is not installed", exc_type=ImportError)
    launcher = shutil.which("mpiexec")
    if launcher is None:
        pytest.skip("there is no mpiexec")
    script = tmp_path / "study.py"
    script.write_text(
        "import small_jobs, sys\n"
        "from pathlib import Path\n"
        "from diffnea.reproduce.executors import workers\n"
        "from diffnea.reproduce.jobs import Job, Results\n"
        "from diffnea.reproduce.progress import Progress\n"
        "from diffnea.reproduce.run import run\n"
        "if __name__ == '__main__':  # workers import this, too\n"
        "    folder = Path(sys.argv[1])\n"
        "    parts = [Job(f's{x}', small_jobs.square, {'x': x, 'log': str(folder / 'log')})"
        " for x in range(4)]\n"
        "    total = Job('total', small_jobs.total, {}, needs=tuple(parts))\n"
        "    with workers('mpi') as found:\n"
        "        run([total], Results(folder / 'results'), found, Progress(quiet=True))\n",
        encoding="utf-8",
    )
    path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    command = [launcher, "--allow-run-as-root", "--oversubscribe", "-n", "3"]
    subprocess.run(
        [*command, sys.executable, "-m", "mpi4py.futures", str(script), str(tmp_path)],
        env=os.environ | {"PYTHONPATH": path},
        check=True,
        timeout=SECONDS,
    )
    (total,) = (tmp_path / "results").glob("total-*.json")
    assert json.loads(total.read_text())["result"] == {"sum": 14}
