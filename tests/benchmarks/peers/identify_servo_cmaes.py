# ruff: noqa: E501
"""CMA-ES of BAM's kind: a simulation of the bench in NumPy, the mean absolute error of whole runs, no derivative.

    optuna    as BAM's fit does: optuna's CmaEsSampler with bipop restarts, a trial at a time, all runs at once as arrays,
              until BAM's number of trials or the time limit
    batch     pycma, a whole generation at once as arrays; restarts with twice the population until one gains nothing

Both begin at the data sheet; step 5 ms (BAM's).
"""

from __future__ import annotations

import warnings
from pathlib import Path

import cma
import numpy as np
import optuna
from servo_cases import STEP, ServoCase
from servo_pendulum import Bench
from servo_worker import TIME_LIMIT, Fit, Progress, Scale, main

SIGMA = 1.0 / 6.0  # share of the bounds' distance: optuna's default
TRIALS = 100_000  # BAM's default
GAIN = 0.01  # share of the score that a restart has to gain for another to be worth it


def fit_optuna(case: ServoCase, out: Path) -> Fit:
    # x0 is deprecated in favour of another package, from version 6 on.
    warnings.simplefilter("ignore")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    scale, bench, progress = Scale(case), Bench(case.runs(case.train), STEP), Progress()
    first = dict(zip(scale.names, scale.first(), strict=True))
    sampler = optuna.samplers.CmaEsSampler(x0=first, sigma0=SIGMA, restart_strategy="bipop", seed=1)

    def objective(trial: optuna.Trial) -> float:
        x = np.array([[trial.suggest_float(n, 0.0, 1.0) for n in scale.names]])
        score = float(bench.scores(scale.table(x))[0])
        progress.saw(score)
        return score

    def stop_in_time(study: optuna.Study, _: optuna.trial.FrozenTrial) -> None:
        if progress.over():
            study.stop()

    study = optuna.create_study(sampler=sampler)
    study.optimize(objective, n_trials=TRIALS, callbacks=[stop_in_time])
    best = np.array([study.best_params[n] for n in scale.names])
    return Fit(
        scale.law(best),
        settings=f"optuna {optuna.__version__}, CmaEsSampler, bipop, step {1e3 * STEP:g} ms",
        notes=[f"{progress.evaluations} of BAM's {TRIALS} trials in {TIME_LIMIT:.0f} s"],
        extra=progress.summary(),
    )


def fit_batch(case: ServoCase, out: Path) -> Fit:
    scale, bench, progress = Scale(case), Bench(case.runs(case.train), STEP), Progress()
    best, population, rounds = scale.first(), 4 + int(3 * np.log(len(scale.names))), []
    before = np.inf
    while not progress.over() and not (len(rounds) > 1 and progress.best > (1.0 - GAIN) * before):
        before = progress.best
        options = {"bounds": [0, 1], "popsize": population, "seed": 1 + len(rounds), "verbose": -9}
        search = cma.CMAEvolutionStrategy(scale.first(), SIGMA, options)
        while not search.stop() and not progress.over():
            asked = np.array(search.ask())
            scores = bench.scores(scale.table(asked))
            search.tell(list(asked), list(scores))
            if progress.saw(float(scores.min()), len(asked)):
                best = asked[scores.argmin()]
        rounds.append(
            {"population": population, "end": progress.seconds(), "best": float(search.result.fbest)}
        )  # fmt: skip
        population *= 2
    return Fit(
        scale.law(best),
        settings=f"pycma {cma.__version__}, {len(rounds)} rounds, step {1e3 * STEP:g} ms",
        extra=progress.summary() | {"rounds_of_search": rounds},
    )


if __name__ == "__main__":
    main({"optuna": fit_optuna, "batch": fit_batch})
