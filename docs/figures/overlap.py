"""How much of one effect's torque another one explains, beside the base: a picture of all pairs.

Every effect of joints is simulated along one motion; what the links' inertial parameters cannot
take over of its error is compared with what they leave of every other. 1: the same but for a
factor, 0: nothing in common.
"""

from pathlib import Path

import effect_signatures as one
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from panels import STYLE

import diffnea

MOTION = one.Motion(harmonics=15, velocity=2.5)  # up to 1.5 Hz
EVERY = 10  # rows
RANK = 1e-7  # of the largest singular value: below, parameters that no torque depends on
# Friction, drives and springs act at one joint; pairs take its neighbour, encoders another: of the
# last joint's zero the base takes all.
AT_JOINT = "joint4"


def error(name: str) -> tuple[np.ndarray, float]:
    """Return the unit vector of what the base leaves of an error, and its share of the error."""
    s = one.SIGNATURES[name]
    where = AT_JOINT if s.where in one.JOINTS and not name.startswith("encoder") else s.where
    where = "joint3,joint4" if "," in where else where
    lacking = one.WAM.with_effects([*one.WAM.effects, *s.base])
    log = one.recorded(diffnea.Effect(name, where, s.parameters), MOTION, lacking)
    scale = log.predicted.std(axis=0)
    rows = slice(50, -50, EVERY)

    def stacked(torque: np.ndarray) -> np.ndarray:
        return np.ravel((torque[rows] / scale).T)

    regressor = diffnea.regressor(one.WAM, q=log.q, qd=log.qd, qdd=log.qdd)
    base = np.stack([stacked(regressor[:, :, k]) for k in range(regressor.shape[2])], axis=1)
    base /= np.maximum(np.linalg.norm(base, axis=0), 1e-12)
    u, s_values, _ = np.linalg.svd(base, full_matrices=False)
    basis = u[:, s_values > RANK * s_values[0]]
    whole = stacked(np.column_stack([one.smooth(log.error[:, j]) for j in range(4)]))
    left = whole - basis @ (basis.T @ whole)
    size = np.linalg.norm(left)
    return left / max(size, 1e-12), float(size / np.linalg.norm(whole))


def explained() -> tuple[list[str], np.ndarray, np.ndarray]:
    """Return names, visible shares (n,), and the shares that pairs explain (n, n)."""
    names = [n for n in one.SIGNATURES if n != "payload"]  # absorbed by its link
    found = [error(name) for name in names]
    vectors = np.array([v for v, _ in found])
    return names, np.array([share for _, share in found]), (vectors @ vectors.T) ** 2


def save(path: Path) -> None:
    """Draw the pairs."""
    names, visible, pairs = explained()
    labels = [f"{n}  {v:.2f}" for n, v in zip(names, visible, strict=True)]
    with mpl.rc_context({**STYLE, "font.size": 6.5}):
        figure, axis = plt.subplots(figsize=(7.4, 6.4), layout="constrained")
        image = axis.imshow(pairs, vmin=0.0, vmax=1.0, cmap="Blues")
        axis.set_xticks(range(len(names)), names, rotation=90)
        axis.set_yticks(range(len(names)), labels)
        for i, row in enumerate(pairs):
            for j, share in enumerate(row):
                if i != j and share >= 0.1:
                    ink = "white" if share > 0.6 else "black"
                    words = f"{share:.2f}".lstrip("0")
                    axis.text(j, i, words, ha="center", va="center", fontsize=4.5, color=ink)
        figure.colorbar(image, shrink=0.5)
        figure.savefig(path, metadata={"Date": None})
        plt.close(figure)
