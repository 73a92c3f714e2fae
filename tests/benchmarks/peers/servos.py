# ruff: noqa: E501
"""Servo fits from commands and positions: every bench with every tool, each in a process of its own, and their judging.

    servos.py OUT [--cases simulated bam_xl330 kscale_sts3215_12v] [--diffnea COMMAND] [--servo-runs PROGRAM]

A fit is judged by whole runs, simulated from their first state and never reset: mean |error| over rows, then over runs;
by the tool's own simulation, and by two that all are put into: NumPy at 1 ms, with true sticking, and MuJoCo at 2 ms.
A finished fit is kept; OUT/servos.json holds everything.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np
import servo_mujoco
import servo_pendulum
from servo_cases import STEP, ServoCase, make_servo_cases
from servo_pendulum import Law

from identify import Tool, merged, run_once

Json = dict[str, Any]
FINE = 0.001  # s, step of the NumPy simulation as a judge
# Mean distance between the two simulations of a law without dry friction [rad]: at most 1.5e-3, by their steps. A wrong
# actuator made 0.2.
AGREE = 0.005

TOOLS = [
    Tool("diffnea identify", "servo_diffnea", "stock"),
    Tool("mujoco.sysid, from the data sheet", "servo_sysid", "stock", slow=True),
    Tool("mujoco.sysid, the same, scaled", "servo_sysid", "scaled", slow=True),
    Tool("mujoco.sysid, scaled, steps of 1 ms", "servo_sysid", "fine", slow=True),
    Tool("mujoco.sysid, scaled, drawn starts", "servo_sysid", "starts", slow=True),
    Tool("CMA-ES, a trial at a time (optuna)", "servo_cmaes", "optuna", slow=True),
    Tool("CMA-ES, a generation at a time (pycma)", "servo_cmaes", "batch", slow=True),
]


def check_agreement(case: ServoCase) -> None:
    """Before anything is timed: NumPy and MuJoCo simulate the same servo."""
    law, runs = replace(case.start()[0], coulomb=0.0), case.runs(case.train)
    bench = servo_pendulum.Bench(runs, FINE)
    mine = bench.simulate(np.array([astuple(law)]))[:, 0, :]
    for run, q in zip(runs, mine.T, strict=True):
        time, theirs = servo_mujoco.simulate(run, law, held=False, step=servo_mujoco.STEP)
        off = float(np.mean(np.abs(np.interp(time, bench.time, q) - theirs)))
        if off > AGREE:
            raise SystemExit(
                f"{case.name}, {run.name}: NumPy and MuJoCo are {1e3 * off:.1f} mrad apart"
            )


def by_servo_runs(program: Path, result: Json, files: list[str]) -> list[float]:
    """diffnea's own simulation of whole runs [rad]."""
    words = [str(program), result["model"], *files]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    return [1e-3 * float(line.split()[0]) for line in done.stdout.splitlines()[: len(files)]]


def judged(case: ServoCase, tool: Tool, result: Json, program: Path) -> Json:
    """Mean error of each split [mrad] by each judge."""
    law, held = Law(**result["law"]), result["held"]
    out: Json = {"own": {}, "numpy": {}, "mujoco": {}}
    for split, files in {"train": case.train, **case.held_out}.items():
        runs = case.runs(files)
        by = {
            "numpy": servo_pendulum.errors(runs, law, FINE, held),
            "mujoco": servo_mujoco.errors(runs, law, held, servo_mujoco.STEP),
        }
        if tool.worker == "servo_diffnea":
            by["own"] = by_servo_runs(program, result, files)
        elif tool.variant == "fine":
            by["own"] = servo_mujoco.errors(runs, law, held, servo_mujoco.FINE)
        elif tool.worker == "servo_sysid":
            by["own"] = by["mujoco"]
        else:
            by["own"] = servo_pendulum.errors(runs, law, STEP, held)
        for judge, errors in by.items():
            out[judge][split] = 1e3 * statistics.mean(errors)
    return out


def fit(case: ServoCase, tools: list[Tool], rounds: int, folder: Path) -> None:
    """`rounds` of each tool, the slow ones once; a finished result stays."""
    for tool in tools:
        kept = folder / f"{tool.worker}_{tool.variant}.result.json"
        if kept.is_file():
            continue
        out = folder / f"{tool.worker}_{tool.variant}"
        done = [
            run_once(folder / "case.json", tool, out) for _ in range(1 if tool.slow else rounds)
        ]
        kept.write_text(json.dumps(merged(done) | {"tool": tool.name}, indent=1), encoding="utf-8")
        said = (
            done[-1].get("failed") or f"processor {statistics.median(r['cpu'] for r in done):.2f} s"
        )
        print(f"{case.name:20s}{tool.name:42s}{said}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument(
        "--cases", nargs="+", default=["simulated", "bam_xl330", "kscale_sts3215_12v"]
    )
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", nargs="+", help="workers: servo_diffnea servo_sysid servo_cmaes")
    parser.add_argument("--diffnea", default="diffnea", help="the command")
    parser.add_argument(
        "--servo-runs", type=Path, required=True, help="the study of that name, built"
    )
    args = parser.parse_args()
    os.environ["DIFFNEA"] = str(args.diffnea)
    folder = args.out.resolve() / "servos"
    tools = [t for t in TOOLS if not args.only or t.worker in args.only]
    args.out.mkdir(parents=True, exist_ok=True)
    results = []
    for case in make_servo_cases(folder, args.cases):
        check_agreement(case)
        fit(case, tools, args.rounds, folder / case.name)
        for tool in TOOLS:
            kept = folder / case.name / f"{tool.worker}_{tool.variant}.result.json"
            if not kept.is_file():
                continue
            result = json.loads(kept.read_text(encoding="utf-8"))
            about = {"case": case.name, "title": case.title, "truth": case.truth}
            if "failed" not in result:
                about["errors"] = judged(case, tool, result, args.servo_runs)
            results.append(about | result)
    (args.out / "servos.json").write_text(json.dumps(results, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
