# ruff: noqa: E501
"""Why least squares is better on the Panda: what each of its freedoms is worth, one after the other.

    python tests/benchmarks/peers/why_panda.py FOLDER

Least squares on the common signals, weighted by joint, with rotors and viscous friction of any sign or of that which they can
have, dry friction as a sign of the speed or as tanh(speed / v0); then diffnea with and without physically possible links.
Needs diffnea and SciPy alone.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from cases import Case, panda
from identify_diffnea import EFFECTS
from scipy.optimize import lsq_linear
from signals import Array, Signals

import diffnea

RIDGE = 1e-6  # of a column's length: what the data do not tell stays at 0


def columns(model: diffnea.Model, s: Signals, turn: float) -> Array:
    """(T, n, 14 n): inertial parameters, rotors, viscous and dry friction, offsets; low-passed like the torques."""
    friction = np.tanh(s.qd / turn) if turn else np.sign(s.qd)
    blocks = [np.asarray(diffnea.regressor(model, q=s.q, qd=s.qd, qdd=s.qdd))]
    blocks += [
        np.einsum("tj,jk->tjk", x, np.eye(s.q.shape[1]))
        for x in (s.qdd, s.qd, friction, np.ones_like(s.qd))
    ]
    all_columns = np.concatenate(blocks, axis=2)
    return np.asarray(s.smooth(all_columns.reshape(len(s.q), -1)).reshape(all_columns.shape))


def least_squares(case: Case, turn: float, signs: bool) -> Array:
    model = diffnea.load_model(case.model)
    train, test = case.signals("train"), case.signals("test")
    rows = train.rows(train.decimation)
    a, y = columns(model, train, turn)[rows], train.tau[rows]
    n, p = a.shape[1:]
    lower = np.full(p, -np.inf)
    if signs:
        lower[p - 4 * n : p - 2 * n] = 0.0  # rotors, viscous friction
    noise, x = np.ones(n), np.zeros(p)
    for _ in range(2):
        weighted = (a / noise[:, None]).reshape(-1, p)
        size = np.linalg.norm(weighted, axis=0) + 1e-12
        ridge = np.vstack([weighted / size, RIDGE * np.eye(p)])
        x = (
            lsq_linear(ridge, np.append((y / noise).ravel(), np.zeros(p)), bounds=(lower, np.inf)).x
            / size
        )
        noise = np.sqrt(np.mean((y - a @ x) ** 2, axis=0))
    return np.asarray(columns(model, test, turn) @ x)


def of_diffnea(case: Case, physical: bool) -> Array:
    model = diffnea.load_model(case.model)
    fit = diffnea.identify(
        model,
        case.train,
        effects=EFFECTS,
        torque_side=case.torque_side,
        filter_hz=case.cutoff,
        physical=physical,
    )
    s = case.signals("test")
    return np.asarray(
        s.smooth(np.asarray(diffnea.rnea(fit.model, q=s.q, qd=s.qd, qdd=s.qdd, effects=True)))
    )


def main(folder: Path) -> None:
    case = panda(folder)
    test = case.signals("test")
    rows = test.rows(test.decimation)
    lines = {
        "least squares, any sign, sign(speed)": least_squares(case, 0.0, signs=False),
        "  dry friction tanh(speed / 0.1 rad/s)": least_squares(case, 0.1, signs=False),
        "  rotors and viscous friction >= 0": least_squares(case, 0.0, signs=True),
        "diffnea, physical=False, 10 Hz": of_diffnea(case, physical=False),
        "diffnea, 10 Hz": of_diffnea(case, physical=True),
    }
    for name, torque in lines.items():
        miss = np.sqrt(np.mean((test.tau - torque)[rows] ** 2, axis=0))
        size = np.sqrt(np.mean(test.tau[rows] ** 2, axis=0))
        print(
            f"{name:40s} {miss.mean():.4f} N*m  "
            + " ".join(f"{100 * m:5.1f}" for m in miss / size)
            + " %"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
