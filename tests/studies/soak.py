"""Diagnose and identify thousands of random robots from random, often dirty recordings.

    python tests/studies/soak.py -o build/soak --count 5000

What a program may say is a result or a refusal (``diffnea.Error``, exit status 1 or 3). All else
is a fault: another exception, a crash, more processor seconds than ``--limit``, or ten times as
many by the clock. Every case is a number:
``--only 1234`` runs it again and shows what became of it. One case in eight goes through the
command. soak.jsonl in the folder has a line a case; the same command goes on where it was.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import json
import os
import resource
import select
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
COMMAND = os.environ.get("DIFFNEA_COMMAND") or str(Path(sys.executable).parent / "diffnea")
FAULTS = ("crash", "hang", "exception", "memory")
MEMORY = 4 << 30
"""That a case may take [bytes]."""
PATIENCE = 10.0
"""Times the limit, by the clock: others may work on the machine, too."""
EVERY = 8
"""Which case goes through the command."""

Json = dict[str, Any]


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("build/soak"), help="folder")
    parser.add_argument("--count", type=int, default=2000, help="cases (default: 2000)")
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument(
        "--limit", type=float, default=120.0, help="processor seconds of a case (default: 120)"
    )
    parser.add_argument("--minutes", type=float, help="stop after so many")
    parser.add_argument("--only", type=int, help="run this case here, and show what it is")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.worker:
        return serve()
    if args.only is not None:
        print(json.dumps(run(args.only, args.limit), indent=1))
        return 0
    args.output.mkdir(parents=True, exist_ok=True)
    log = args.output / "soak.jsonl"
    soak(log, args)
    return summarize(entries(log))


def soak(log: Path, args: argparse.Namespace) -> None:
    known = {entry["case"] for entry in entries(log)}
    until = time.monotonic() + 60.0 * (args.minutes or 1e9)
    with contextlib.ExitStack() as opened:
        worker = opened.enter_context(Worker())
        for case in range(args.first, args.first + args.count):
            if case in known:
                continue
            if time.monotonic() > until:
                return
            entry = worker.ask(case, args.limit)
            with log.open("a", encoding="utf-8") as file:
                file.write(json.dumps(entry) + "\n")
            if entry["outcome"] in FAULTS:
                print(f"{entry['outcome']}: {case}: {entry.get('text', '')[-300:]}", flush=True)


def entries(log: Path) -> list[Json]:
    """Lines of the log; one that was cut off by the end of a run is run again."""
    out = []
    for line in log.read_text(encoding="utf-8").splitlines() if log.exists() else []:
        with contextlib.suppress(ValueError):
            out.append(json.loads(line))
    return out


def summarize(found: list[Json]) -> int:
    count = collections.Counter(entry["outcome"] for entry in found)
    slowest = sorted(found, key=lambda entry: -entry["seconds"])[:3]
    print(f"{len(found)} cases: " + ", ".join(f"{n} {name}" for name, n in count.most_common()))
    print("slowest: " + ", ".join(f"{e['case']} {e['seconds']:.1f} s" for e in slowest))
    for entry in found:
        if entry["outcome"] in FAULTS:
            print(f"{entry['outcome']}: --only {entry['case']}")
    return 1 if any(count[fault] for fault in FAULTS) else 0


class Worker:
    """A process that runs cases; a new one after it died or was too slow."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def ask(self, case: int, limit: float) -> Json:
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, str(HERE / "soak.py"), "--worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                start_new_session=True,
            )
        process = self._process
        assert process.stdin
        assert process.stdout
        process.stdin.write(f"{case} {limit}\n")
        process.stdin.flush()
        ready, _, _ = select.select([process.stdout], [], [], PATIENCE * limit + 10.0)
        line = process.stdout.readline() if ready else ""
        if line:
            return json.loads(line)
        said = self._end()
        outcome = "hang" if not ready or process.returncode == -signal.SIGPROF else "crash"
        return {
            "case": case,
            "outcome": outcome,
            "seconds": limit,
            "words": "",
            "text": f"status {process.returncode}\n{said[-2000:]}",
        }

    def _end(self) -> str:
        process, self._process = self._process, None
        if process is None:
            return ""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        _, said = process.communicate()
        return said


