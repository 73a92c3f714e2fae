"""From a description of a linkage to its base parameters: excite, simulate, identify."""

import json
from pathlib import Path

import numpy as np
import pytest
from cli import done
from planar_linkage import FIVE_BAR, FOUR_BAR, Linkage, described

import diffnea as package

LINKAGES = pytest.mark.parametrize("linkage", [FOUR_BAR, FIVE_BAR], ids=["four-bar", "five-bar"])
SEEDS = 20


@LINKAGES
def test_a_designed_motion_closes_and_tells_all_base_parameters(
    linkage: Linkage, tmp_path: Path
) -> None:
    """Better than random motions, within the limits that are asked for."""
    _, model = map(package.load_model, described(tmp_path, linkage))
    limit = {"j1": 1.5, f"j{linkage.drives + 1}": 1.0}
    found = package.design_excitation(
        model, duration=10, seed=1, iterations=30, velocity_limits=limit
    )
    motion = found.trajectory
    assert motion.joint_names == [f"j{i + 1}" for i in range(linkage.drives)]
    # Inertias 8 and 11; viscous and dry friction of every joint; an offset of every drive; and
    # the rotors of drives, as far as links do not absorb them.
    least = {1: 8 + 2 * 3 + 1, 2: 11 + 2 * 4 + 2}[linkage.drives]
    assert found.base_parameters >= least
    assert found.std_ratio < 1.0
    assert np.isfinite(found.log_det)
    joints = linkage.joints(motion.q)
    assert np.isfinite(joints).all()
    speed = np.abs(np.diff(joints, axis=0)).max(axis=0) / (motion.time[1] - motion.time[0])
    for name, value in limit.items():
        assert speed[model.joint_names.index(name)] < value


@LINKAGES
def test_base_parameters_come_back_through_simulation(linkage: Linkage, tmp_path: Path) -> None:
    """Truth lies in its 95 % intervals in 20 recordings of one designed motion."""
    truth, wrong = map(package.load_model, described(tmp_path, linkage))
    motion = package.design_excitation(wrong, duration=10, seed=1, iterations=20).trajectory
    value = dict(
        zip(
            (
                f"bar{i + 1}.{name}"
                for i in range(len(linkage.bars))
                for name in ("mass", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
            ),
            truth.inertial_parameters,
            strict=True,
        )
    )
    inside = count = 0
    for seed in range(SEEDS):
        # Torques of links alone: no rotor, no friction.
        recording = package.simulate(truth, motion, noise=1.0, seed=seed, period=10.0).recording
        result = package.identify(wrong, recording, effects=[])
        assert result.summary.converged
        names = [p.name for p in result.parameters]
        for base in result.base_parameters:
            true = sum(
                c * value[names[k]] for k, c in zip(base.columns, base.coefficients, strict=True)
            )
            count += 1
            inside += abs(base.value - true) <= 1.96 * base.std
    assert count == SEEDS * (8 if linkage.drives == 1 else 11)
    # Intervals of periodic motions with noise of the encoders are a little wide: 0.99 seen.
    assert inside / count >= 0.90
    # They say something: all but the worst are within a tenth of what the joints feel.
    spread = [base.std for base in result.base_parameters]
    assert np.median(spread) < 0.02


@pytest.mark.parametrize("in_mujoco", [False, True], ids=["model", "mujoco"])
def test_the_commands_lead_from_a_description_to_its_fit(in_mujoco: bool, tmp_path: Path) -> None:
    """`excite`, `simulate` and `identify` of a four-bar; held-out torque is known to the noise."""
    described(tmp_path, FOUR_BAR)
    truth, wrong = tmp_path / "truth.xml", tmp_path / "wrong.xml"
    for name, seed in (("train", 1), ("test", 2)):
        motion, log = tmp_path / f"{name}_motion.csv", tmp_path / f"{name}.csv"
        done(
            "excite", wrong, "-o", motion, "--seed", seed, "--iterations", 10, "--duration", 10,
        )  # fmt: skip
        world = ["--world", f"mujoco:{truth},perturb=none"] if in_mujoco else []
        model = wrong if in_mujoco else truth  # of the controller
        done(
            "simulate", model, "--trajectory", motion, *world, "--noise", 1, "--seed", seed,
            "--period", 10, "-o", log,
        )  # fmt: skip
    assert json.loads((tmp_path / "train.json").read_text())["passive"] == ["j2", "j3"]
    done(
        "identify", wrong, tmp_path / "train.csv", "--test", tmp_path / "test.csv", "-o",
        tmp_path / "run",
    )  # fmt: skip
    error = package.read_result(tmp_path / "run").errors[0]
    assert error.joint == "j1"
    assert error.nominal_test > 0.5
    assert error.test < 0.05  # the noise of one torque; the filter leaves less
