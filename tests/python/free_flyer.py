"""A robot in free flight by conservation of momentum: no recursion, no code of the library.

Bodies are points and gyros in the world. The joints move as they are told, the centre of mass falls,
and the angular momentum about it stays: a first-order equation for the trunk's rotation. A joint's
torque is the change of momentum of what it carries, by differences in time (d'Alembert).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

GRAVITY = np.array([0.0, 0.0, -9.81])
STEP = 1e-3  # [s] of the integration (Runge, Kutta) and of the differences
EVERY = 4  # rows of the integration to one that is logged


def cross(v: np.ndarray) -> np.ndarray:
    """Return [v], (…, 3, 3)."""
    out = np.zeros((*v.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return out - np.swapaxes(out, -1, -2)


def turn(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotate about a unit axis (Rodrigues), (…, 3, 3)."""
    c = cross(axis)
    s, k = np.sin(angle)[..., None, None], (1 - np.cos(angle))[..., None, None]
    return np.eye(3) + s * c + k * (c @ c)


def to_quaternion(rotations: np.ndarray) -> np.ndarray:
    """Return x y z w, (N, 4), with the sign that each matrix alone gives: it jumps."""
    out = np.empty((len(rotations), 4))
    for k, r in enumerate(rotations):
        square = np.array(
            [
                1 + r[0, 0] - r[1, 1] - r[2, 2],
                1 - r[0, 0] + r[1, 1] - r[2, 2],
                1 - r[0, 0] - r[1, 1] + r[2, 2],
                1 + r[0, 0] + r[1, 1] + r[2, 2],
            ]
        )
        i = int(np.argmax(square))
        rows = np.array(
            [
                [square[0], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]],
                [r[0, 1] + r[1, 0], square[1], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]],
                [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], square[2], r[1, 0] - r[0, 1]],
                [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], square[3]],
            ]
        )
        out[k] = rows[i] / (2 * np.sqrt(square[i]))
    return out


def slope(x: np.ndarray, step: float) -> np.ndarray:
    """Differentiate in time; NaN in three rows at either end. Off by h⁶/140 of x's seventh."""
    d = x[6:] - x[:-6] - 9 * (x[5:-1] - x[1:-5]) + 45 * (x[4:-2] - x[2:-4])
    ends = np.full_like(x[:3], np.nan)
    return np.concatenate([ends, d / (60 * step), ends])


@dataclass(frozen=True)
class Body:
    """A link: where its joint is on its parent, about which axis it turns, and its inertia."""

    name: str
    parent: int  # −1: the trunk, which has none
    place: tuple[float, float, float] = (0, 0, 0)  # [m] in the parent
    axis: tuple[float, float, float] = (0, 0, 1)
    mass: float = 1.0  # [kg]
    com: tuple[float, float, float] = (0, 0, 0)  # [m] in the link
    # Ixx Ixy Ixz Iyy Iyz Izz about the centre of mass [kg·m²]
    inertia: tuple[float, float, float, float, float, float] = (0.01, 0, 0, 0.01, 0, 0.01)

    def tensor(self) -> np.ndarray:
        """Return the inertia about the centre of mass, (3, 3)."""
        xx, xy, xz, yy, yz, zz = self.inertia
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def urdf(self) -> str:
        """Return the link as a URDF has it."""
        names = dict(zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), self.inertia, strict=True))
        moments = " ".join(f'{k}="{v}"' for k, v in names.items())
        at = " ".join(map(str, self.com))
        return (
            f'<link name="{self.name}"><inertial><origin xyz="{at}"/><mass value="{self.mass}"/>'
            f"<inertia {moments}/></inertial></link>"
        )


