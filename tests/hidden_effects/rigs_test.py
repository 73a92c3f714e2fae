"""The second generator: every family is there, in the size it says, at the joints it says."""

import json
import math
import os
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from cli import done

# The shortest recordings in which one effect in two is seen at the first draw.
OPTIONS = ("--duration", "8", "--noise", "0.003")
SEED = 7
LATE_SEED = 3

SMALLEST, LARGEST = 0.003, 0.1
# Effects are scaled along a part of their motion, with other effects away; what is beyond twice
# the largest is drawn anew.
SIZE_TOLERANCE = 2.0
# Leapfrog without an effect: forces and accelerations balance to rounding.
ROUNDING = 1e-9
# Effects whose strength ends before the size does: the machine bears no more.
LIMITED = {"joint_elasticity", "backlash", "actuator_lag", "actuator_delay", "saturation"}
LIMITED |= {"time_shift", "encoder_offset", "encoder_scale", "base_tilt", "load_friction"}

Cases = dict[str, tuple[Path, dict[str, Any]]]


def made(rigs: Path, family: str, seed: int, folder: Path, *options: str) -> dict[str, Any]:
    command = [rigs, "--family", family, "--seed", str(seed), "-o", folder, *options]
    subprocess.run(command, check=True, timeout=600)
    truth: dict[str, Any] = json.loads((folder / "truth/truth.json").read_text(encoding="utf-8"))
    return truth


def families(rigs: Path) -> list[str]:
    return subprocess.run(
        [rigs, "--list"], capture_output=True, text=True, check=True
    ).stdout.split()


@pytest.fixture(scope="module")
def cases(rigs: Path, tmp_path_factory: pytest.TempPathFactory) -> Cases:
    home = tmp_path_factory.mktemp("rigs")

    def one(family: str) -> tuple[Path, dict[str, Any]]:
        return home / family, made(rigs, family, SEED, home / family, *OPTIONS)

    every = families(rigs)
    with ThreadPoolExecutor(min(2, os.cpu_count() or 1)) as pool:
        return dict(zip(every, pool.map(one, every), strict=True))


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_every_joint_effect_of_the_catalogue_is_a_family(rigs: Path) -> None:
    listed = json.loads(done("effects", "--json"))["effects"]
    of_joints = {e["effect"] for e in listed if e["place"] not in ("ball", "string", "camera")} - {
        "residual",
        "position_servo",  # makes the torque, which these recordings measure
        "integral_action",  # parts of its law
        "feed_forward",
        "supply_sag",
    }
    assert of_joints <= set(families(rigs))


def test_what_is_hidden_is_what_the_family_says(cases: Cases) -> None:
    for family, (_, truth) in cases.items():
        names = [e["effect"] for e in truth["effects"]]
        if family in ("two", "three"):
            assert len(set(names)) == len(names) == {"two": 2, "three": 3}[family]
            assert len({e["where"] for e in truth["effects"]}) == len(names)
        elif family == "none":
            assert (names, truth["kind"]) == ([], "none")
        elif family == "outside":
            assert names[0].startswith("outside/")
            assert truth["kind"] == "unknown"
            assert truth["effects"][0]["variables"]
        elif family == "absorbed":
            assert (len(names), truth["kind"]) == (1, "absorbed")
        else:
            assert names == [family]
            assert truth["kind"] in ("named", "absorbed", "audit")


def test_sizes_are_within_what_is_asked_for(cases: Cases) -> None:
    for family, (_, truth) in cases.items():
        for effect in truth["effects"]:
            if truth["kind"] == "audit":
                continue
            assert effect["size"] < LARGEST * SIZE_TOLERANCE, family
            if effect["effect"] not in LIMITED:
                assert effect["size"] > SMALLEST / SIZE_TOLERANCE, family
            assert effect["expected_lm"] <= effect["raw_lm"] * (1 + 1e-6), family


def test_other_joints_stay_as_they_are(cases: Cases) -> None:
    own = ("coulomb_friction", "viscous_friction", "cogging", "torque_offset", "joint_spring")
    for family in ("none", *own):
        _, truth = cases[family]
        joints = [item["joint"] for item in truth["machine"]["joints"]]
        hidden = {e["where"] for e in truth["effects"]}
        for joint, share in zip(joints, truth["effect_share"], strict=True):
            assert (share > SMALLEST / SIZE_TOLERANCE) if joint in hidden else (share < ROUNDING)


