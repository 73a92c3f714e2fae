"""A gripper whose fingers follow its motor, from URDF to fitted model; simulations that fail."""

import json
from pathlib import Path

import numpy as np
import pytest
from cli import BAD_INPUT, NO_USABLE_RESULT, diffnea, done

import diffnea as package

LINK = (
    '<link name="{name}"><inertial><origin xyz="0 {y} 0.05"/><mass value="{mass}"/>'
    '<inertia ixx="2e-3" ixy="0" ixz="0" iyy="2e-3" iyz="0" izz="1e-3"/></inertial></link>'
)
JOINT = (
    '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="0 {y} 0.1"/><axis xyz="1 0 0"/>'
    '<limit lower="-1" upper="1" effort="20" velocity="3"/>{more}</joint>'
)


def gripper(tmp_path: Path, mass: float = 0.8) -> Path:
    """Write an arm with two fingers, of which the right one follows the left one."""
    path = tmp_path / f"gripper_{mass}.urdf"
    path.write_text(
        '<robot name="gripper"><link name="base"/>'
        + LINK.format(name="arm", y=0.02, mass=1.5)
        + LINK.format(name="left", y=0.03, mass=mass)
        + LINK.format(name="right", y=-0.03, mass=mass)
        + JOINT.format(name="wrist", parent="base", child="arm", y=0, more="")
        + JOINT.format(
            name="finger",
            parent="arm",
            child="left",
            y=0.05,
            more='<dynamics damping="0.2" friction="0.1"/>',
        )
        + JOINT.format(
            name="other",
            parent="arm",
            child="right",
            y=-0.05,
            more='<dynamics damping="0.1"/><mimic joint="finger" multiplier="-1"/>',
        )
        + "</robot>"
    )
    return path


def test_a_model_says_which_joints_follow(tmp_path: Path) -> None:
    model = package.load_model(gripper(tmp_path))
    assert model.joint_names == ["wrist", "finger"]
    assert model.followers == {"other": {"joint": "finger", "ratio": -1.0, "offset": 0.0}}
    q, qd, qdd = np.array([0.3, 0.5]), np.array([1.0, -2.0]), np.array([0.5, 4.0])
    full = package.load_model(gripper(tmp_path), open_loops=True)
    every = [np.array([x[0], x[1], -x[1]]) for x in (q, qd, qdd)]
    joints = package.rnea(full, q=every[0], qd=every[1], qdd=every[2], effects=True)
    tau = package.rnea(model, q=q, qd=qd, qdd=qdd, effects=True)
    np.testing.assert_allclose(tau, [joints[0], joints[1] - joints[2]], atol=1e-13)
    assert package.regressor(model, q=q, qd=qd, qdd=qdd).shape == (2, 30)
    torques = package.rnea(model, q=q, qd=qd, qdd=qdd)
    np.testing.assert_allclose(package.aba(model, q=q, qd=qd, tau=torques), qdd, atol=1e-10)


@pytest.mark.parametrize("world", [[], ["--world", "drawn"]])
def test_a_gripper_is_excited_simulated_and_identified(tmp_path: Path, world: list[str]) -> None:
    model, motion = gripper(tmp_path), tmp_path / "motion.csv"
    done("excite", model, "--duration", 10, "-o", motion, "--quiet")
    if world:  # MuJoCo holds the fingers together
        done("export", model, "-o", tmp_path / "drawn.xml", "--quiet")
        world = ["--world", f"mujoco:{tmp_path / 'drawn.xml'},perturb=none,noise=0.1"]
    data = tmp_path / "data.csv"
    done("simulate", model, "--trajectory", motion, *world, "-o", data, "--quiet")
    assert data.read_text().splitlines()[0].count("q_") == 2
    start = gripper(tmp_path, mass=1.2)  # heavier than it is
    out = done("identify", start, data, "-o", tmp_path / "run", "--json", "--quiet")
    rmse = json.loads(out)["rmse"]
    for joint in ("wrist", "finger"):
        assert rmse["train"][joint] < 0.05 * rmse["nominal_train"][joint]


def test_a_simulation_that_fails_leaves_nothing(tmp_path: Path) -> None:
    model, motion = gripper(tmp_path), tmp_path / "motion.csv"
    done("excite", model, "--duration", 10, "-o", motion, "--quiet")
    model.write_text(model.read_text().replace('effort="20"', 'effort="0"'))  # no limit
    data = tmp_path / "data.csv"
    gains = ["--kp", 1e9, 1e9, "--kd", 1e9, 1e9]
    answer = diffnea("simulate", model, "--trajectory", motion, *gains, "-o", data)
    assert answer.returncode == NO_USABLE_RESULT, answer.stderr
    assert "nothing was written" in answer.stderr
    assert not data.exists()
    assert not data.with_suffix(".json").exists()
    assert done("simulate", model, "--trajectory", motion, "-o", data, "--quiet") == ""
    assert data.exists()


def test_a_joint_that_moves_nothing_is_said_by_name(tmp_path: Path) -> None:
    bare = tmp_path / "bare.urdf"
    bare.write_text(
        '<robot name="bare"><link name="base"/>'
        + LINK.format(name="arm", y=0.02, mass=1.5)
        + '<link name="flag"/>'
        + JOINT.format(name="wrist", parent="base", child="arm", y=0, more="")
        + JOINT.format(name="mast", parent="arm", child="flag", y=0.05, more="")
        + "</robot>"
    )
    motion = tmp_path / "motion.csv"
    motion.write_text("time,qcmd_wrist,qcmd_mast\n0,0,0\n1,0.1,0.1\n2,0,0\n")
    answer = diffnea("simulate", bare, "--trajectory", motion, "-o", tmp_path / "data.csv")
    assert answer.returncode == BAD_INPUT
    assert "joint 'mast' moves link 'flag', which has no inertia" in answer.stderr
    with pytest.raises(ValueError, match="flag"):
        package.aba(package.load_model(bare), q=[0, 0], qd=[0, 0], tau=[0, 0])
