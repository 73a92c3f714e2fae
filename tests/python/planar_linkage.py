"""Planar linkages by Lagrange's equation in their driven angles: nothing of the library is used.

The plane is x, z; angles are those of joints about y, so that a bar at angle a points along
(cos a, −sin a). Two chains of two bars meet in a pin: of a four-bar the second chain is one bar.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

GRAVITY = 9.81


@dataclass(frozen=True)
class Bar:
    """A bar of a linkage: length [m], mass [kg], centre of mass along and across it [m]."""

    length: float
    mass: float
    along: float
    across: float
    inertia: float  # about the centre of mass and y [kg·m²]


def direction(angle: np.ndarray) -> np.ndarray:
    """Unit vectors (…, 2) of bars in the plane x, z."""
    return np.stack([np.cos(angle), -np.sin(angle)], -1)


def normal(angle: np.ndarray) -> np.ndarray:
    """Unit vectors (…, 2) of the bars' z axes."""
    return np.stack([np.sin(angle), np.cos(angle)], -1)


def meet(a: np.ndarray, b: np.ndarray, from_a: float, from_b: float) -> np.ndarray:
    """Points (…, 2) at these distances of a and b, on the upper side of the way from a to b."""
    way = b - a
    d = np.linalg.norm(way, axis=-1, keepdims=True)
    along = (d**2 + from_a**2 - from_b**2) / (2 * d)
    height = np.sqrt(from_a**2 - along**2)
    e = way / d
    return a + along * e + height * np.stack([-e[..., 1], e[..., 0]], -1)


def angle_of(v: np.ndarray) -> np.ndarray:
    """Angle of a bar that points along v."""
    return np.arctan2(-v[..., 1], v[..., 0])