def serve() -> int:
    """Answer numbers with lines."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    for line in sys.stdin:
        case, limit = line.split()
        signal.setitimer(signal.ITIMER_PROF, float(limit))  # its signal ends the process
        entry = run(int(case), float(limit))
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        print(json.dumps(entry), flush=True)
    return 0


def run(number: int, limit: float) -> Json:
    """Run a case; what became of it."""
    sys.path.insert(0, str(HERE))
    import soak_cases

    with tempfile.TemporaryDirectory(prefix="soak-") as name:
        folder = Path(name)
        case = soak_cases.make(number, folder)
        begin = processor_seconds()
        answer = by_command if number % EVERY == 0 else by_python
        outcome, text = answer(case, folder, limit)
        seconds = processor_seconds() - begin
    return {
        "case": number,
        "outcome": outcome,
        "seconds": round(seconds, 3),
        "words": case.words,
        "text": text,
    }


def processor_seconds() -> float:
    """Of this process and of those it waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def by_python(case: Any, folder: Path, limit: float) -> tuple[str, str]:
    import diffnea

    try:
        model = diffnea.Model.from_dict(case.model)
        keep = {}
        if case.sidecar:
            keep = {
                key: case.sidecar[key] for key in ("torque_side", "passive") if key in case.sidecar
            }
        train, test = split(case)
        function = diffnea.diagnose if case.task == "diagnose" else diffnea.identify
        found = function(model, train, test=test, **case.options, **keep)
        found.to_dict()
        return "done", found.verdict if case.task == "diagnose" else found.summary.termination
    except diffnea.Error as error:
        return "refused", str(error)
    except MemoryError:
        return "memory", traceback.format_exc()
    except Exception:
        return "exception", traceback.format_exc()


def split(case: Any) -> tuple[list[Path], list[Path] | None]:
    return (case.files[:-1], case.files[-1:]) if case.test else (case.files, None)


def by_command(case: Any, folder: Path, limit: float) -> tuple[str, str]:
    model = folder / "model.json"
    model.write_text(json.dumps(case.model), encoding="utf-8")
    if case.sidecar:
        for file in case.files:
            file.with_suffix(".json").write_text(json.dumps(case.sidecar), encoding="utf-8")
    train, test = split(case)
    words = [COMMAND, case.task, model, *train, *(["--test", *test] if test else [])]
    for key, value in case.options.items():
        if key == "grey_box":
            words.append("--grey-box" if value else "--no-grey-box")
        elif key == "entropic_prior":
            words += ["--prior", f"entropic={value}"]
        else:
            joined = ",".join(value) or "none" if isinstance(value, list) else value
            words += [f"--{key.partition('_')[0]}", joined]
    try:
        answer = subprocess.run(
            [*map(str, words), "--quiet", "-o", str(folder / "out")],
            capture_output=True,
            text=True,
            timeout=PATIENCE * limit,
            check=False,
            preexec_fn=lambda: resource.setrlimit(
                resource.RLIMIT_CPU, (int(limit), int(limit) + 5)
            ),
        )
    except subprocess.TimeoutExpired:
        return "hang", " ".join(map(str, words))
    status = answer.returncode
    if status == -signal.SIGXCPU:
        return "hang", " ".join(map(str, words))
    if status in (0, 3):
        return "done", f"status {status}"
    if status == 1 and "internal error" not in answer.stderr:
        return "refused", answer.stderr.strip()[-500:]
    if status == 2:  # of the soak's own words
        return "exception", answer.stderr.strip()[-500:]
    return "crash", f"status {status}: {answer.stderr[-500:]}"


if __name__ == "__main__":
    sys.exit(main())
