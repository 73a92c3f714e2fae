"""A robot whose joints stick where they turn back, with friction that its model knows of by then.

The mast of the guide in MuJoCo, whose dry friction holds a joint at every reversal for 5 to 50 ms:
no function of the motion says by how much. That is no effect's, and must not hide one. The model is
identified from the recording that is diagnosed, with parameters that the effect has bent.
"""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from cli import ROOT, done, load

NOTHING = ""
LAG = ",effect=actuator_lag@tilt:time_constant=0.02"
QUADRATIC = ",effect=quadratic_friction@tilt:quadratic=0.05"
SPRING = ",effect=joint_spring@tilt:stiffness=3+rest=0.3"
STRIBECK = ",effect=stribeck_friction@pan:stiction_excess=0.05+stribeck_velocity=0.3"


@pytest.fixture(scope="module")
def mast(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the guide's description, its world, and two motions."""
    folder = tmp_path_factory.mktemp("mast")
    page = (ROOT / "docs/guide/own_robot.md").read_text(encoding="utf-8")
    for file in ("mast.urdf", "mast.xml"):
        block = re.search(rf"cat > {file} <<'(\w+)'\n(.*?)\n\1\n", page, re.DOTALL)
        assert block, f"the guide no longer writes {file}"
        (folder / file).write_text(block[2] + "\n", encoding="utf-8")
    for seed, name in ((1, "train"), (2, "test")):
        done("excite", "mast.urdf", "--seed", seed, "-o", f"{name}_motion.csv", cwd=folder)
    return folder


def diagnosed(mast: Path, folder: Path, seed: int, hidden: str, *, rows: int = 0) -> Any:
    """Record, identify, then diagnose what was identified, or its first rows, without a period."""
    world = f"mujoco:{mast}/mast.xml,perturb=A,seed={seed}{hidden}"
    for noise, name in ((1, "train"), (2, "test")):
        done(
            *("simulate", mast / "mast.urdf", "--trajectory", mast / f"{name}_motion.csv"),
            *("--world", world, "--period", 10, "--seed", 10 * seed + noise),
            *("-o", folder / f"{name}.csv"),
        )
    data = (folder / "train.csv", "--test", folder / "test.csv")
    done("identify", mast / "mast.urdf", *data, "-o", folder / "run")
    for name in ("train", "test") if rows else ():
        text = (folder / f"{name}.csv").read_text(encoding="utf-8").splitlines(keepends=True)
        (folder / f"{name}.csv").write_text("".join(text[: rows + 1]), encoding="utf-8")
        sidecar = load(folder / f"{name}.json")
        del sidecar["period"]
        (folder / f"{name}.json").write_text(json.dumps(sidecar), encoding="utf-8")
    done("diagnose", folder / "run/model.json", *data, "-o", folder / "why")
    return load(folder / "why/result.json")


@pytest.mark.parametrize("seed", [4, 5])
def test_what_holds_a_joint_that_sticks_is_no_effect(mast: Path, tmp_path: Path, seed: int) -> None:
    finding = diagnosed(mast, tmp_path, seed, NOTHING)
    assert finding["verdict"] == "NONE", finding["sentence"]
    assert finding["causes"] == []
    # Whoever reads NONE is told what was not looked at.
    assert any("sticks wherever it turns back" in note for note in finding["notes"])
    # Bristles are why it sticks, and show in the turns that are left out.
    untried = [r for r in finding["refused"] if r["effect"] == "presliding_dahl"]
    assert any("tilt" in r["where"] and "sticks" in r["reason"] for r in untried)


def test_a_lag_is_found_beside_it(mast: Path, tmp_path: Path) -> None:
    finding = diagnosed(mast, tmp_path, 31, LAG)
    (cause,) = finding["causes"]  # once it was UNKNOWN
    kinds = {cause["effect"], *(member["effect"] for member in cause["class"])}
    assert cause["where"] == "tilt"
    # Beside a friction that sticks, rows of one path and columns of the other do not tell a lag of
    # 20 ms from a delay.
    assert kinds & {"actuator_lag", "actuator_delay"}, finding["sentence"]
    (time_constant,) = cause["parameters"]  # of a lag or a delay: what the torque is late by
    low, high = time_constant["ci95"]
    assert low < 0.02 < high


def test_a_friction_that_the_fit_has_taken_for_others_is_found(mast: Path, tmp_path: Path) -> None:
    finding = diagnosed(mast, tmp_path, 133, QUADRATIC)
    assert finding["base"] == "refit"
    (cause,) = finding["causes"]  # within the posterior: a Stribeck friction
    assert (cause["effect"], cause["where"]) == ("quadratic_friction", "tilt")
    (quadratic,) = cause["parameters"]
    low, high = quadratic["ci95"]
    assert low < 0.05 < high


@pytest.mark.parametrize("rows", [0, 8000], ids=["two periods", "16 s of them"])
def test_a_spring_that_gravity_hides_is_found(mast: Path, tmp_path: Path, rows: int) -> None:
    """Once NONE: it was too large to be believed, then its lead-in and it itself were noise."""
    finding = diagnosed(mast, tmp_path, 4, SPRING, rows=rows)
    (cause,) = finding["causes"]
    assert (cause["effect"], cause["where"]) == ("joint_spring", "tilt"), finding["sentence"]
    assert cause["visible_share"] < 0.2
    low, high = cause["parameters"][0]["ci95"]
    assert low < 3.0 < high
    # Gaps and elasticities are tried, whether or not the motion repeats.
    assert all(refusal["where"] != "all" for refusal in finding["refused"])


def test_a_spring_is_found_beside_what_identify_fits(mast: Path, tmp_path: Path) -> None:
    """Friction and all else that a description lacks is fitted first."""
    finding = diagnosed(
        mast, tmp_path, 4, ",noise=5" + SPRING.replace("stiffness=3", "stiffness=0.8")
    )
    (cause,) = finding["causes"]
    assert (cause["effect"], cause["where"]) == ("joint_spring", "tilt")
    low, high = cause["parameters"][0]["ci95"]
    assert low < 0.8 < high


def test_friction_that_shows_at_turns_alone_is_found(mast: Path, tmp_path: Path) -> None:
    finding = diagnosed(mast, tmp_path, 32, STRIBECK)
    (cause,) = finding["causes"]
    assert (cause["effect"], cause["where"]) == ("stribeck_friction", "pan")
    excess = cause["parameters"][0]
    low, high = excess["ci95"]  # as wide as what the joint may be held by meanwhile
    assert low < 0.05 < high
