"""The Whipple bicycle by Kane's equations: nothing of the library is used.

Coordinates are x, y, z of the frame's origin, yaw, lean and pitch of the frame (about z, x, y in
turn), steer, and the angles of front and rear wheel. Knife-edge wheels roll on z = 0 without slip:
six equations on nine rates, of which lean, steer and rear wheel are left. Partial velocities are
geometry; their rates along a motion are central differences. Many rides are computed at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from free_flyer import GRAVITY, Body, cross, to_quaternion, turn

X, Y, Z = np.eye(3)
LEAN, STEER, FRONT, REAR = 4, 6, 7, 8
FREE = [LEAN, STEER, REAR]
BOUND = [0, 1, 2, 3, 5, FRONT]
REAR_RADIUS, FRONT_RADIUS = 0.3, 0.35
WHEELBASE, TRAIL, TILT = 1.02, 0.08, np.pi / 10


@dataclass(frozen=True)
class Bicycle:
    """Frame with its rider, handlebar, front and rear wheel: the published benchmark.

    Meijaard, Papadopoulos, Ruina, Schwab 2007, Table 1, whose z points down.
    """

    frame: Body = Body("frame", -1, mass=85, com=(0.3, 0, 0.9), inertia=(9.2, 0, -2.4, 11, 0, 2.8))
    bar: Body = Body("bar", 0, (WHEELBASE + TRAIL, 0, 0), (-np.sin(TILT), 0, np.cos(TILT)), mass=4,
                     com=(0.9 - WHEELBASE - TRAIL, 0, 0.7),
                     inertia=(0.05892, 0, 0.00756, 0.06, 0, 0.00708))  # fmt: skip
    front: Body = Body("front", 1, (-TRAIL, 0, FRONT_RADIUS), (0, 1, 0), mass=3,
                       inertia=(0.1405, 0, 0, 0.28, 0, 0.1405))  # fmt: skip
    rear: Body = Body("rear", 0, (0, 0, REAR_RADIUS), (0, 1, 0), mass=2,
                      inertia=(0.0603, 0, 0, 0.12, 0, 0.0603))  # fmt: skip

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Return all bodies, in order."""
        return self.frame, self.bar, self.front, self.rear

    def poses(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rotations (B, 4, 3, 3), origins and centres of mass (B, 4, 3) in the world."""
        shape = q.shape[:-1]
        r, p = np.empty((*shape, 4, 3, 3)), np.empty((*shape, 4, 3))
        r[..., 0, :, :] = turn(Z, q[..., 3]) @ turn(X, q[..., LEAN]) @ turn(Y, q[..., 5])
        p[..., 0, :] = q[..., :3]
        for i, (angle, axis) in enumerate(
            ((q[..., STEER], np.array(self.bar.axis)), (q[..., FRONT], Y), (q[..., REAR], Y)), start=1
        ):
            b = self.bodies[i]
            p[..., i, :] = p[..., b.parent, :] + r[..., b.parent, :, :] @ np.array(b.place)
            r[..., i, :, :] = r[..., b.parent, :, :] @ turn(axis, angle)
        com = np.array([b.com for b in self.bodies], float)
        return r, p, p + (r @ com[..., None])[..., 0]

    def partials(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return ∂ω/∂rate and ∂v/∂rate of the centres of mass (B, 4, 3, 9), and of the contacts.

        The last is (B, 6, 9): what rolling sets to zero.
        """
        r, p, c = self.poses(q)
        shape = q.shape[:-1]
        yawed = turn(Z, q[..., 3])
        leaned = yawed @ turn(X, q[..., LEAN])
        lines = np.zeros((*shape, 9, 3))  # axes of the turns
        lines[..., 3, :], lines[..., LEAN, :], lines[..., 5, :] = Z, yawed @ X, leaned @ Y
        lines[..., STEER, :] = r[..., 0, :, :] @ np.array(self.bar.axis)
        lines[..., FRONT, :], lines[..., REAR, :] = r[..., 1, :, :] @ Y, r[..., 0, :, :] @ Y
        turns = {0: (3, 4, 5), 1: (3, 4, 5, STEER), 2: (3, 4, 5, STEER, FRONT), 3: (3, 4, 5, REAR)}
        through = {3: 0, 4: 0, 5: 0, STEER: 1, FRONT: 2, REAR: 3}  # origin that the axis meets
        w, v = np.zeros((2, *shape, 4, 3, 9))
        for i, moved in turns.items():
            v[..., i, :, :3] = np.eye(3)
            for k in moved:
                w[..., i, :, k] = lines[..., k, :]
                arm = c[..., i, :] - p[..., through[k], :]
                v[..., i, :, k] = np.cross(lines[..., k, :], arm)
        touch = np.empty((*shape, 6, 9))
        for row, (i, radius) in enumerate(((3, REAR_RADIUS), (2, FRONT_RADIUS))):
            axle = r[..., i, :, :] @ Y  # the wheels' centres are their centres of mass
            down = -Z + axle * axle[..., 2:]
            lowest = radius * down / np.linalg.norm(down, axis=-1, keepdims=True)
            at = v[..., i, :, :] - cross(lowest) @ w[..., i, :, :]
            touch[..., 3 * row : 3 * row + 3, :] = at
        return w, v, touch

    def heights(self, q: np.ndarray) -> np.ndarray:
        """Return how far the lowest points of rear and front wheel are above the ground, (B, 2)."""
        r, p, _ = self.poses(q)
        out = [
            p[..., i, 2] - radius * np.hypot((r[..., i, :, :] @ Y)[..., 0], (r[..., i, :, :] @ Y)[..., 1])
            for i, radius in ((3, REAR_RADIUS), (2, FRONT_RADIUS))
        ]
        return np.stack(out, axis=-1)

    def put_down(self, q: np.ndarray) -> np.ndarray:
        """Move height and pitch until both wheels touch (Newton)."""
        q = q.copy()
        for _ in range(6):
            h, d = self.heights(q), 1e-6
            slope = np.empty((*q.shape[:-1], 2, 2))
            for k, c in enumerate((2, 5)):
                moved = q.copy()
                moved[..., c] += d
                slope[..., k] = (self.heights(moved) - h) / d
            step = np.linalg.solve(slope, h[..., None])[..., 0]
            q[..., 2] -= step[..., 0]
            q[..., 5] -= step[..., 1]
        return q

    def rates(self, q: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return all nine rates of lean, steer and rear wheel, and their columns N (B, 9, 3)."""
        touch = self.partials(q)[2]
        n = np.zeros((*q.shape[:-1], 9, 3))
        n[..., FREE, :] = np.eye(3)
        n[..., BOUND, :] = -np.linalg.solve(touch[..., BOUND], touch[..., FREE])
        return (n @ u[..., None])[..., 0], n

    def acceleration(self, q: np.ndarray, u: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Solve Kane's equations for the rates of u; torques of steering and rear wheel (B, 2)."""
        qd, n = self.rates(q, u)
        r = self.poses(q)[0]
        w, v, _ = self.partials(q)
        h = 1e-5  # rates of partial velocities along the motion, off by h² and by rounding over h
        ends = []
        for sign in (1, -1):
            at = q + sign * h * qd
            speed = self.rates(at, u)[0][..., None, :, None]
            wa, va, _ = self.partials(at)
            ends.append(((wa @ speed)[..., 0], (va @ speed)[..., 0]))
        alpha = (ends[0][0] - ends[1][0]) / (2 * h)
        a = (ends[0][1] - ends[1][1]) / (2 * h) - GRAVITY
        mass = np.array([b.mass for b in self.bodies])[:, None, None]
        tensor = r @ np.array([b.tensor() for b in self.bodies]) @ np.swapaxes(r, -1, -2)
        omega = w @ qd[..., None, :, None]
        gyro = tensor @ alpha[..., None] + np.cross(omega, tensor @ omega, axis=-2)
        wn, vn = w @ n[..., None, :, :], v @ n[..., None, :, :]
        left = (np.swapaxes(vn, -1, -2) @ (mass * vn) + np.swapaxes(wn, -1, -2) @ tensor @ wn).sum(-3)
        right = (np.swapaxes(vn, -1, -2) @ (mass * a[..., None]) + np.swapaxes(wn, -1, -2) @ gyro).sum(-3)
        force = np.einsum("bki,bk->bi", n[..., [STEER, REAR], :], torque)
        return np.linalg.solve(left, (force - right[..., 0])[..., None])[..., 0]

    def ride(
        self, speed: np.ndarray, push: np.ndarray, step: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Ride from upright; the rider steers into a lean, keeps the speed, and pushes besides.

        Args:
            speed: (B,) at the start, and to be kept [m/s].
            push: (2 N − 1, B, 2) of steering and rear wheel at half steps [N·m].
            step: [s] of Runge and Kutta.

        Returns:
            q (N, B, 9), and the torques of steering and rear wheel (N, B, 2).

        """

        def rider(q: np.ndarray, u: np.ndarray, push: np.ndarray) -> np.ndarray:
            steers = -4.0 * q[:, LEAN] - 8.0 * u[:, 0]
            pedals = -8.0 * (u[:, 2] - speed / REAR_RADIUS)
            return push + np.stack([steers, pedals], axis=-1)

        q = np.zeros((len(speed), 9))
        u = np.zeros((len(speed), 3))
        u[:, 2] = speed / REAR_RADIUS
        qs, torques = [], []
        for k in range((len(push) + 1) // 2):
            qs.append(q)
            torques.append(rider(q, u, push[2 * k]))
            if 2 * k + 2 >= len(push):
                break

            def slope(x: np.ndarray, s: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
                return self.rates(x, s)[0], self.acceleration(x, s, rider(x, s, f))

            now, half, end = push[2 * k : 2 * k + 3]
            q1, u1 = slope(q, u, now)
            q2, u2 = slope(q + 0.5 * step * q1, u + 0.5 * step * u1, half)
            q3, u3 = slope(q + 0.5 * step * q2, u + 0.5 * step * u2, half)
            q4, u4 = slope(q + step * q3, u + step * u3, end)
            q = self.put_down(q + step / 6 * (q1 + 2 * q2 + 2 * q3 + q4))
            u = u + step / 6 * (u1 + 2 * u2 + 2 * u3 + u4)
        return np.array(qs), np.array(torques)

    def frame_poses(self, q: np.ndarray) -> np.ndarray:
        """Return x y z qx qy qz qw of the frame, (N, 7)."""
        r, p, _ = self.poses(q)
        return np.hstack([p[:, 0], to_quaternion(r[:, 0])])
