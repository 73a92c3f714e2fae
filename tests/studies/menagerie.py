# ruff: noqa: E501
"""Read public MJCF robots and compare their dynamics with those of a current MuJoCo; figures of docs/models.md.

    python3 tests/studies/menagerie.py build/release/apps/diffnea [--corpus FOLDER] [--no-meshes] [--fix-base] [ROBOT …]

FOLDER holds MuJoCo Menagerie, a folder a robot; meshes may be missing. By default it is `menagerie_xml` in
DIFFNEA_CORPUS, else in ../shared/corpus beside the project. It is copied, and boxes stand in for meshes that are
missing, for both readers alike; with --no-meshes they stay missing.

A robot is read as it is, then with --open-loops, or, if asked, both with --fix-base. At random states rnea, mass matrix
and aba are compared with MuJoCo's, without contacts, constraints, drives and passive forces; an error is relative to
the largest torque, entry or acceleration of the state. Where joints follow others, MuJoCo's full tree is projected;
where a base floats, its twist and wrench are turned into MuJoCo's. Needs the Python module of diffnea, numpy, and
`pip install mujoco`.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import struct
import subprocess
import tempfile
import zlib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

import diffnea

SOURCE = Path(__file__).resolve().parents[2]
CORPUS = Path(os.environ.get("DIFFNEA_CORPUS", SOURCE.parent / "shared" / "corpus"))
WAYS = ((), ("--open-loops",))
STATES = 20
SIZE = 0.05  # half an edge of a mesh that stands in, at most [m]
# Parts of others: what includes them is read.
NO_ROBOT = re.compile(r"^(scene|keyframe|mjx_scene|mjx_single_cube|filtered_|joint_position_)")

Array = NDArray[np.float64]
Range = tuple[float, ...]


def box(half: Array) -> list[tuple[Array, Array, Array]]:
    """Triangles of a box, seen from outside."""
    out = []
    for axis in range(3):
        u, v = np.eye(3)[(axis + 1) % 3] * half, np.eye(3)[(axis + 2) % 3] * half
        for side in (1.0, -1.0):
            c = np.eye(3)[axis] * half * side
            a, b = (u, v) if side > 0 else (v, u)
            out += [(c - a - b, c + a - b, c + a + b), (c - a - b, c + a + b, c - a + b)]
    return out


def write_mesh(path: Path, scale: float) -> None:
    """Write a box of a shape that follows from the file's name."""
    shape = np.random.default_rng(zlib.crc32(path.name.encode())).uniform(0.5, 1.0, 3)
    triangles = box(shape * SIZE / scale)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix.lower() == ".obj":
        corners = [corner for triangle in triangles for corner in triangle]
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in (map(float, c) for c in corners)]
        lines += [f"f {i + 1} {i + 2} {i + 3}" for i in range(0, len(corners), 3)]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return
    data = b"\0" * 80 + struct.pack("<I", len(triangles))
    for triangle in triangles:
        data += struct.pack("<12fH", 0, 0, 0, *np.concatenate(triangle), 0)
    path.write_bytes(data)