@dataclass(frozen=True)
class Linkage:
    """Bars from the ground through to the pin at (base, 0): three (one drive) or four (two)."""

    bars: tuple[Bar, ...]
    base: float

    @property
    def drives(self) -> int:
        """Return the number of driven joints, which come first."""
        return len(self.bars) - 2

    def angles(self, driven: np.ndarray) -> np.ndarray:
        """Absolute angles (…, bars) at angles (…, drives) of the driven joints."""
        bars, drives = self.bars, self.drives
        absolute = [driven[..., : i + 1].sum(-1) for i in range(drives)]
        tip = sum(bars[i].length * direction(absolute[i]) for i in range(drives))
        pin = np.zeros_like(tip)
        pin[..., 0] = self.base
        knee = meet(tip, pin, bars[-2].length, bars[-1].length)
        return np.stack([*absolute, angle_of(knee - tip), angle_of(pin - knee)], -1)

    def joints(self, driven: np.ndarray) -> np.ndarray:
        """Angles (T, bars) of all joints, without jumps in time."""
        return np.unwrap(np.diff(self.angles(driven), axis=-1, prepend=0.0), axis=0)

    def places(self, driven: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Centres of mass (…, bars, 2) and absolute angles (…, bars)."""
        absolute = self.angles(driven)
        start, out = np.zeros((*driven.shape[:-1], 2)), []
        for i, bar in enumerate(self.bars):
            a = absolute[..., i]
            out.append(start + bar.along * direction(a) + bar.across * normal(a))
            start = start + bar.length * direction(a)
        return np.stack(out, -2), absolute

    def energies(self, driven: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix (…, d, d) and potential (…) in the driven angles."""
        h, columns = 1e-5, []
        for k in range(self.drives):
            e = h * np.eye(self.drives)[k]
            (p2, a2), (p1, a1) = self.places(driven + e), self.places(driven - e)
            turn = (a2 - a1 + np.pi) % (2 * np.pi) - np.pi
            columns.append(((p2 - p1) / (2 * h), turn / (2 * h)))
        M = np.zeros((*driven.shape[:-1], self.drives, self.drives))
        for r, (p, a) in enumerate(columns):
            for c, (p_c, a_c) in enumerate(columns):
                for i, bar in enumerate(self.bars):
                    M[..., r, c] += bar.mass * (p[..., i, :] * p_c[..., i, :]).sum(-1)
                    M[..., r, c] += bar.inertia * a[..., i] * a_c[..., i]
        height = self.places(driven)[0][..., 1]
        return M, GRAVITY * (height * [bar.mass for bar in self.bars]).sum(-1)

    def torques(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        """Torques (T, drives) by Lagrange's equation, its derivatives by differences."""
        h = 1e-3
        M, _ = self.energies(q)
        dM, dV = [], []
        for k in range(self.drives):
            e = h * np.eye(self.drives)[k]
            (M2, V2), (M1, V1) = self.energies(q + e), self.energies(q - e)
            (M4, V4), (M3, V3) = self.energies(q + 2 * e), self.energies(q - 2 * e)
            dM.append((8 * (M2 - M1) - (M4 - M3)) / (12 * h))
            dV.append((8 * (V2 - V1) - (V4 - V3)) / (12 * h))
        rate = sum(dM[k] * qd[:, k, None, None] for k in range(self.drives))
        tau = np.einsum("tij,tj->ti", M, qdd) + np.einsum("tij,tj->ti", rate, qd)
        for k in range(self.drives):
            tau[:, k] += dV[k] - 0.5 * np.einsum("ti,tij,tj->t", qd, dM[k], qd)
        return tau

    def ratios(self, driven: np.ndarray) -> np.ndarray:
        """Speeds (T, drives, bars) of all joints when one drive alone has the speed 1."""
        h, out = 1e-6, []
        for k in range(self.drives):
            e = h * np.eye(self.drives)[k]
            turn = self.joints(driven + e) - self.joints(driven - e)
            out.append(((turn + np.pi) % (2 * np.pi) - np.pi) / (2 * h))
        return np.stack(out, 1)

    def friction(
        self, q: np.ndarray, qd: np.ndarray, sizes: dict[int, tuple[float, float]]
    ) -> np.ndarray:
        """Torques (T, drives) that friction of joints takes, by virtual work.

        ``sizes`` are viscous [N·m·s/rad] and dry [N·m] friction by joint, from 0.
        """
        ratio = self.ratios(q)
        speed = np.einsum("tkj,tk->tj", ratio, qd)
        torque = np.zeros_like(speed)
        for j, (viscous, dry) in sizes.items():
            torque[:, j] = viscous * speed[:, j] + dry * np.tanh(speed[:, j] / 1e-3)
        return np.einsum("tkj,tj->tk", ratio, torque)

    def moves(
        self, rng: np.random.Generator, t: np.ndarray, period: float, terms: int, reach: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, speeds and accelerations (T, drives) of random Fourier series about the middle."""
        q, qd, qdd = np.zeros((3, len(t), self.drives))
        for k in range(1, terms + 1):
            w = 2 * np.pi * k / period
            a = rng.normal(size=(2, self.drives)) / k
            s, c = np.sin(w * t)[:, None], np.cos(w * t)[:, None]
            q += a[0] * s + a[1] * c
            qd += w * (a[0] * c - a[1] * s)
            qdd -= w * w * (a[0] * s + a[1] * c)
        scale = reach / np.abs(q).max()
        return self.middle + scale * q, scale * qd, scale * qdd

    @property
    def middle(self) -> np.ndarray:
        """Angles (drives,) of the driven joints about which it moves far."""
        return np.array([-1.1] if self.drives == 1 else [-1.6, 1.2])

    def mjcf(self) -> str:
        """The linkage as an MJCF, thin out of its plane; its home is closed, as `joints` has it."""
        text = '<site name="tip" pos="{} 0 0"/>'.format(self.bars[-1].length)
        for i in reversed(range(len(self.bars))):
            b = self.bars[i]
            start = self.bars[i - 1].length if i else 0.0
            text = (
                f'<body name="bar{i + 1}" pos="{start} 0 0"><inertial pos="{b.along} 0 {b.across}" '
                f'mass="{b.mass}" diaginertia="{b.inertia / 2} {b.inertia} {b.inertia / 2}"/>'
                f'<joint name="j{i + 1}" axis="0 1 0"/>{text}</body>'
            )
        home = " ".join(map(repr, self.joints(self.middle[None])[0].tolist()))
        motors = "".join(f'<motor joint="j{i + 1}"/>' for i in range(self.drives))
        return (
            f'<mujoco model="linkage"><option gravity="0 0 -{GRAVITY}"/><worldbody>'
            f'<site name="ground" pos="{self.base} 0 0"/>{text}</worldbody><equality>'
            '<connect name="pin" site1="tip" site2="ground"/></equality>'
            f"<actuator>{motors}</actuator>"
            f'<keyframe><key name="home" qpos="{home}"/></keyframe></mujoco>'
        )


FOUR_BAR = Linkage(
    (
        Bar(0.3, 1.1, 0.14, 0.02, 0.012),
        Bar(0.8, 1.9, 0.37, -0.03, 0.11),
        Bar(0.6, 1.4, 0.28, 0.04, 0.05),
    ),
    0.9,
)
FIVE_BAR = Linkage(
    (
        Bar(0.35, 1.2, 0.15, 0.02, 0.015),
        Bar(0.6, 0.9, 0.31, -0.02, 0.03),
        Bar(0.7, 0.8, 0.33, 0.03, 0.035),
        Bar(0.4, 1.3, 0.19, 0.01, 0.02),
    ),
    0.5,
)


def described(folder: Path, linkage: Linkage) -> tuple[Path, Path]:
    """Write the truth, and a description whose masses and inertias are a quarter off."""
    bars = tuple(replace(b, mass=1.25 * b.mass, inertia=0.8 * b.inertia) for b in linkage.bars)
    paths = folder / "truth.xml", folder / "wrong.xml"
    for path, each in zip(paths, (linkage, replace(linkage, bars=bars)), strict=True):
        path.write_text(each.mjcf())
    return paths
