# ruff: noqa: E501
"""Identify every case with every tool, in turns, each run in a process of its own; go on where an earlier call stopped.

    identify.py OUT [--cases wam4 panda ur10e emps] [--rounds 3] [--only diffnea …]

The slow ones (mujoco.sysid) run once. OUT/identify.json holds everything.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cases import Case, make_cases

HERE = Path(__file__).resolve().parent
HARD_LIMIT = 3600.0  # s of wall clock; the workers have limits of their own
Json = dict[str, Any]


@dataclass(frozen=True)
class Tool:
    name: str
    worker: str
    variant: str
    slow: bool = False


TOOLS = [
    Tool("diffnea", "diffnea", "stock"),
    Tool("diffnea, the common low-pass", "diffnea", "band"),
    Tool("diffnea, given the common signals", "diffnea", "given"),
    Tool("diffnea, shapes of friction too", "diffnea", "shapes"),
    Tool("diffnea, not constrained", "diffnea", "free"),
    Tool("diffnea diagnose", "diffnea", "diagnose"),
    Tool("diffnea diagnose --test", "diffnea", "diagnose_test"),
    Tool("least squares", "least_squares", "ols"),
    Tool("least squares, weighted", "least_squares", "wls"),
    Tool("FIGAROH fit, own signals", "figaroh", "own"),
    Tool("FIGAROH fit, given the common signals", "figaroh", "given"),
    Tool("FIGAROH physical_fit, own signals", "figaroh", "physical_own"),
    Tool("FIGAROH physical_fit, given the common signals", "figaroh", "physical_given"),
    Tool("mujoco.sysid, friction", "sysid", "friction", slow=True),
    Tool("mujoco.sysid, friction, scaled", "sysid", "friction_scaled", slow=True),
    Tool("mujoco.sysid, friction and inertias", "sysid", "full", slow=True),
    Tool("mujoco.sysid, friction and inertias, scaled", "sysid", "full_scaled", slow=True),
]


def run_once(case: Path, tool: Tool, out: Path) -> Json:
    """One fit in its own process; the processor time of the whole process beside what the worker says."""
    words = [sys.executable, HERE / f"identify_{tool.worker}.py", case, tool.variant, out]
    began = time.perf_counter()
    log = Path(f"{out}.log")
    with log.open("w", encoding="utf-8") as f:
        process = subprocess.Popen(list(map(str, words)), stdout=f, stderr=subprocess.STDOUT)
        deadline = began + HARD_LIMIT
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            if time.perf_counter() > deadline:
                process.kill()
            time.sleep(0.05)
    process.returncode = os.waitstatus_to_exitcode(status)
    whole = {
        "process_wall": time.perf_counter() - began,
        "process_cpu": usage.ru_utime + usage.ru_stime,
        "process_mb": usage.ru_maxrss / 1024.0,
        "load": os.getloadavg()[0],
    }
    if process.returncode != 0:
        text = log.read_text(encoding="utf-8").strip().splitlines()
        return whole | {"failed": text[-1] if text else f"exit status {process.returncode}"}
    result: Json = json.loads(Path(f"{out}.json").read_text(encoding="utf-8"))
    return result | whole


def merged(rounds: list[Json]) -> Json:
    """Medians of the rounds' times, the largest memory, the rest of the last round."""
    out = dict(rounds[-1])
    for key in ("wall", "cpu", "process_wall", "process_cpu", "load"):
        values = [r[key] for r in rounds if key in r]
        if values:
            out[key] = statistics.median(values)
    for key in ("peak_mb", "grown_mb", "process_mb"):
        values = [r[key] for r in rounds if key in r]
        if values:
            out[key] = max(values)
    out["rounds"] = len(rounds)
    return out


def identify(case: Case, tools: list[Tool], rounds: int, folder: Path) -> None:
    """`rounds` of all tools, one after the other; a finished result stays."""
    kept = {t: folder / f"{t.worker}_{t.variant}.result.json" for t in tools}
    todo: dict[Tool, list[Json]] = {t: [] for t in tools if not kept[t].is_file()}
    for k in range(rounds):
        for tool, done in todo.items():
            if tool.slow and k > 0:
                continue
            done.append(
                run_once(folder / "case.json", tool, folder / f"{tool.worker}_{tool.variant}")
            )
            last = done[-1]
            print(
                f"{case.name:7s}{tool.name:50s}"
                + (last.get("failed") or f"{last['wall']:8.2f} s, processor {last['cpu']:8.2f} s"),
                flush=True,
            )
            if tool.slow or len(done) == rounds:
                result = merged(done) | {"tool": tool.name, "variant": tool.variant}
                kept[tool].write_text(json.dumps(result, indent=1), encoding="utf-8")


def collect(cases: list[Case], folder: Path) -> list[Json]:
    out = []
    for case in cases:
        for tool in TOOLS:
            path = folder / case.name / f"{tool.worker}_{tool.variant}.result.json"
            if path.is_file():
                out.append(
                    {"case": case.name, "title": case.title, "joints": case.joints}
                    | json.loads(path.read_text(encoding="utf-8"))
                )
    return out


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--cases", nargs="+", default=["wam4", "panda", "ur10e", "emps"])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", nargs="+", help="workers: diffnea least_squares figaroh sysid")
    parser.add_argument("--diffnea", default="diffnea", help="the command")
    args = parser.parse_args()
    folder = args.out.resolve() / "identify"
    cases = make_cases(args.diffnea, folder, args.cases)
    tools = [t for t in TOOLS if not args.only or t.worker in args.only]
    for case in cases:
        identify(case, tools, args.rounds, folder / case.name)
    path = args.out / "identify.json"
    path.write_text(json.dumps(collect(cases, folder), indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
