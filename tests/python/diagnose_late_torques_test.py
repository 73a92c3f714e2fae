"""A pendulum's lag, by closed forms: the base may not stand in for it by shifting the torques."""

from pathlib import Path

import numpy as np
from cli import done, load

MASS, ALONG, ACROSS, INERTIA, GRAVITY = 2.0, 0.2, 0.02, 0.06, 9.81
DRY, VISCOUS, TURN = 0.3, 0.2, 0.02  # [N·m], [N·m·s/rad], [rad/s]
LAG = 0.01  # [s], five samples
MJCF = f"""<mujoco model="pendulum"><worldbody><body name="bar"><joint name="j" axis="0 1 0"/>
<inertial pos="{ALONG} 0 {ACROSS}" mass="{MASS}" diaginertia=".01 {INERTIA} .05"/></body>
</worldbody><actuator><motor joint="j"/></actuator></mujoco>"""


def record(path: Path, seed: int) -> Path:
    """Write twenty seconds of a Fourier series; the log has the command, u + T du/dt."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 20, 0.002)
    q, qd, qdd, jerk = np.zeros((4, len(t)))
    for k in range(1, 6):
        w = 2 * np.pi * k / 10
        a, b = rng.normal(size=2) / k
        s, c = np.sin(w * t), np.cos(w * t)
        q += a * s + b * c
        qd += w * (a * c - b * s)
        qdd -= w**2 * (a * s + b * c)
        jerk -= w**3 * (a * c - b * s)
    scale = 1 / np.abs(q).max()
    q, qd, qdd, jerk = scale * q - 0.5, scale * qd, scale * qdd, scale * jerk
    about_joint = INERTIA + MASS * (ALONG**2 + ACROSS**2)
    turn = np.tanh(qd / TURN)
    u = about_joint * qdd + DRY * turn + VISCOUS * qd
    u -= MASS * GRAVITY * (ALONG * np.cos(q) + ACROSS * np.sin(q))
    rate = about_joint * jerk + (DRY * (1 - turn**2) / TURN + VISCOUS) * qdd
    rate += MASS * GRAVITY * (ALONG * np.sin(q) - ACROSS * np.cos(q)) * qd
    noisy = q + 2e-5 * rng.normal(size=len(t)), u + LAG * rate + 0.02 * rng.normal(size=len(t))
    np.savetxt(
        path, np.column_stack([t, *noisy]), delimiter=",", fmt="%.9g", comments="",
        header="time,q_j,tau_j",
    )  # fmt: skip
    return path


def test_a_lag_of_five_samples_is_no_instant_of_a_drive(tmp_path: Path) -> None:
    """Beside the lag the base shifts torques by less than a sample; without it, it may not."""
    (tmp_path / "pendulum.xml").write_text(MJCF)
    train, test = (record(tmp_path / f"{n}.csv", s) for s, n in enumerate(["train", "test"], 1))
    done("identify", tmp_path / "pendulum.xml", train, "--test", test, "-o", tmp_path / "run")
    done("diagnose", tmp_path / "run/model.json", train, "--test", test, "-o", tmp_path / "why")
    result = load(tmp_path / "why" / "result.json")
    (cause,) = result["causes"]
    late = ("actuator_lag", "actuator_delay", "time_shift")
    assert cause["effect"] in late
    low, high = cause["parameters"][0]["ci95"]
    assert low <= LAG <= high
    assert not any("act 3" in note or "act 4" in note for note in result["notes"])
