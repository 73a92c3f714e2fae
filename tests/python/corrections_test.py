"""What the paper prints against what is right, on random moving chains.

Each misprint of the recursions is put into an implementation of its own, in matrices; without any
it gives the library's torques and accelerations, with one it is off. docs/mathematics.md lists
what is printed, and by how much it is off (the medians of `off_by`).
"""

from collections.abc import Callable

import numpy as np
import pytest

import diffnea

CHAINS = range(20)
LINKS = 4
# Two exact recursions of torques of order 10² N·m, 10³ times rounding.
SAME = 1e-11
# A misprint that is off by less would not be one.
OFF = 1e-2


def skew(a: np.ndarray) -> np.ndarray:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def turned(axis: np.ndarray, angle: float) -> np.ndarray:
    k = skew(axis)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def from_rpy(rpy: np.ndarray) -> np.ndarray:
    x, y, z = np.eye(3)
    return turned(z, rpy[2]) @ turned(y, rpy[1]) @ turned(x, rpy[0])


class Chain:
    """A random serial arm of revolute joints, and a state of it."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.gravity = np.array([0.0, 0.0, -9.81])
        self.place = [rng.uniform(-0.3, 0.3, 3) for _ in range(LINKS)]
        self.rpy = [rng.uniform(-1.0, 1.0, 3) for _ in range(LINKS)]
        self.axis = [a / np.linalg.norm(a) for a in rng.normal(size=(LINKS, 3))]
        self.mass = rng.uniform(0.5, 3.0, LINKS)
        self.com = [rng.uniform(-0.2, 0.2, 3) for _ in range(LINKS)]
        self.moments = []
        for _ in range(LINKS):
            second = rng.uniform(1e-3, 3e-2, 3)  # of a density: J_x = L_y + L_z
            axes = from_rpy(rng.uniform(-1.0, 1.0, 3))
            self.moments.append(axes @ np.diag(second.sum() - second) @ axes.T)
        self.rotor = rng.uniform(0.01, 0.1, LINKS)
        self.q, self.qd, self.qdd = rng.uniform(-1.5, 1.5, (3, LINKS)) * [[1], [2], [5]]

    def model(self) -> diffnea.Model:
        links = []
        for i in range(LINKS):
            about_com = self.moments[i][np.triu_indices(3)].tolist()
            links.append(
                {
                    "name": f"link{i}",
                    "parent": f"link{i - 1}" if i else None,
                    "joint": {
                        "name": f"joint{i}",
                        "type": "revolute",
                        "axis": self.axis[i].tolist(),
                        "pose": {
                            "position": self.place[i].tolist(),
                            "rotation": from_rpy(self.rpy[i]).tolist(),
                        },
                    },
                    "inertia": {
                        "mass": self.mass[i],
                        "com": self.com[i].tolist(),
                        "about_com": about_com,
                    },
                }
            )
        effects = [
            {
                "effect": "armature",
                "where": f"joint{i}",
                "parameters": [{"name": "armature", "value": self.rotor[i]}],
            }
            for i in range(LINKS)
        ]
        return diffnea.Model.from_dict(
            {
                "schema": "diffnea/model/1",
                "name": "chain",
                "gravity": self.gravity.tolist(),
                "links": links,
                "effects": effects,
            }
        )


def ad(v: np.ndarray) -> np.ndarray:
    return np.block([[skew(v[:3]), np.zeros((3, 3))], [skew(v[3:]), skew(v[:3])]])


def inertia(c: Chain, i: int, misprint: str = "") -> np.ndarray:
    p = skew(c.com[i])
    sign = 1.0 if misprint == "J = R J_p R^T + m[p][p]" else -1.0
    about_origin = c.moments[i] + sign * c.mass[i] * p @ p
    return np.block([[about_origin, c.mass[i] * p], [c.mass[i] * p.T, c.mass[i] * np.eye(3)]])


def adjoints(c: Chain) -> list[np.ndarray]:
    """Ad from the parent's frame to the link's."""
    out = []
    for i in range(LINKS):
        back = (from_rpy(c.rpy[i]) @ turned(c.axis[i], c.q[i])).T  # from the parent's axes
        out.append(np.block([[back, np.zeros((3, 3))], [-back @ skew(c.place[i]), back]]))
    return out


SWAP = np.roll(np.eye(6), 3, axis=0)  # [v; ω] of [ω; v]


def coriolis(v: np.ndarray, m: np.ndarray, misprint: str = "") -> np.ndarray:
    """−ad*_v m v."""
    star = ad(v) if misprint == "ad* without the transpose" else ad(v).T
    return -star @ m @ (SWAP @ v if misprint == "v = [v, omega]" else v)


def base(c: Chain, misprint: str) -> np.ndarray:
    return np.concatenate([np.zeros(3), np.zeros(3) if misprint == "no gravity" else -c.gravity])


def axes(c: Chain) -> list[np.ndarray]:
    return [np.concatenate([a, np.zeros(3)]) for a in c.axis]


def rnea(c: Chain, misprint: str = "") -> np.ndarray:
    to_link, s = adjoints(c), axes(c)
    v, a, f = np.zeros(6), base(c, misprint), []
    for i in range(LINKS):
        v = to_link[i] @ v + s[i] * c.qd[i]
        a = to_link[i] @ a + ad(v) @ s[i] * c.qd[i] + s[i] * c.qdd[i]
        m = inertia(c, i, misprint)
        if misprint == "v = [v, omega]":
            f.append(SWAP @ (m @ (SWAP @ a) + coriolis(v, m, misprint)))
        else:
            f.append(m @ a + coriolis(v, m, misprint))
    tau = np.zeros(LINKS)
    for i in reversed(range(LINKS)):
        tau[i] = s[i] @ f[i] + c.rotor[i] * c.qdd[i]
        if i:
            there = np.linalg.inv(to_link[i]) if misprint == "f_j = Ad^T_ji f_i" else to_link[i]
            f[i - 1] = f[i - 1] + there.T @ f[i]
    return tau


def aba(c: Chain, u: np.ndarray, misprint: str = "") -> np.ndarray:
    to_link, s = adjoints(c), axes(c)
    v, eta, own = [np.zeros(6)], [], [inertia(c, i) for i in range(LINKS)]
    for i in range(LINKS):
        v.append(to_link[i] @ v[-1] + s[i] * c.qd[i])
        eta.append(ad(v[-1]) @ s[i] * c.qd[i])
    lumped, psi = [m.copy() for m in own], np.zeros(LINKS)
    beyond, bias = np.zeros((LINKS, 6)), np.zeros((LINKS, 6))
    for i in reversed(range(LINKS)):
        m = lumped[i]
        bias[i] = (
            coriolis(v[i + 1], m if misprint == "f_b = -ad* M_(i:n) v" else own[i]) + beyond[i]
        )
        rotor = 0.0 if misprint == "no rotor in Psi" else c.rotor[i]
        psi[i] = 1.0 / (s[i] @ m @ s[i] + rotor)
        if i:
            pi = m - psi[i] * np.outer(m @ s[i], m @ s[i])
            beta = m @ (eta[i] + s[i] * psi[i] * (u[i] - s[i] @ (m @ eta[i] + bias[i])))
            lumped[i - 1] = lumped[i - 1] + to_link[i].T @ pi @ to_link[i]
            beyond[i - 1] = to_link[i].T @ (bias[i] + beta)
    a, qdd = base(c, misprint), np.zeros(LINKS)
    sign = -1.0 if misprint == "qdd = Psi(u - s^T(M(...) - f_b))" else 1.0
    for i in range(LINKS):
        free = to_link[i] @ a + eta[i]
        qdd[i] = psi[i] * (u[i] - s[i] @ (lumped[i] @ free + sign * bias[i]))
        a = free + s[i] * qdd[i]
    return qdd


INVERSE = (
    "v = [v, omega]",
    "ad* without the transpose",
    "J = R J_p R^T + m[p][p]",
    "no gravity",
    "f_j = Ad^T_ji f_i",
)
FORWARD = ("f_b = -ad* M_(i:n) v", "qdd = Psi(u - s^T(M(...) - f_b))", "no rotor in Psi")


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def off_by(misprint: str) -> float:
    """Median over the chains of the relative error of torques or accelerations."""
    if misprint in INVERSE:
        errors = [relative(rnea(Chain(k), misprint), right(k)[0]) for k in CHAINS]
    else:
        errors = [relative(aba(Chain(k), right(k)[0], misprint), right(k)[1]) for k in CHAINS]
    return float(np.median(errors))


def right(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The library's torque, and the acceleration that it gives back."""
    c = Chain(seed)
    tau = diffnea.rnea(c.model(), q=c.q, qd=c.qd, qdd=c.qdd)
    return tau, diffnea.aba(c.model(), q=c.q, qd=c.qd, tau=tau)