def test_a_late_velocity_is_that_of_the_joint_it_says(rigs: Path, tmp_path: Path) -> None:
    """The velocity of that joint alone lags behind dq/dt."""
    truth = made(rigs, "velocity_filter_lag", LATE_SEED, tmp_path / "late", *OPTIONS)
    (effect,) = truth["effects"]
    joints = [item["joint"] for item in truth["machine"]["joints"]]
    assert effect["where"] != joints[0]  # else any mistake would pass
    found = json.loads(done("audit", tmp_path / "late/seen/train.csv", "--json"))
    late = [f["where"] for f in found["audit"] if f["fault"] == "velocity_filter_lag"]
    assert late == [effect["where"]]


def test_absorbed_effects_are_absorbed(cases: Cases) -> None:
    _, truth = cases["absorbed"]
    (effect,) = truth["effects"]
    # Its projection is good to 1e-5 of each column.
    assert effect["visible_share"] < 1e-2
    assert effect["size"] > SMALLEST / SIZE_TOLERANCE


def test_the_library_reads_what_is_seen(cases: Cases) -> None:
    for family in ("none", "backlash", "session_offset", "two"):
        folder, truth = cases[family]
        (model,) = (folder / "seen").glob("model.*")
        joints = [item["joint"] for item in truth["machine"]["joints"]]
        assert json.loads(done("info", model, "--json"))["joints"] == joints
        done("audit", folder / "seen" / "train.csv", "--model", model, "--json")


def test_what_is_seen_does_not_tell_the_truth(cases: Cases) -> None:
    folder, _ = cases["stribeck_friction"]
    assert {path.name for path in folder.iterdir()} == {"seen", "truth"}
    for path in (folder / "seen").iterdir():
        text = path.read_text()
        assert "stribeck" not in text
        assert "seed" not in text


def test_a_seed_makes_the_same_case_again_and_another_seed_another(
    rigs: Path, tmp_path: Path
) -> None:
    for name, seed in (("first", 3), ("again", 3), ("other", 4)):
        made(rigs, "viscous_friction", seed, tmp_path / name, *OPTIONS)
    assert contents(tmp_path / "first") == contents(tmp_path / "again")
    assert (
        contents(tmp_path / "first")["seen/train.csv"]
        != (contents(tmp_path / "other")["seen/train.csv"])
    )


def test_drawn_conventions_differ_from_case_to_case(rigs: Path, tmp_path: Path) -> None:
    """Twelve cases have several rates, layouts, motions, laws of control, formats."""

    def one(seed: int) -> dict[str, Any]:
        return made(rigs, "none", seed, tmp_path / str(seed))

    with ThreadPoolExecutor(min(2, os.cpu_count() or 1)) as pool:
        truths = list(pool.map(one, range(12)))
    recordings = [truth["recording"] for truth in truths]
    for key, least in (("rate", 3), ("layout", 2), ("motion", 2), ("torque_instant", 2)):
        assert len({recording[key] for recording in recordings}) >= least, key
    assert len({truth["robot"] for truth in truths}) >= 4
    assert len({truth["control"]["law"] for truth in truths}) == 2
    assert {path.name for path in tmp_path.glob("*/seen/model.*")} == {"model.xml", "model.urdf"}
    for truth in truths:
        runs = truth["recording"]["runs"]
        assert math.isclose(sum(runs), truth["recording"]["duration"])
        assert 5.0 <= sum(runs) <= 61.0 or truth["recording"]["layout"] == "several"


def test_a_family_that_there_is_not_is_answered_with_those_there_are(
    rigs: Path, tmp_path: Path
) -> None:
    command = [rigs, "--family", "gremlins", "-o", tmp_path / "case"]
    answer = subprocess.run(command, capture_output=True, text=True)
    assert answer.returncode == 1
    assert "gremlins" in answer.stderr
    assert "backlash" in answer.stderr
    assert not (tmp_path / "case").exists()
