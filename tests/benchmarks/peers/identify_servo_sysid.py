# ruff: noqa: E501
"""MuJoCo's own identification, `mujoco.sysid`, of the servo: whole runs in closed loop, its optimizer, finite differences.

    stock     its defaults, from the data sheet
    scaled    with x_scale='jac', which its warning about ill-conditioned problems advises
    fine      `scaled` in steps of 1 ms, not of MuJoCo's default, 2 ms
    starts    `scaled` from eight starts drawn between the bounds, the best kept: for who has no data sheet

Stiffness and reach are counted at a typical gain, so that no parameter is of another order
than the rest. Delay and speed of the setpoint act on the commands, in the rollout that its manual lets a user give.
"""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

import mujoco
import numpy as np
import servo_mujoco
from mujoco import sysid
from mujoco.sysid._src.trajectory import sysid_rollout
from servo_cases import STEP, ServoCase
from servo_pendulum import Law
from servo_worker import TIME_LIMIT, Fit, Progress, Scale, TimeOverError, main
from signals import Array


def units(case: ServoCase) -> dict[str, float]:
    """Factors from the parameters of the law to those of sysid."""
    return {"stiffness": case.gain, "reach": 1.0 / case.gain}


def law_of(params: sysid.ParameterDict, case: ServoCase) -> Law:
    values = {f.name: np.inf for f in fields(Law)} | {
        n: float(p.value[0]) for n, p in params.items()
    }
    return Law(**{n: v / units(case).get(n, 1.0) for n, v in values.items()})


def parameters(case: ServoCase) -> sysid.ParameterDict:
    start, low, high = case.start()
    out = sysid.ParameterDict()
    for f in fields(Law):
        factor = units(case).get(f.name, 1.0)
        if np.isfinite(getattr(start, f.name)):
            value, a, b = (factor * getattr(law, f.name) for law in (start, low, high))
            out.add(sysid.Parameter(f.name, value, a, b))
    return out.move_off_bounds()  # advised by its warning about starts at a bound


def sequences(case: ServoCase, step: float) -> list[sysid.ModelSequences]:
    """Runs of the same load and length together, which the residual demands."""
    groups = defaultdict(list)
    for run in case.runs(case.train):
        groups[run.pendulum, len(run.grid(STEP))].append(run)
    out = []
    for (body, _), runs in groups.items():
        spec = servo_mujoco.specification(body, step)
        model = spec.compile()
        # States are compared: a sensor's value in a rollout is a step older than its time.
        mapping = sysid.TimeSeries.compute_all_state_mappings(model)[0]
        names, states, told, seen = [], [], [], []
        for run in runs:
            t = run.grid(STEP)
            q, v = run.first_state()
            names.append(run.name)
            states.append(sysid.create_initial_state(model, np.array([q]), np.array([v])))
            told.append(sysid.TimeSeries(t, servo_mujoco.controls(run, t)))
            seen.append(sysid.TimeSeries(t, run.positions(t)[:, None], mapping))
        out.append(
            sysid.ModelSequences(f"{body.mass:g}_{len(out)}", spec, names, states, told, seen)
        )
    return out


def late_rollout(case: ServoCase) -> Callable[..., Any]:
    def run(
        models: Sequence[mujoco.MjModel],
        control_signal: Sequence[sysid.TimeSeries],
        param_dicts: Sequence[sysid.ParameterDict],
        **kwargs: Any,
    ) -> Any:
        each = len(control_signal) // len(param_dicts)
        laws = [law_of(p, case) for p in param_dicts for _ in range(each)]
        late = [
            sysid.TimeSeries(c.times, servo_mujoco.delayed(c.data, c.times, law), c.signal_mapping)
            for c, law in zip(control_signal, laws, strict=True)
        ]
        return sysid_rollout(models=models, control_signal=late, **kwargs)

    return run


def drawn(case: ServoCase, params: sysid.ParameterDict, seed: int) -> sysid.ParameterDict:
    """Parameters drawn between the bounds, sizes of unknown order by their logarithm."""
    scale, out = Scale(case), params.copy()
    x = np.random.default_rng(seed).uniform(0.05, 0.95, (1, len(scale.names)))
    for f, value in zip(fields(Law), scale.table(x)[0], strict=True):
        if f.name in out:
            out[f.name].value[:] = value * units(case).get(f.name, 1.0)
    return out


def fit(case: ServoCase, scaled: bool, starts: int = 0, step: float = servo_mujoco.STEP) -> Fit:
    logging.disable(logging.INFO)
    sheet = parameters(case)

    def build(params: sysid.ParameterDict, spec: mujoco.MjSpec) -> mujoco.MjModel:
        servo_mujoco.set_law(spec, law_of(params, case))
        return spec.compile()

    residual = sysid.build_residual_fn(
        models_sequences=sequences(case, step), build_model=build, custom_rollout=late_rollout(case)
    )
    progress, best, notes, ends = Progress(), sheet.as_vector(), [], []

    def watched(x: Array, p: sysid.ParameterDict, **kwargs: Any) -> Any:
        nonlocal best
        out = residual(x, p, **kwargs)
        columns = 1 if x.ndim == 1 else x.shape[1]
        if columns == 1:
            ends[-1] = min(ends[-1], cost := float(sum(np.sum(r**2) for r in out[0])))
            if progress.saw(cost):
                best = np.ravel(x).copy()
        else:
            progress.saw(np.inf, columns)
        if progress.over():
            raise TimeOverError
        return out

    begins = [drawn(case, sheet, seed) for seed in range(starts)] or [sheet]
    try:
        for start in begins:
            ends.append(np.inf)
            sysid.optimize(start, watched, verbose=False, **({"x_scale": "jac"} if scaled else {}))
    except TimeOverError:
        notes.append(
            f"not finished after {TIME_LIMIT:.0f} s of processor time: the best until then"
        )
    found = sheet.copy()
    found.update_from_vector(best)
    low, high = found.get_bounds()
    near = np.minimum(best - low, high - best) < 1e-3 * (high - low)
    if near.any():
        stuck = (n for n, b in zip(found.keys(), near, strict=True) if b)
        notes.append("at a bound: " + ", ".join(stuck))
    return Fit(
        law_of(found, case),
        settings=f"whole runs, implicitfast {1e3 * step:g} ms, optimizer mujoco, "
        + ("x_scale='jac'" if scaled else "defaults")
        + (f", {len(ends)} of {starts} drawn starts" if starts else ", from the data sheet"),
        notes=notes,
        extra=progress.summary() | {"ends": ends},
    )


if __name__ == "__main__":
    main(
        {
            "stock": lambda case, out: fit(case, scaled=False),
            "scaled": lambda case, out: fit(case, scaled=True),
            "fine": lambda case, out: fit(case, scaled=True, step=servo_mujoco.FINE),
            "starts": lambda case, out: fit(case, scaled=True, starts=8),
        }
    )
