# ruff: noqa: E501
"""Plain least squares as it is in the textbooks: Pinocchio's regressor, numpy, nothing else.

Columns: ten inertial parameters of each link, rotor inertia, viscous and Coulomb friction (sign of the speed), offset of
each joint. Rows are those of common signals, columns and torques low-passed alike and decimated. `weighted` divides a
joint's rows by its residual's rms of the unweighted fit. Where the data do not tell, the model's parameters stay
(minimum norm of the change).
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from cases import Case
from signals import Array, Signals
from worker import Outcome, main

RANK = 1e-6  # singular values below this share of the largest count as zero


def pinocchio_model(path: str) -> pin.Model:
    return pin.buildModelFromMJCF(path) if path.endswith(".xml") else pin.buildModelFromUrdf(path)


def torque_columns(model: pin.Model, q: Array, qd: Array, qdd: Array) -> Array:
    """(n, T, 14 n): one block of rows a joint."""
    data, n = model.createData(), model.nv
    out = np.zeros((n, len(q), 14 * n))
    for k in range(len(q)):
        out[:, k, : 10 * n] = pin.computeJointTorqueRegressor(model, data, q[k], qd[k], qdd[k])
    for j in range(n):
        out[j, :, 10 * n + j] = qdd[:, j]
        out[j, :, 11 * n + j] = qd[:, j]
        out[j, :, 12 * n + j] = np.sign(qd[:, j])
        out[j, :, 13 * n + j] = 1.0
    return out


def nominal(model: pin.Model) -> Array:
    links = [model.inertias[i].toDynamicParameters() for i in range(1, model.njoints)]
    return np.concatenate([*links, model.armature, np.zeros(3 * model.nv)])


def solve(rows: Array, torque: Array, prior: Array) -> Array:
    scale = np.linalg.norm(rows, axis=0)
    seen = scale > RANK * scale.max()
    change, *_ = np.linalg.lstsq(rows[:, seen] / scale[seen], torque - rows @ prior, rcond=RANK)
    out = prior.copy()
    out[seen] += change / scale[seen]
    return out


def fit(case: Case, weighted: bool) -> Outcome:
    model = pinocchio_model(case.model)
    s: Signals = case.signals("train")
    n = model.nv
    columns = torque_columns(model, s.q, s.qd, s.qdd)
    rows = s.rows(s.decimation)
    blocks = [s.smooth(columns[j])[rows] for j in range(n)]
    torque = [s.tau[rows, j] for j in range(n)]
    prior = nominal(model)
    pi = solve(np.concatenate(blocks), np.concatenate(torque), prior)
    if weighted:
        sigma = [np.std(torque[j] - blocks[j] @ pi) for j in range(n)]
        pi = solve(
            np.concatenate([b / d for b, d in zip(blocks, sigma, strict=True)]),
            np.concatenate([t / d for t, d in zip(torque, sigma, strict=True)]),
            prior,
        )
    # Pinocchio: m, h, Ixx, Ixy, Iyy, Ixz, Iyz, Izz; here Ixz before Iyy.
    inertias = pi[: 10 * n].reshape(n, 10)[:, [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]]

    def predict(q: Array, qd: Array, qdd: Array) -> Array:
        return np.asarray((torque_columns(model, q, qd, qdd) @ pi).T)

    return Outcome(
        predict,
        inertias,
        settings=f"14 columns a joint, numpy.linalg.lstsq (rcond {RANK:g})"
        + (", joints weighted by their residuals" if weighted else ""),
        says="nothing",
    )


if __name__ == "__main__":
    main({"ols": lambda c: fit(c, False), "wls": lambda c: fit(c, True)})
