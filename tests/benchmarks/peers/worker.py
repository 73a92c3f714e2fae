# ruff: noqa: E501
"""What the identifications share: one process each, so that time and memory are its own."""

from __future__ import annotations

import argparse
import json
import os
import resource
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from cases import Case, load_case
from signals import Array, errors

Json = dict[str, Any]


@dataclass
class Outcome:
    """What an identification gives back."""

    predict: Callable[[Array, Array, Array], Array] | None  # torques of (T, n) q, qd, qdd
    inertias: Array | None = (
        None  # (links, 10): m, h, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the origin
    )
    settings: str = ""
    says: str = ""  # about the cause of what is left
    notes: list[str] = field(default_factory=list)
    extra: Json = field(default_factory=dict)


def pseudo_inertia(theta: Array) -> Array:
    """The 4x4 second moments of mass that θ belongs to: positive definite if and only if a body can have it."""
    m, hx, hy, hz, xx, xy, xz, yy, yz, zz = theta
    rotational = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    out = np.empty((4, 4))
    out[:3, :3] = 0.5 * np.trace(rotational) * np.eye(3) - rotational
    out[:3, 3] = out[3, :3] = (hx, hy, hz)
    out[3, 3] = m
    return out


def consistency(inertias: Array | None) -> Json:
    """Smallest eigenvalue of any link's pseudo-inertia, and how many links no body can have."""
    if inertias is None:
        return {"links": 0, "impossible": None, "smallest": None}
    smallest = [float(np.linalg.eigvalsh(pseudo_inertia(theta))[0]) for theta in inertias]
    return {
        "links": len(smallest),
        "impossible": sum(s < -1e-9 for s in smallest),
        "smallest": min(smallest),
        "per_link": smallest,
    }


def cpu_seconds() -> float:
    """Of this process, all threads, and of those it waited for."""
    own, waited = (resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + waited.ru_utime + waited.ru_stime


def peak_megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def arguments(variants: Iterable[str]) -> argparse.Namespace:
    """Words that a fit's process is called with: `CASE.json VARIANT OUT`."""
    parser = argparse.ArgumentParser()
    parser.add_argument("case", type=Path)
    parser.add_argument("variant", choices=variants)
    parser.add_argument("out", type=Path)
    return parser.parse_args()


def main(fits: dict[str, Callable[[Case], Outcome]]) -> None:
    """`worker CASE.json VARIANT OUT`: fit from the files, write OUT.json, and OUT.npz with held-out torques."""
    args = arguments(fits)
    case = load_case(args.case)
    before = peak_megabytes()
    wall, cpu = time.perf_counter(), cpu_seconds()
    outcome = fits[args.variant](case)
    wall, cpu = time.perf_counter() - wall, cpu_seconds() - cpu
    after = peak_megabytes()
    missed = {}
    for which in ("train", "test"):
        if outcome.predict is None:
            break
        s = case.signals(which)
        predicted = outcome.predict(s.q, s.qd, s.qdd)
        missed[which] = errors(s, predicted)
        k = s.rows(s.decimation)
        np.savez_compressed(
            f"{args.out}.npz", time=s.time[k], measured=s.tau[k], predicted=s.smooth(predicted)[k]
        )
    result = {
        "errors": missed,
        "wall": wall,
        "cpu": cpu,
        "peak_mb": after,
        "grown_mb": after - before,
        "threads": os.cpu_count(),
        "consistency": consistency(outcome.inertias),
        "settings": outcome.settings,
        "says": outcome.says,
        "notes": outcome.notes,
        **outcome.extra,
    }
    Path(f"{args.out}.json").write_text(json.dumps(result, indent=1), encoding="utf-8")