def stand_in(folder: Path) -> None:
    """Put boxes where the folder's files name meshes that are missing."""
    for file in folder.glob("*.xml"):
        text = re.sub(r"<!--.*?-->", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
        compiler = re.search(r'(?:meshdir|assetdir)="([^"]*)"', text)
        default = re.search(r'<default.*?<mesh[^>]*\bscale="([\d.e-]+)', text, re.DOTALL)
        for mesh in re.findall(r"<mesh\b[^>]*>", text):
            name = re.search(r'\bfile="([^"]*)"', mesh)
            if not name:
                continue
            scale = re.search(r'\bscale="([\d.e-]+)', mesh) or default
            path = folder / (compiler[1] if compiler else "") / name[1]
            if not path.exists():
                write_mesh(path, float(scale[1]) if scale else 1.0)


def without_base(spec: Any) -> None:
    """Take free joints and keyframes out."""
    for body in spec.bodies:
        for joint in list(body.joints):
            if joint.type == mujoco.mjtJoint.mjJNT_FREE:
                spec.delete(joint)
    for key in list(spec.keys):
        spec.delete(key)


def ranges(links: list[dict[str, Any]]) -> list[Range]:
    """Ranges of the moving joints of a model's JSON; without a limit: nothing."""
    out: list[Range] = []
    for link in links:
        joint = link.get("joint") or {"type": "fixed"}
        if joint["type"] not in ("fixed", "floating"):
            limits = joint.get("limits") or {}
            ends = [limits[k] for k in ("lower", "upper") if limits.get(k) is not None]
            out.append(tuple(np.round(ends, 12)))
    return out


class Theirs:
    """MuJoCo's dynamics of the bare tree."""

    def __init__(self, path: Path, fix_base: bool) -> None:
        spec = mujoco.MjSpec.from_file(str(path))
        for material in spec.materials:
            material.textures = [""] * len(material.textures)
        for looks in [*spec.textures, *spec.skins]:
            spec.delete(looks)
        if fix_base:
            without_base(spec)
        self.model = m = spec.compile()
        flags = mujoco.mjtDisableBit
        for flag in ("CONSTRAINT", "ACTUATION", "SPRING", "DAMPER"):
            m.opt.disableflags |= int(getattr(flags, f"mjDSBL_{flag}"))
        m.opt.density = m.opt.viscosity = 0.0
        m.body_gravcomp[:] = 0.0
        self.data = mujoco.MjData(m)
        # A free joint comes first, and what it has of its own is left out.
        self.floats = m.njnt > 0 and m.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
        if self.floats:
            m.dof_armature[:6] = 0.0
        self.first = int(self.floats)  # joint of one degree of freedom
        joints = range(self.first, m.njnt)
        self.names = [m.joint(j).name or f"joint{j}" for j in joints]
        self.couplings: tuple[Array, Array] = (np.eye(len(joints)), np.zeros(len(joints)))
        self.locked: list[int] = []

    def couple(self, ours: diffnea.Model) -> None:
        """Move as our model does: q = G y + g0, of joints that follow others or are locked."""
        m = self.model
        if self.floats != (ours.free_base is not None):
            raise ValueError("one of the two floats")
        n = len(self.names)
        mixing, offset = np.zeros((n, ours.num_joints)), np.zeros(n)
        for j, name in enumerate(self.names):
            if name in ours.joint_names:
                mixing[j, ours.joint_names.index(name)] = 1.0
            elif name in ours.followers:
                follower = ours.followers[name]
                mixing[j, ours.joint_names.index(follower["joint"])] = follower["ratio"]
                offset[j] = follower["offset"]
            else:
                self.locked.append(j)
        for e in range(m.neq):
            j = m.eq_obj1id[e] - self.first
            if m.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT and j in self.locked:
                offset[j] = m.qpos0[m.jnt_qposadr[m.eq_obj1id[e]]] + m.eq_data[e, 0]
        self.couplings = mixing, offset

    def ranges(self) -> list[Range]:
        m = self.model
        return [
            tuple(np.round(m.jnt_range[j], 12)) if m.jnt_limited[j] else ()
            for j in range(self.first, m.njnt)
            if j - self.first not in self.locked
        ]

    def set(self, y: Array, yd: Array) -> None:
        """Take a state of ours, and find T: MuJoCo's velocities are T times ours."""
        mixing, offset = self.couplings
        base_q, base_v = (7, 6) if self.floats else (0, 0)
        self.T = np.zeros((self.model.nv, base_v + mixing.shape[1]))
        self.T[base_v:, base_v:] = mixing
        self.data.qpos[base_q:] = mixing @ y[base_q:] + offset
        self.bias = np.zeros(self.model.nv)  # accelerations are T times ours and this
        if self.floats:
            self.data.qpos[:7] = y[[0, 1, 2, 6, 3, 4, 5]]
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, self.data.qpos[3:7])
            self.T[:3, 3:6] = turn.reshape(3, 3)
            self.T[3:6, :3] = np.eye(3)
            self.bias[:3] = turn.reshape(3, 3) @ np.cross(yd[:3], yd[3:6])
        self.data.qvel[:] = self.T @ yd

    def rnea(self, q: Array, qd: Array, qdd: Array) -> Array:
        self.set(q, qd)
        self.data.qacc[:] = self.T @ qdd + self.bias
        mujoco.mj_inverse(self.model, self.data)
        return np.asarray(self.T.T @ self.data.qfrc_inverse)

    def mass_matrix(self, q: Array) -> Array:
        self.set(q, np.zeros(len(q) - int(self.floats)))
        mujoco.mj_forward(self.model, self.data)
        out = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, out)
        return np.asarray(self.T.T @ out @ self.T)

    def aba(self, q: Array, qd: Array, tau: Array) -> Array:
        if len(qd) < self.model.nv:
            return np.linalg.solve(self.mass_matrix(q), tau - self.rnea(q, qd, 0 * qd))
        self.set(q, qd)
        self.data.qfrc_applied[:] = np.linalg.solve(self.T.T, tau)
        mujoco.mj_forward(self.model, self.data)
        return np.linalg.solve(self.T, self.data.qacc - self.bias)


def relative(ours: Array, theirs: Array) -> float:
    return float(np.max(np.abs(ours - theirs)) / np.max(np.abs(theirs)))


