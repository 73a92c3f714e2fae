"""A planar arm small enough for formulas on paper, and recordings of it."""

import numpy as np
import pytest

import diffnea


class PlanarArm:
    """The arm's numbers, and its dynamics by Spong, Hutchinson, Vidyasagar 2006, eq. 7.84-7.88."""

    L1, C1, C2 = 0.5, 0.2, 0.15  # length of the first link, centres of mass [m]
    M1, M2 = 2.0, 1.0  # [kg]
    I1, I2 = 0.02, 0.01  # about the centres of mass, out of the plane [kg·m²]
    G = 9.81

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        c = np.cos(q[..., 1])
        m12 = self.M2 * (self.C2**2 + self.L1 * self.C2 * c) + self.I2
        m11 = (
            self.M1 * self.C1**2
            + self.I1
            + self.M2 * (self.L1**2 + self.C2**2 + 2 * self.L1 * self.C2 * c)
            + self.I2
        )
        m22 = np.full_like(c, self.M2 * self.C2**2 + self.I2)
        return np.stack([np.stack([m11, m12], -1), np.stack([m12, m22], -1)], -2)

    def gravity_torques(self, q: np.ndarray) -> np.ndarray:
        lower = self.M2 * self.C2 * self.G * np.cos(q[..., 0] + q[..., 1])
        upper = (self.M1 * self.C1 + self.M2 * self.L1) * self.G * np.cos(q[..., 0])
        return np.stack([upper + lower, lower], -1)

    def torques(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        h = self.M2 * self.L1 * self.C2 * np.sin(q[..., 1])
        coriolis = np.stack(
            [-h * (2 * qd[..., 0] * qd[..., 1] + qd[..., 1] ** 2), h * qd[..., 0] ** 2], -1
        )
        return (
            np.einsum("...ij,...j", self.mass_matrix(q), qdd) + coriolis + self.gravity_torques(q)
        )


@pytest.fixture(scope="session")
def formulas() -> PlanarArm:
    return PlanarArm()


def link(name: str, joint: str, mass: float, com: float, inertia: float) -> dict:
    return {
        "name": name,
        "joint": {
            "name": joint,
            "type": "revolute",
            "axis": [0, 0, 1],
            "limits": {"lower": -3, "upper": 3, "velocity": 6, "effort": 40},
        },
        "inertia": {
            "mass": mass,
            "com": [com, 0, 0],
            "about_com": [0.3 * inertia, 0, 0, inertia, 0, inertia],
        },
    }


@pytest.fixture(scope="session")
def arm(formulas: PlanarArm) -> diffnea.Model:
    """Two revolute joints about z, both links along x, gravity along −y."""
    upper = link("upper", "shoulder", formulas.M1, formulas.C1, formulas.I1)
    lower = link("lower", "elbow", formulas.M2, formulas.C2, formulas.I2) | {"parent": "upper"}
    lower["joint"]["pose"] = {"position": [formulas.L1, 0, 0]}
    return diffnea.Model.from_dict(
        {
            "schema": "diffnea/model/1",
            "name": "planar",
            "gravity": [0, -formulas.G, 0],
            "links": [upper, lower],
            "frames": [{"name": "hand", "link": "lower", "pose": {"position": [0.3, 0, 0]}}],
        }
    )


@pytest.fixture(scope="session")
def rubbing_arm(arm: diffnea.Model) -> diffnea.Model:
    return arm.with_effects(
        [
            diffnea.Effect("armature", "elbow", {"armature": 0.05}),
            diffnea.Effect("viscous_friction", "shoulder", {"viscous": 0.7}),
            diffnea.Effect("torque_offset", "elbow", {"offset": -0.3}),
        ]
    )


@pytest.fixture
def states() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, qd, qdd: (20, 2) each."""
    q, qd, qdd = np.random.default_rng(0).normal(size=(3, 20, 2))
    return q, qd, qdd


def recorded(model: diffnea.Model, seed: int) -> diffnea.Recording:
    """A noisy recording of a model as it is."""
    motion = diffnea.excite(model, duration=10, seed=seed)
    return diffnea.simulate(model, motion, noise=0.2, seed=seed).recording


@pytest.fixture(scope="session")
def train(rubbing_arm: diffnea.Model) -> diffnea.Recording:
    return recorded(rubbing_arm, 1)


@pytest.fixture(scope="session")
def held_out(rubbing_arm: diffnea.Model) -> diffnea.Recording:
    return recorded(rubbing_arm, 2)