@dataclass(frozen=True)
class Flyer:
    """A trunk and what hangs on it."""

    bodies: tuple[Body, ...]
    carried: tuple[np.ndarray, ...] = field(init=False)

    def __post_init__(self) -> None:
        n = len(self.bodies)
        carried = []
        for j in range(1, n):
            inside = np.zeros(n, bool)
            inside[j] = True
            for i in range(j + 1, n):
                inside[i] = inside[self.bodies[i].parent]
            carried.append(inside)
        object.__setattr__(self, "carried", tuple(carried))

    @property
    def joints(self) -> list[str]:
        """Return the names of the joints, in order."""
        return [f"j_{b.name}" for b in self.bodies[1:]]

    def urdf(self) -> str:
        """Return the description, the trunk as its root."""
        joints = "".join(
            f'<joint name="j_{b.name}" type="continuous">'
            f'<parent link="{self.bodies[b.parent].name}"/><child link="{b.name}"/>'
            f'<origin xyz="{" ".join(map(str, b.place))}"/>'
            f'<axis xyz="{" ".join(map(str, b.axis))}"/></joint>'
            for b in self.bodies[1:]
        )
        return f'<robot name="flyer">{"".join(b.urdf() for b in self.bodies)}{joints}</robot>'

    def parameters(self) -> dict[str, float]:
        """Return the ten inertial parameters of every link by name."""
        out = {}
        for b in self.bodies:
            com = np.array(b.com)
            about = b.tensor() + b.mass * (com @ com * np.eye(3) - np.outer(com, com))
            names = ("mass", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
            values = (b.mass, *(b.mass * com), *about[np.triu_indices(3)])
            out |= {f"{b.name}.{n}": float(v) for n, v in zip(names, values, strict=True)}
        return out

    def in_trunk(self, q: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return origins, rotations and centres of mass of all bodies in the trunk, (…, n, 3)."""
        n, shape = len(self.bodies), q.shape[:-1]
        p, r = np.zeros((*shape, n, 3)), np.zeros((*shape, n, 3, 3))
        r[..., 0, :, :] = np.eye(3)
        for i, b in enumerate(self.bodies[1:], start=1):
            p[..., i, :] = p[..., b.parent, :] + r[..., b.parent, :, :] @ np.array(b.place)
            turned = turn(np.array(b.axis, float), q[..., i - 1])
            r[..., i, :, :] = r[..., b.parent, :, :] @ turned
        com = np.array([b.com for b in self.bodies])
        return p, r, p + (r @ com[..., None])[..., 0]

    def momentum(self, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the inertia about the centre of mass, and the angular momentum of the joints.

        Both about the centre of mass, in the trunk's axes: what turns if the trunk does, and what
        the joints have if it does not.
        """
        p, r, c = self.in_trunk(q)
        mass = np.array([b.mass for b in self.bodies])
        tensor = r @ np.array([b.tensor() for b in self.bodies]) @ np.swapaxes(r, -1, -2)
        turning, speed = np.zeros_like(p), np.zeros_like(p)
        for j, inside in enumerate(self.carried):
            b = self.bodies[j + 1]
            about = (r[..., j + 1, :, :] @ np.array(b.axis, float)) * qd[..., j, None]
            turning[..., inside, :] += about[..., None, :]
            arm = c[..., inside, :] - p[..., j + 1, None, :]
            speed[..., inside, :] += np.cross(about[..., None, :], arm)
        centre = np.einsum("i,...ij->...j", mass, c) / mass.sum()
        arm = c - centre[..., None, :]
        square = np.einsum("...ij,...ij->...i", arm, arm)[..., None, None] * np.eye(3)
        inertia = (
            tensor + mass[:, None, None] * (square - arm[..., :, None] * arm[..., None, :])
        ).sum(axis=-3)
        own = (tensor @ turning[..., None])[..., 0] + np.cross(arm, mass[:, None] * speed)
        return inertia, own.sum(axis=-2)

    def fly(
        self, q: np.ndarray, qd: np.ndarray, spin: np.ndarray, throw: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Fly with the joints on a path, sampled at half of STEP.

        Args:
            q, qd: (2 N − 1, n) the path [rad, rad/s].
            spin: (3,) angular momentum about the centre of mass, in the world [kg·m²/s].
            throw: (3,) velocity of the centre of mass at the start [m/s].

        Returns:
            Every EVERY-th row of what was flown, without six steps at either end: time, q, base (x
            y z qx qy qz qw), tau, and twist, the trunk's [ω; v] in its axes.

        """
        inertia, own = self.momentum(q, qd)

        def rate(k: int, r: np.ndarray) -> np.ndarray:
            return np.asarray(r @ cross(np.linalg.solve(inertia[k], r.T @ spin - own[k])))

        rows = (len(q) + 1) // 2
        turned = np.empty((rows, 3, 3))
        turned[0] = np.eye(3)
        for k in range(rows - 1):
            a = turned[k]
            k1 = rate(2 * k, a)
            k2 = rate(2 * k + 1, a + 0.5 * STEP * k1)
            k3 = rate(2 * k + 1, a + 0.5 * STEP * k2)
            k4 = rate(2 * k + 2, a + STEP * k3)
            u, _, v = np.linalg.svd(a + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
            turned[k + 1] = u @ v
        time = STEP * np.arange(rows)
        p, r, c = self.in_trunk(q[::2])
        mass = np.array([b.mass for b in self.bodies])
        centre = np.einsum("i,kij->kj", mass, c) / mass.sum()
        falls = throw * time[:, None] + 0.5 * GRAVITY * time[:, None] ** 2
        trunk = falls - (turned @ centre[..., None])[..., 0]
        world = {
            "p": trunk[:, None] + (turned[:, None] @ p[..., None])[..., 0],
            "c": trunk[:, None] + (turned[:, None] @ c[..., None])[..., 0],
            "r": turned[:, None] @ r,
        }
        turning = np.linalg.solve(
            inertia[::2], (np.swapaxes(turned, 1, 2) @ spin - own[::2])[..., None]
        )[..., 0]
        return self._logged(time, q[::2], world, turned, trunk, turning)

    def _logged(
        self,
        time: np.ndarray,
        q: np.ndarray,
        world: dict[str, np.ndarray],
        turned: np.ndarray,
        trunk: np.ndarray,
        turning: np.ndarray,
    ) -> dict[str, np.ndarray]:
        """Torques by differences of the bodies' momenta in time."""
        mass = np.array([b.mass for b in self.bodies])
        r = world["r"]
        skew = slope(r, STEP) @ np.swapaxes(r, -1, -2)
        omega = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
        tensor = r @ np.array([b.tensor() for b in self.bodies]) @ np.swapaxes(r, -1, -2)
        gyro = slope((tensor @ omega[..., None])[..., 0], STEP)
        push = mass[:, None] * (slope(slope(world["c"], STEP), STEP) - GRAVITY)
        tau = np.empty_like(q)
        for j, inside in enumerate(self.carried):
            arm = world["c"][:, inside] - world["p"][:, j + 1, None]
            moment = (np.cross(arm, push[:, inside]) + gyro[:, inside]).sum(axis=1)
            axis = r[:, j + 1] @ np.array(self.bodies[j + 1].axis, float)
            tau[:, j] = np.einsum("ki,ki->k", axis, moment)
        speed = np.einsum("kji,kj->ki", turned, slope(trunk, STEP))
        keep = slice(6, len(time) - 6, EVERY)
        return {
            "time": time[keep] - time[keep][0],
            "q": q[keep],
            "base": np.hstack([trunk[keep], to_quaternion(turned[keep])]),
            "tau": tau[keep],
            "twist": np.hstack([turning, speed])[keep],
        }


def quadruped() -> Flyer:
    """Four legs of two joints each, which no plane holds, all of different inertia."""
    bodies = [
        Body("trunk", -1, mass=6.0, com=(0.02, -0.01, 0.03),
             inertia=(0.09, 0.004, -0.003, 0.16, 0.002, 0.2)),
    ]  # fmt: skip
    for k, (x, y) in enumerate(((0.2, 0.12), (0.2, -0.12), (-0.2, 0.12), (-0.2, -0.12))):
        scale = 1 + 0.1 * k
        bodies.append(
            Body(f"hip{k}", 0, (x, y, 0), (1, 0, 0), 0.9 * scale, (0.03, 0.02, -0.09),
                 tuple(scale * np.array([0.006, 0.0003, -0.0002, 0.005, 0.0004, 0.002])))
        )  # fmt: skip
        bodies.append(
            Body(f"knee{k}", len(bodies) - 1, (0.02, 0.03, -0.2), (0, 1, 0), 0.5 * scale,
                 (-0.02, 0.01, -0.1),
                 tuple(scale * np.array([0.003, -0.0001, 0.0002, 0.003, 0.0002, 0.0006])))
        )  # fmt: skip
    return Flyer(tuple(bodies))


def carried_body(body: Body, seed: int, seconds: float = 10.0) -> dict[str, np.ndarray]:
    """Move one body on a path of its own by a wrench from outside: a drone by its thrust.

    Returns:
        time, base (x y z qx qy qz qw), twist, and wrench, [τ; f] about the body's origin in its
        axes (Newton, Euler).

    """
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(int(seconds / STEP) + 13)
    path = np.zeros((len(t), 6))
    for k in range(6):
        for _ in range(4):
            w = 2 * np.pi * rng.uniform(0.2, 1.5)
            path[:, k] += rng.normal() * 0.4 / w * np.sin(w * t + rng.uniform(0, 6))
    r = np.broadcast_to(np.eye(3), (len(t), 3, 3))
    for axis, angle in zip(np.eye(3), path[:, 3:].T, strict=True):
        r = r @ turn(axis, 2 * angle)
    skew = slope(r, STEP) @ np.swapaxes(r, -1, -2)
    omega = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)
    arm = (r @ np.array(body.com)[:, None])[..., 0]
    tensor = r @ body.tensor() @ np.swapaxes(r, -1, -2)
    push = body.mass * (slope(slope(path[:, :3] + arm, STEP), STEP) - GRAVITY)
    moment = slope((tensor @ omega[..., None])[..., 0], STEP) + np.cross(arm, push)

    def own(x: np.ndarray) -> np.ndarray:
        return np.asarray(np.einsum("kji,kj->ki", r, x))

    keep = slice(6, len(t) - 6, EVERY)
    return {
        "time": t[keep] - t[keep][0],
        "base": np.hstack([path[keep, :3], to_quaternion(r[keep])]),
        "twist": np.hstack([own(omega), own(slope(path[:, :3], STEP))])[keep],
        "wrench": np.hstack([own(moment), own(push)])[keep],
    }