def largest_differences(ours: diffnea.Model, theirs: Theirs) -> dict[str, float]:
    rng = np.random.default_rng(0)
    worst: Counter[str] = Counter()
    n = ours.num_velocities
    open_tree = diffnea.Model.from_dict(
        {key: value for key, value in ours.to_dict().items() if key != "constraints"}
    )
    for _ in range(STATES):
        q = rng.uniform(-2, 2, ours.num_positions)
        if ours.free_base is not None:
            q[3:7] /= np.linalg.norm(q[3:7])
        qd, qdd, tau = (rng.uniform(-s, s, n) for s in (3, 10, 10))
        pairs = {
            "rnea": (diffnea.rnea(ours, q=q, qd=qd, qdd=qdd), theirs.rnea(q, qd, qdd)),
            "M": (diffnea.mass_matrix(ours, q=q), theirs.mass_matrix(q)),
            "aba": (diffnea.aba(open_tree, q=q, qd=qd, tau=tau), theirs.aba(q, qd, tau)),
        }
        for name, pair in pairs.items():
            worst[name] = max(worst[name], relative(*pair))
    return dict(worst)


@dataclass
class Robot:
    name: str
    way: tuple[str, ...] = ()
    read: bool = False
    reason: str = ""  # why it was not read, or not compared
    dofs: int = 0  # of the joints
    floats: bool = False
    ranges: bool = True  # equal to MuJoCo's
    differences: dict[str, float] | None = None


def study(program: Path, file: Path, bench: Path, fix_base: bool) -> Robot:
    out = Robot(f"{file.parent.name}/{file.name}")
    exported = bench / "robot.json"
    for more in WAYS:
        way = (*(["--fix-base"] if fix_base else []), *more)
        done = subprocess.run(
            [program, "export", file, *way, "-o", exported, "--quiet"],
            capture_output=True,
            text=True,
        )
        out.way = more
        if done.returncode == 0:
            out.reason = ""
            break
        out.reason = done.stderr.strip().replace(f"{file}: ", "").removeprefix("error: ")
    else:
        return out
    ours = diffnea.load_model(exported)
    out.read, out.dofs, out.floats = True, ours.num_joints, ours.free_base is not None
    try:
        theirs = Theirs(file, fix_base)
    except ValueError as error:
        out.reason = f"MuJoCo cannot read it: {error}".replace("\n", " ")
        return out
    if unknown := {*ours.joint_names, *ours.followers} - {*theirs.names}:
        raise ValueError(f"{file}: other joints: {unknown}, {theirs.names}")
    theirs.couple(ours)
    limits = json.loads(exported.read_text(encoding="utf-8"))["links"]
    out.ranges = ranges(limits) == theirs.ranges()
    if ours.num_velocities:
        out.differences = largest_differences(ours, theirs)
    return out


def show(robot: Robot) -> None:
    if robot.differences is not None:
        text = "  ".join(f"{name} {x:.0e}" for name, x in robot.differences.items())
        text += "" if robot.ranges else "  OTHER RANGES"
    else:
        text = robot.reason or "no joints"
    way = " ".join(robot.way) if robot.read else "refused"
    dofs = f"6+{robot.dofs}" if robot.floats else f"{robot.dofs}"
    print(f"{robot.name:<46} {dofs:>5} {way:<12} {text}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("program", type=Path, help="the command diffnea")
    parser.add_argument("robots", nargs="*", metavar="ROBOT", help="folders; all")
    parser.add_argument("--corpus", type=Path, default=CORPUS / "menagerie_xml")
    parser.add_argument("--no-meshes", action="store_true", help="no boxes for missing meshes")
    parser.add_argument("--fix-base", action="store_true", help="bases that float are fixed")
    args = parser.parse_intermixed_args()
    if not args.corpus.is_dir():
        print(f"no public robots at {args.corpus}; --corpus or DIFFNEA_CORPUS may name them")
        return
    robots = []
    with tempfile.TemporaryDirectory() as name:
        bench = Path(name)
        for folder in sorted(p for p in args.corpus.iterdir() if p.is_dir()):
            if args.robots and folder.name not in args.robots:
                continue
            copy = bench / folder.name
            shutil.copytree(folder, copy)
            if not args.no_meshes:
                stand_in(copy)
            for file in sorted(copy.glob("*.xml")):
                if not NO_ROBOT.match(file.name):
                    robots.append(study(args.program.resolve(), file, bench, args.fix_base))
                    show(robots[-1])
    print_summary(robots)


def print_summary(robots: list[Robot]) -> None:
    floating = sum(r.floats for r in robots)
    print(f"\nmujoco {mujoco.__version__}, {len(robots)} files, {floating} on a free base")
    folders = {r.name.split("/")[0] for r in robots}
    for k, way in enumerate(WAYS):
        read = [r for r in robots if r.read and r.way in WAYS[: k + 1]]
        inside = {r.name.split("/")[0] for r in read}
        print(
            f"{' '.join(way) or 'as it is':<28} {len(read):3} files, {len(inside)} of {len(folders)} folders"
        )
    for name in ("rnea", "M", "aba"):
        compared = [(r.differences[name], r.name) for r in robots if r.differences]
        if compared:
            print(
                f"{name}: at most {max(compared)[0]:.1e} ({max(compared)[1]}), {len(compared)} robots"
            )


if __name__ == "__main__":
    main()
