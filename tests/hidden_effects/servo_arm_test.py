"""A servo arm of three joints, from commands and positions alone, through the command line."""

from pathlib import Path
from typing import Any

import diffnea
import numpy as np
import pytest
from cli import done, load

STEP, RATE, DT = 2 * np.pi / 4096, 100, 0.0005  # encoder [rad], log [Hz], simulation [s]
GAIN, DAMPING = np.array([11.0, 14.0, 9.0]), np.array([0.55, 0.70, 0.45])
LIMIT, DRY = np.array([2.2, 2.8, 1.8]), np.array([0.05, 0.09, 0.04])
ROTOR, OFFSET = np.array([0.022, 0.030, 0.018]), np.array([0.0, 0.1, -0.1])
CABLE = 1.0  # N·m/rad at the second joint

# The description: drives alike at all joints, with more damping than any of them has.
ARM = """<mujoco><compiler angle="radian"/><default>
  <joint damping="0.8" armature="0.028" frictionloss="0.05"/><position kp="17"/></default>
  <worldbody><body pos="0 0 0.05">
    <inertial pos="0 0 0.03" mass="0.12" diaginertia="6e-5 6e-5 4e-5"/>
    <joint name="pan" axis="0 0 1"/>
    <body pos="0 0 0.05">
      <inertial pos="0 0 0.07" mass="0.16" diaginertia="2.1e-4 2.1e-4 7e-5"/>
      <joint name="lift" axis="0 1 0"/>
      <body pos="0 0 0.11">
        <inertial pos="0.09 0 0" mass="0.33" diaginertia="2e-4 1.2e-3 1.2e-3"/>
        <joint name="elbow" axis="0 1 0"/>
      </body></body></body></worldbody>
  <actuator><position joint="pan"/><position joint="lift"/><position joint="elbow"/></actuator>
</mujoco>"""


def commands(seconds: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    t = np.arange(seconds * RATE) / RATE
    waves = [(rng.uniform(0.1, 1.5), rng.uniform(0, 6, 3)) for _ in range(5)]
    sines = sum(0.18 * np.sin(6.28 * f * t[:, None] + phase) for f, phase in waves)
    steps = rng.uniform(-0.5, 0.5, (seconds, 3))[t.astype(int)]
    return t, np.where(t[:, None] < seconds / 2, sines, steps)


def write_log(file: Path, arm: diffnea.Model, seconds: int, seed: int, cable: float) -> None:
    """Commands, and positions in encoder steps: dry friction that holds, drives 20 ms late."""
    t, cmd = commands(seconds, seed)
    q, v, hold, rows = cmd[0].copy(), np.zeros(3), np.zeros(3), []
    spring = np.array([0.0, cable, 0.0])
    for k in range(len(t)):
        rows.append(np.hstack([t[k], cmd[k], np.round(q / STEP) * STEP]))
        told = cmd[max(k - 2, 0)]
        for _ in range(round(1 / RATE / DT)):
            middle = q + DT / 2 * v
            drive = np.clip(GAIN * (told - middle), -LIMIT, LIMIT) - DAMPING * v - OFFSET
            push = drive - spring * middle - diffnea.rnea(arm, q=q, qd=v, qdd=np.zeros(3))
            mass = diffnea.mass_matrix(arm, q=q) + np.diag(ROTOR + DT / 2 * DAMPING)
            before, mobility = v, np.linalg.inv(mass)
            free = v + DT * mobility @ push
            for _ in range(8):  # Coulomb: what stops a joint, within what friction has
                v = free - DT * mobility @ hold
                hold = np.clip(hold + 0.5 * v / np.diag(mobility) / DT, -DRY, DRY)
            v = free - DT * mobility @ hold
            q = q + DT / 2 * (before + v)
    head = ["time", *(f"qcmd_{j}" for j in arm.joint_names), *(f"q_{j}" for j in arm.joint_names)]
    np.savetxt(file, rows, "%.5f", ",", header=",".join(head), comments="")


@pytest.fixture
def arm(tmp_path: Path) -> diffnea.Model:
    (tmp_path / "arm.xml").write_text(ARM)
    return diffnea.load_model(tmp_path / "arm.xml").with_effects([])


def result(folder: Path, arm: diffnea.Model, cable: float, command: str, *words: str) -> Any:
    for name, seconds, seed in (("train.csv", 20, 1), ("test.csv", 10, 2)):
        write_log(folder / name, arm, seconds, seed, cable)
    files = ("arm.xml", "train.csv", "--test", "test.csv")
    done(command, *files, *words, "-o", "out", "--quiet", cwd=folder)
    return load(folder / "out" / "result.json")


def test_damping_of_the_description_bounds_no_drive(arm: diffnea.Model, tmp_path: Path) -> None:
    found = result(tmp_path, arm, 0.0, "identify")
    of = {p["name"]: p for p in found["parameters"]}
    for joint, gain, damping in zip(arm.joint_names[1:], GAIN[1:], DAMPING[1:], strict=True):
        for name, truth in (("stiffness", gain), ("damping", damping)):
            p = of[f"{joint}.position_servo.{name}"]
            assert abs(p["value"] - truth) < 3 * p["std"] < 0.2 * truth, p
    assert of["lift.position_servo.stiffness"]["prior"] == 17
    for joint in arm.joint_names:
        assert found["rmse"]["test"][joint] < STEP  # in closed loop, whole runs
        assert 0.01 < found["rmse"]["nominal_test"][joint] < 0.2  # the description's own drives


def test_a_cable_that_makes_a_drive_look_stiff_is_named(arm: diffnea.Model, tmp_path: Path) -> None:
    found = result(tmp_path, arm, CABLE, "diagnose", "--effects", "joint_spring,load_friction")
    assert found["verdict"] == "NAMED", found["sentence"]
    (cause,) = found["causes"]
    assert (cause["effect"], cause["where"]) == ("joint_spring", "lift")
    low, high = cause["parameters"][0]["ci95"]
    assert low < CABLE < high
    assert found["gain"]["test_rmse_after"] < 0.25 * found["gain"]["test_rmse_before"]


def test_a_load_that_the_description_lacks_is_a_payload(
    arm: diffnea.Model, tmp_path: Path
) -> None:
    """The gains are the description's: with others, a mass would be a ratio to them."""
    drives = [f'<position joint="{j}"/>' for j in arm.joint_names]
    known = [d.replace("/>", f' kp="{k}"/>') for d, k in zip(drives, GAIN, strict=True)]
    (tmp_path / "arm.xml").write_text(ARM.replace("".join(drives), "".join(known)))
    # 0.2 kg at 0.16 m from the elbow: mass, centre and inertia of the last link with it.
    own = '<inertial pos="0.09 0 0" mass="0.33" diaginertia="2e-4 1.2e-3 1.2e-3"/>'
    more = '<inertial pos="0.11642 0 0" mass="0.53" diaginertia="2e-4 1.81e-3 1.81e-3"/>'
    (tmp_path / "loaded.xml").write_text(ARM.replace(own, more))
    loaded = diffnea.load_model(tmp_path / "loaded.xml").with_effects([])
    found = result(
        tmp_path, loaded, 0.0, "diagnose", "--effects", "payload,joint_spring,load_friction"
    )
    assert found["verdict"] == "NAMED", found["sentence"]
    (cause,) = found["causes"]
    assert cause["effect"] == "payload"
    low, high = next(p["ci95"] for p in cause["parameters"] if p["name"] == "hx")
    assert low < 0.2 * 0.16 < high
    assert found["gain"]["test_rmse_after"] < 0.5 * found["gain"]["test_rmse_before"]
