# ruff: noqa: E501
"""Dynamics as a Python user calls them: many states of a Panda, seven joints.

    dynamics.py OUT [--states 2048] [--rounds 15]

All calls take turns in every round, the numbers are checked against each other first. Time is of the process, per state;
two threads where a row says so: then the wall clock.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from cases import MODELS, without_shapes
from mujoco import rollout
from signals import Array

import diffnea

AGREE = 1e-8  # relative, of torques and accelerations: the peers' own rounding is a hundredth of it


@dataclass
class Call:
    quantity: str
    by: str
    run: Callable[[], object]
    threads: int = 1
    cpu: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)


def states(count: int, n: int) -> tuple[Array, Array, Array, Array]:
    rng = np.random.default_rng(7)
    return (
        rng.uniform(-1.5, 1.5, (count, n)),
        rng.uniform(-1.0, 1.0, (count, n)),
        rng.uniform(-5.0, 5.0, (count, n)),
        rng.uniform(-10.0, 10.0, (count, n)),
    )


def loop(call: Callable[..., Array], *columns: Array) -> Array:
    return np.array([call(*row) for row in zip(*columns, strict=True)])


def calls(path: Path, count: int) -> list[Call]:
    model = diffnea.load_model(path)
    peer = pin.buildModelFromUrdf(str(path))
    data = peer.createData()
    bodies = mujoco.MjModel.from_xml_path(str(path))
    bodies.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    bodies.opt.timestep = 1e-3
    bodies.actuator_gear  # noqa: B018  a model without actuators has the attribute, too
    world = mujoco.MjData(bodies)
    q, qd, qdd, tau = states(count, peer.nv)

    def mj_inverse(qk: Array, qdk: Array, qddk: Array) -> Array:
        world.qpos[:], world.qvel[:], world.qacc[:] = qk, qdk, qddk
        mujoco.mj_inverse(bodies, world)
        return np.array(world.qfrc_inverse)

    def mj_forward(qk: Array, qdk: Array, tauk: Array) -> Array:
        world.qpos[:], world.qvel[:], world.qfrc_applied[:] = qk, qdk, tauk
        mujoco.mj_forward(bodies, world)
        return np.array(world.qacc)

    rnea, aba = (
        diffnea.rnea(model, q=q, qd=qd, qdd=qdd),
        diffnea.aba(model, q=q, qd=qd, tau=tau),
    )
    checks = {
        "Pinocchio rnea": (loop(lambda *x: pin.rnea(peer, data, *x), q, qd, qdd), rnea),
        "Pinocchio aba": (loop(lambda *x: pin.aba(peer, data, *x), q, qd, tau), aba),
        "mj_inverse": (loop(mj_inverse, q, qd, qdd), rnea),
        "mj_forward": (loop(mj_forward, q, qd, tau), aba),
    }
    for name, (theirs, ours) in checks.items():
        error = np.abs(theirs - ours).max() / np.abs(ours).max()
        if not error < AGREE:
            raise SystemExit(f"{name} computes something else: relative difference {error:.2g}")
    # Pinocchio's batches: columns, Fortran order.
    columns = [np.asfortranarray(x.T) for x in (q, qd, qdd, tau)]
    pool = pin.ModelPool(peer, 2)
    # MuJoCo's batch: one step from each state, which integrates as well.
    start = np.zeros((count, mujoco.mj_stateSize(bodies, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    start[:, 1 : 1 + peer.nv], start[:, 1 + peer.nv : 1 + 2 * peer.nv] = q, qd
    force = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
    pools = {k: [mujoco.MjData(bodies) for _ in range(k)] for k in (1, 2)}

    def one_step(threads: int) -> object:
        return rollout.rollout(
            bodies, pools[threads], start, tau[:, None, :], control_spec=force, nstep=1
        )

    dy, py, mj = "diffnea", f"Pinocchio {pin.__version__}", f"MuJoCo {mujoco.__version__}"
    return [
        Call(
            "inverse dynamics",
            f"{dy}, one call",
            lambda: diffnea.rnea(model, q=q, qd=qd, qdd=qdd),
        ),
        Call(
            "inverse dynamics",
            f"{dy}, a call a state",
            lambda: [
                diffnea.rnea(model, q=a, qd=b, qdd=c) for a, b, c in zip(q, qd, qdd, strict=True)
            ],
        ),
        Call(
            "inverse dynamics",
            f"{py}, a call a state",
            lambda: [pin.rnea(peer, data, a, b, c) for a, b, c in zip(q, qd, qdd, strict=True)],
        ),
        Call(
            "inverse dynamics",
            f"{py}, rneaInParallel, 1 thread",
            lambda: pin.rneaInParallel(1, pool, *columns[:3]),
        ),
        Call(
            "inverse dynamics",
            f"{py}, rneaInParallel, 2 threads",
            lambda: pin.rneaInParallel(2, pool, *columns[:3]),
            threads=2,
        ),
        Call(
            "inverse dynamics",
            f"{mj}, mj_inverse a state",
            lambda: loop(mj_inverse, q, qd, qdd),
        ),
        Call(
            "forward dynamics",
            f"{dy}, one call",
            lambda: diffnea.aba(model, q=q, qd=qd, tau=tau),
        ),
        Call(
            "forward dynamics",
            f"{dy}, a call a state",
            lambda: [
                diffnea.aba(model, q=a, qd=b, tau=c) for a, b, c in zip(q, qd, tau, strict=True)
            ],
        ),
        Call(
            "forward dynamics",
            f"{py}, a call a state",
            lambda: [pin.aba(peer, data, a, b, c) for a, b, c in zip(q, qd, tau, strict=True)],
        ),
        Call(
            "forward dynamics",
            f"{py}, abaInParallel, 1 thread",
            lambda: pin.abaInParallel(1, pool, *columns[:2], columns[3]),
        ),
        Call(
            "forward dynamics",
            f"{py}, abaInParallel, 2 threads",
            lambda: pin.abaInParallel(2, pool, *columns[:2], columns[3]),
            threads=2,
        ),
        Call(
            "forward dynamics",
            f"{mj}, mj_forward a state",
            lambda: loop(mj_forward, q, qd, tau),
        ),
        Call("forward dynamics", f"{mj}, rollout of one step, 1 thread", lambda: one_step(1)),
        Call(
            "forward dynamics",
            f"{mj}, rollout of one step, 2 threads",
            lambda: one_step(2),
            threads=2,
        ),
        Call(
            "regressor",
            f"{dy}, one call",
            lambda: diffnea.regressor(model, q=q, qd=qd, qdd=qdd),
        ),
        Call(
            "regressor",
            f"{py}, a call a state",
            lambda: [
                pin.computeJointTorqueRegressor(peer, data, a, b, c).copy()
                for a, b, c in zip(q, qd, qdd, strict=True)
            ],
        ),
        Call(
            "RNEA derivatives",
            f"{dy}, one call",
            lambda: diffnea.rnea_derivatives(model, q=q, qd=qd, qdd=qdd),
        ),
        Call(
            "RNEA derivatives",
            f"{py}, a call a state",
            lambda: [
                pin.computeRNEADerivatives(peer, data, a, b, c)
                for a, b, c in zip(q, qd, qdd, strict=True)
            ],
        ),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--states", type=int, default=2048)
    parser.add_argument("--rounds", type=int, default=15)
    args = parser.parse_args()
    table = calls(without_shapes(MODELS / "panda.urdf", args.out / "dynamics"), args.states)
    for _ in range(args.rounds):
        for call in table:
            wall, cpu = time.perf_counter(), time.process_time()
            call.run()
            call.cpu.append(time.process_time() - cpu)
            call.wall.append(time.perf_counter() - wall)
    rows = [
        {
            "quantity": c.quantity,
            "by": c.by,
            "threads": c.threads,
            "cpu_us": 1e6 * statistics.median(c.cpu) / args.states,
            "wall_us": 1e6 * statistics.median(c.wall) / args.states,
            "best_wall_us": 1e6 * min(c.wall) / args.states,
        }
        for c in table
    ]
    for r in rows:
        print(
            f"{r['quantity']:18s}{r['by']:48s}{r['cpu_us']:9.2f} us   wall {r['wall_us']:9.2f} us"
        )
    result = {"states": args.states, "rounds": args.rounds, "rows": rows}
    (args.out / "dynamics.json").write_text(json.dumps(result, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
