"""Time constraints written as Python functions beside the library's kinds.

PYTHONPATH=tests/python python tests/benchmarks/own_constraints.py

Processor time of constrained_acceleration [µs], without and with derivatives; the least of many
calls.
"""

import time

import numpy as np
from own_constraint_test import BODIES, KINDS, OF_TWO, some_motion, some_parameters

import diffnea

CALLS = 500


def least(constraint: diffnea.Constraint, motion: dict, derivatives: bool) -> float:
    """Return the least time of a call [µs]."""
    times = []
    for _ in range(CALLS):
        before = time.process_time_ns()
        diffnea.constrained_acceleration(BODIES, [constraint], derivatives=derivatives, **motion)
        times.append(time.process_time_ns() - before)
    return min(times) / 1e3


def main() -> None:
    """Print a line a kind and its bodies."""
    print(f"{'':28}{'function':>10}{'kind':>8}   with derivatives")
    for kind, function in KINDS.items():
        for bodies in ((0, 1), (None, 1)) if kind in OF_TWO else ((1,),):
            parameters = some_parameters(kind, np.random.default_rng(3))
            motion = some_motion(np.random.default_rng(4))
            own, known = (
                diffnea.Constraint(of, bodies, "tie", **parameters) for of in (function, kind)
            )
            without = [least(x, motion, derivatives=False) for x in (own, known)]
            ahead = [least(x, motion, derivatives=True) for x in (own, known)]
            print(
                f"{kind + ' ' + str(bodies):28}"
                + "{:10.1f}{:8.1f}{:10.0f}{:8.0f}".format(*without, *ahead)
            )


main()
