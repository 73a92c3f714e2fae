# ruff: noqa: E501
"""Rollouts of a policy: a WAM swings a ball on a string for 2.5 s at 500 Hz, the same motions in every simulator.

    rollouts.py OUT [--rounds 5] [--mjx 1 64 1024] [--mjx-contacts 64] [--brax 64]

diffnea (primitive, limits and reward included), MuJoCo's own `rollout` (open loop commands, nothing else), MJX on the
processor, and Brax's `generalized` pipeline, which has no tendons: there the arm alone. diffnea and MuJoCo take turns in
every round; MJX and Brax follow, each compiled (timed apart) and run. A long scan is cut short for MJX and Brax, whose time is a multiple of its steps.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

os.environ["JAX_PLATFORMS"] = "cpu"

import mujoco
import numpy as np
import swing_world as world
from mujoco import rollout

import diffnea

Json = dict[str, Any]
SAMPLES = 64  # of diffnea and MuJoCo: a batch of policy search
SCAN_WORK = 16384  # steps times worlds of a timed call of MJX and Brax, 25 steps at least


@dataclass
class Timed:
    by: str
    how: str
    run: Callable[[], object]
    rollouts: float  # of 2.5 s that a call amounts to
    threads: str = "1"
    batch: int = SAMPLES
    compile_wall: float = 0.0
    compile_cpu: float = 0.0
    note: str = ""
    cpu: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)


def motions() -> tuple[diffnea.Promp, np.ndarray]:
    """Small enough that the string stays taut and nothing is touched: every rollout has all its steps."""
    promp = diffnea.Promp(["joint2", "joint4"], duration=world.MOVE, hold=1.0)
    return promp, np.random.default_rng(1).normal(scale=0.05, size=(1024, promp.size))


def of_diffnea(threads: int) -> tuple[diffnea.Rollouts, int]:
    model = diffnea.load_model(world.xml_path())
    simulator = diffnea.model_simulator(model, kp=world.KP, kd=world.KD, settle_time=0.0)
    promp, _ = motions()
    task = diffnea.BallInCupTask()
    out = diffnea.Rollouts(simulator, promp, task=task, start=world.HOME, threads=threads)
    return out, simulator.lanes


def diffnea_calls() -> list[Timed]:
    _, theta = motions()
    out = []
    for threads in (1, 2):
        runs, lanes = of_diffnea(threads)
        out.append(
            Timed(
                "diffnea",
                f"model on {lanes} lanes, arm 2 ms, ball 1 ms; reward included",
                lambda runs=runs: runs.run(theta[: 4 * SAMPLES]),
                4.0 * SAMPLES,
                str(threads),
                batch=4 * SAMPLES,
            )
        )
    return out


def mujoco_calls() -> list[Timed]:
    promp, theta = motions()
    out = []
    for name, step, integrator, contacts, threads in (
        ("Euler 2 ms", 2e-3, world.EULER, True, 1),
        ("Euler 2 ms, no contacts", 2e-3, world.EULER, False, 1),
        ("Euler 2 ms", 2e-3, world.EULER, True, 2),
        ("Euler 1 ms", 1e-3, world.EULER, True, 1),
        ("RK4 0.5 ms", 5e-4, world.RK4, True, 1),
    ):
        model = world.mujoco_world(step, integrator, contacts)
        count = SAMPLES if integrator == world.EULER else SAMPLES // 8
        control = world.commands(promp, theta[:count], step)
        start = np.repeat(world.start_state(model)[None], count, axis=0)
        datas = [mujoco.MjData(model) for _ in range(threads)]

        def run(model=model, datas=datas, start=start, control=control) -> object:
            return rollout.rollout(model, datas, start, control)

        by = f"MuJoCo {mujoco.__version__}, rollout"
        out.append(Timed(by, name, run, float(count), str(threads), batch=count))
    return out


def scan_steps(batch: int, steps: int) -> int:
    return min(steps, max(25, SCAN_WORK // batch))


def compiled(function: Any, argument: Any, **what: Any) -> Timed:
    wall, cpu = time.perf_counter(), time.process_time()
    call = function.lower(argument).compile()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    call(argument).block_until_ready()
    print(
        f"compiled {what['by']}, {what['how']}, {what['batch']}: {wall:.0f} s, processor {cpu:.0f} s"
    )
    return Timed(
        run=lambda: call(argument).block_until_ready(),
        threads="XLA's",
        compile_wall=wall,
        compile_cpu=cpu,
        **what,
    )


def mjx_call(batch: int, contacts: bool) -> Timed:
    import importlib.metadata

    import jax
    from mujoco import mjx

    promp, theta = motions()
    model = world.mujoco_world(2e-3, world.EULER, contacts)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    device_model, start = mjx.put_model(model), mjx.put_data(model, data)
    all_steps = round(world.EPISODE / 2e-3)
    steps = scan_steps(batch, all_steps)
    # From the middle of the motion on, where all of it moves.
    control = world.commands(promp, theta[:batch], 2e-3)[:, :steps]

    def one(commands: Any) -> Any:
        def step(state: Any, command: Any) -> tuple[Any, Any]:
            state = mjx.step(device_model, state.replace(ctrl=command))
            return state, state.qpos

        return jax.lax.scan(step, start, commands)[1]

    return compiled(
        jax.jit(jax.vmap(one)),
        jax.numpy.asarray(control),
        by=f"MJX {importlib.metadata.version('mujoco-mjx')}, jax {jax.__version__} on the processor",
        how="Euler 2 ms" + ("" if contacts else ", no contacts"),
        rollouts=batch * steps / all_steps,
        batch=batch,
        note=f"{steps} of {all_steps} steps timed",
    )


def brax_call(batch: int) -> Timed:
    import importlib.metadata

    import jax
    from brax.generalized import pipeline
    from brax.io import mjcf

    promp, theta = motions()
    system = mjcf.load_model(world.mujoco_world(2e-3, world.EULER, contacts=False, ball=False))
    all_steps = round(world.EPISODE / 2e-3)
    steps = scan_steps(batch, all_steps)
    control = world.commands(promp, theta[:batch], 2e-3)[:, :steps]
    home = jax.numpy.asarray(world.HOME)

    def one(commands: Any) -> Any:
        start = pipeline.init(system, home, jax.numpy.zeros(4))

        def step(state: Any, command: Any) -> tuple[Any, Any]:
            state = pipeline.step(system, state, command)
            return state, state.q

        return jax.lax.scan(step, start, commands)[1]

    return compiled(
        jax.jit(jax.vmap(one)),
        jax.numpy.asarray(control),
        by=f"Brax {importlib.metadata.version('brax')} generalized, on the processor",
        how="2 ms, the arm alone: no tendons, so no ball",
        rollouts=batch * steps / all_steps,
        batch=batch,
        note=f"{steps} of {all_steps} steps timed",
    )


def measure(table: list[Timed], rounds: int, out: Path, result: Json) -> None:
    """In turns; what is measured is written at once."""
    for _ in range(rounds):
        for t in table:
            wall, cpu = time.perf_counter(), time.process_time()
            t.run()
            t.cpu.append(time.process_time() - cpu)
            t.wall.append(time.perf_counter() - wall)
    for t in table:
        row = {
            "by": t.by,
            "how": t.how,
            "threads": t.threads,
            "batch": t.batch,
            "per_cpu_second": t.rollouts / statistics.median(t.cpu),
            "per_second": t.rollouts / statistics.median(t.wall),
            "best_per_second": t.rollouts / min(t.wall),
            "compile_wall": t.compile_wall,
            "compile_cpu": t.compile_cpu,
            "note": t.note,
        }
        result["rows"].append(row)
        print(
            f"{t.by[:40]:42s}{t.how[:45]:47s}{t.batch:5d}"
            f"{row['per_cpu_second']:10.1f} /s of processor{row['per_second']:10.1f} /s",
            flush=True,
        )
    (out / "rollouts.json").write_text(json.dumps(result, indent=1), encoding="utf-8")


def accuracy() -> list[Json]:
    """Path of the ball against MuJoCo's RK4 in steps of 0.1 ms, over motions that keep the string taut."""
    promp, theta = motions()
    chosen = theta[:8]

    def paths(step: float, integrator: int) -> list[tuple[np.ndarray, np.ndarray]]:
        model = world.mujoco_world(step, integrator)
        control = world.commands(promp, chosen, step)
        start = np.repeat(world.start_state(model)[None], len(chosen), axis=0)
        state, _ = rollout.rollout(model, [mujoco.MjData(model)], start, control)
        every = round(world.PERIOD / step)
        return [world.ball_path(model, s[every - 1 :: every]) for s in state]

    reference = paths(1e-4, world.RK4)

    def row(by: str, found: list[tuple[np.ndarray, np.ndarray]]) -> Json:
        misses = [
            np.linalg.norm(a[0][: len(b[0])] - b[0][: len(a[0])], axis=1)
            for a, b in zip(found, reference, strict=True)
        ]
        return {
            "by": by,
            "ball_rms_mm": 1e3 * float(np.sqrt(np.mean(np.concatenate(misses) ** 2))),
            "longest_mm": 1e3 * float(max(length.max() for _, length in found)) - 400.0,
        }

    out = [
        row("MuJoCo Euler 2 ms", paths(2e-3, world.EULER)),
        row("MuJoCo Euler 1 ms", paths(1e-3, world.EULER)),
        row("MuJoCo RK4 0.5 ms", paths(5e-4, world.RK4)),
    ]
    runs, _ = of_diffnea(1)
    found = []
    for one in chosen:
        trace = runs.trace(one)
        # The reference's rows are one period later than what is seen before each command.
        ball = trace.points("ball")[1:]
        found.append((ball, np.full(1, 0.4)))  # never longer, by construction
    return [*out, row("diffnea model", found)]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--mjx", type=int, nargs="*", default=[1, 64, 1024])
    parser.add_argument("--mjx-contacts", type=int, nargs="*", default=[64])
    parser.add_argument("--brax", type=int, nargs="*", default=[64])
    args = parser.parse_args()
    result: Json = {"accuracy": accuracy(), "rows": [], "failures": []}
    for r in result["accuracy"]:
        print(r)
    measure(diffnea_calls() + mujoco_calls(), args.rounds, args.out, result)
    jobs: list[tuple[str, Callable[[], Timed]]] = [
        *((f"MJX, {b}", lambda b=b: mjx_call(b, False)) for b in args.mjx),
        *((f"MJX, {b}, contacts", lambda b=b: mjx_call(b, True)) for b in args.mjx_contacts),
        *((f"Brax, {b}", lambda b=b: brax_call(b)) for b in args.brax),
    ]
    for what, make in jobs:
        try:
            measure([make()], args.rounds, args.out, result)
        except Exception as e:  # a peer that cannot do it: its own words go to the table
            result["failures"].append(f"{what}: {type(e).__name__}: {e}")
            print(result["failures"][-1], flush=True)
    (args.out / "rollouts.json").write_text(json.dumps(result, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