@pytest.mark.parametrize("seed", CHAINS)
def test_the_corrected_recursions_are_the_librarys(seed: int) -> None:
    c = Chain(seed)
    tau, qdd = right(seed)
    assert relative(rnea(c), tau) < SAME
    assert relative(qdd, c.qdd) < SAME
    assert relative(aba(c, tau), qdd) < SAME


@pytest.mark.parametrize("misprint", [*INVERSE, *FORWARD])
def test_each_misprint_is_off(misprint: str) -> None:
    assert off_by(misprint) > OFF


def softplus(z: float) -> tuple[float, float, float]:
    """σ, σ', σ''."""
    gate = 1.0 / (1.0 + np.exp(-z))
    return float(np.log1p(np.exp(z))), gate, gate * (1.0 - gate)


def pulled(pull: Callable[[dict], float], seed: int) -> float:
    """Second derivative of g = softplus(h) under a pull, relative to what h alone would have."""
    rng = np.random.default_rng(seed)
    x = {k: rng.normal(size=3) for k in ("delta", "velocity", "free")}
    x["delta"] *= 0.4 / np.linalg.norm(x["delta"])
    h = float(rng.uniform(-0.02, 0.02))
    _, d1, d2 = softplus(h)
    square = x["delta"] @ x["delta"]
    a = x["free"] - pull({**x, "ratio": d2 / d1, "gate": d1}) * x["delta"] / np.sqrt(square)
    h_d = 2.0 * x["delta"] @ x["velocity"]
    h_dd = 2.0 * (x["delta"] @ a + x["velocity"] @ x["velocity"])
    free = 2.0 * (x["delta"] @ x["free"] + x["velocity"] @ x["velocity"])
    return abs(d2 * h_d**2 + d1 * h_dd) / abs(d1 * free)


def exact(x: dict) -> float:
    across = x["delta"] @ x["velocity"]
    need = x["delta"] @ x["free"] + x["velocity"] @ x["velocity"] + 2.0 * x["ratio"] * across**2
    return need / np.linalg.norm(x["delta"])


def printed(x: dict) -> float:
    need = x["delta"] @ x["free"] + x["velocity"] @ x["velocity"]
    return x["gate"] * need / np.linalg.norm(x["delta"])


def test_the_multiplier_of_a_softplus_constraint_has_no_gate() -> None:
    """With the exact one the second derivative of g vanishes; with the printed one it does not."""
    assert max(pulled(exact, seed) for seed in CHAINS) < SAME
    assert np.median([pulled(printed, seed) for seed in CHAINS]) > OFF
