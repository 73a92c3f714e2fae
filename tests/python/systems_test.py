"""Systems with a joint that nothing drives: what a cart-pole and a rotary pendulum hide is named.

The robot is MuJoCo's, with masses, inertias and friction drawn anew. Motions, effects and bounds
were chosen with seeds 1 to 3 and 11 to 13; the seeds here were not looked at before.
"""

import math
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from cli import MODELS, done, load


class Rig(NamedTuple):
    model: str
    passive: str
    limits: tuple[object, ...]
    hidden: tuple[str, str, str]  # effect, where, parameters


CART_POLE = Rig(
    "cart_pole",
    "pole",
    ("--harmonics", 12, "--velocity-limit", 1.5, "--acceleration-limit", 8),
    ("cogging", "cart", "sine=0.4+cycles=104.72"),
)
FURUTA = Rig(
    "furuta",
    "pendulum",
    ("--period", 5, "--harmonics", 8, "--velocity-limit", 6, "--acceleration-limit", 80),
    ("joint_spring", "arm", "stiffness=0.01+rest=0.2"),
)
RIGS = pytest.mark.parametrize("rig", [CART_POLE, FURUTA], ids=lambda rig: rig.model)
SEEDS = pytest.mark.parametrize("seed", [21, 22, 23])


def record(rig: Rig, folder: Path, seed: int, *limits: object, effects: str = "") -> Path:
    """Leave train.csv, test.csv and truth.json in `folder`; return the description."""
    model = MODELS / f"{rig.model}.xml"
    for k, name in enumerate(("train", "test")):
        common = ("--seed", 2 * seed + k, "--quiet")
        done("excite", model, *limits, "-o", folder / "motion.csv", *common)
        world = f"mujoco:{rig.model},perturb=A,seed={seed}{effects}"
        simulate = ("simulate", model, "--trajectory", folder / "motion.csv", "--world", world)
        truth = ("--truth", folder / "truth.json")
        done(*simulate, *truth, "-o", folder / f"{name}.csv", *common)
    return model


def effect_of(rig: Rig) -> str:
    name, where, parameters = rig.hidden
    return f",effect={name}@{where}:{parameters}"


def diagnosed(model: Path, folder: Path) -> dict[str, Any]:
    data = (folder / "train.csv", "--test", folder / "test.csv")
    done("diagnose", model, *data, "-o", folder / "why", "--quiet")
    result: dict[str, Any] = load(folder / "why" / "result.json")
    return result


def identified(model: Path, folder: Path) -> dict[str, Any]:
    data = (folder / "train.csv", "--test", folder / "test.csv")
    done("identify", model, *data, "-o", folder / "run", "--quiet")
    result: dict[str, Any] = load(folder / "run" / "result.json")
    return result


def named(finding: dict[str, Any]) -> set[tuple[str, str]]:
    return {(cause["effect"], cause["where"]) for cause in finding["causes"]}


def size_of(finding: dict[str, Any], rig: Rig) -> float:
    """What was found of the hidden effect's first parameter over what it is."""
    cause = next(c for c in finding["causes"] if (c["effect"], c["where"]) == rig.hidden[:2])
    value: float = cause["parameters"][0]["value"]
    return value / float(rig.hidden[2].split("+")[0].split("=")[1])


@SEEDS
def test_what_identify_left_of_a_cart_is_named(seed: int, tmp_path: Path) -> None:
    model = record(CART_POLE, tmp_path, seed, *CART_POLE.limits, effects=effect_of(CART_POLE))
    identified(model, tmp_path)
    finding = diagnosed(tmp_path / "run" / "model.json", tmp_path)
    assert finding["causes"][0]["effect"] == "cogging", finding["sentence"]
    # 5 %: it was found up to 1 % too small.
    assert math.isclose(size_of(finding, CART_POLE), 1.0, rel_tol=0.05)


@SEEDS
def test_what_a_pendulum_lacks_is_named(seed: int, tmp_path: Path) -> None:
    model = record(FURUTA, tmp_path, seed, *FURUTA.limits, effects=effect_of(FURUTA))
    finding = diagnosed(model, tmp_path)
    # The drive rubs, too, which the description lacks, under one pair of names or another; now and
    # then a delay is beside it (docs/systems.md).
    assert FURUTA.hidden[:2] in named(finding), finding["sentence"]
    assert any(effect.endswith("friction") for effect, _ in named(finding)), finding["sentence"]
    dry = [c for c in finding["causes"] if "smoothing" in {p["name"] for p in c["parameters"]}]
    told = any("no dry friction at arm" in note for note in finding["notes"])
    assert told == any(cause["where"] == "arm" for cause in dry)
    # 30 %: it was found up to 21 % too small, what it lost was taken for friction.
    assert math.isclose(size_of(finding, FURUTA), 1.0, rel_tol=0.3)


@RIGS
@SEEDS
def test_nothing_is_named_where_nothing_is_hidden(rig: Rig, seed: int, tmp_path: Path) -> None:
    model = record(rig, tmp_path, seed, *rig.limits)
    identified(model, tmp_path)
    finding = diagnosed(tmp_path / "run" / "model.json", tmp_path)
    # Once 2 % of the drive's friction, which turns otherwise than tanh in MuJoCo, had a name.
    assert finding["verdict"] == "NONE", finding["sentence"]


# --- the joint without a drive


def inertial(folder: Path, link: str) -> dict[str, float]:
    truth = load(folder / "truth.json")
    found = next(entry for entry in truth["links"] if entry["name"] == link)["inertia"]
    values = [found["mass"], *found["first_moment"], *found["about_origin"]]
    names = ("mass", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
    return dict(zip(names, values, strict=True))


@SEEDS
@pytest.mark.parametrize("limits", [CART_POLE.limits, ()], ids=["brisk", "default"])
def test_zero_torque_of_the_pole_says_no_scale(
    limits: tuple[object, ...], seed: int, tmp_path: Path
) -> None:
    """Small masses fit a torque that is zero better than large ones; the cart's force forbids it.

    A slow motion (the default limits) leaves as much noise as signal in the pole's row.
    """
    model = record(CART_POLE, tmp_path, seed, *limits)
    found = {p["name"]: p for p in identified(model, tmp_path)["parameters"]}
    truth = inertial(tmp_path, "pole")
    for name in ("hz", "Iyy"):
        p = found[f"pole.{name}"]
        # Five standard errors and 2 %: the filter's.
        allowed = 5 * p["std"] + 0.02 * abs(truth[name])
        assert math.isclose(p["value"], truth[name], rel_tol=0, abs_tol=allowed), p
