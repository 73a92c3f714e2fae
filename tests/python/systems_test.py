"""Systems with a joint that nothing drives: what a cart-pole and a rotary pendulum hide is named.

The robot is MuJoCo's, with masses, inertias and friction drawn anew. Motions, effects and bounds
were chosen with seeds 1 to 3 and 11 to 13; the seeds here were not looked at before.
"""

import math
import tempfile
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from cli import MODELS, done, load


class Rig(NamedTuple):
    model: str
    passive: str
    limits: tuple[object, ...]
    hidden: tuple[str, str, str]  # effect, where, parameters

    @property
    def description(self) -> Path:
        return MODELS / f"{self.model}.xml"


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


def effect_of(rig: Rig) -> str:
    name, where, parameters = rig.hidden
    return f",effect={name}@{where}:{parameters}"


class Bench:
    """Recordings of rigs, and their fits: made once, however many tests look at them."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.motion = cache(self._motion)
        self.recorded = cache(self._recorded)
        self.identified = cache(self._identified)

    def _new(self) -> Path:
        return Path(tempfile.mkdtemp(dir=self._folder))

    def _motion(self, rig: Rig, seed: int, limits: tuple[object, ...]) -> Path:
        path = self._new() / "motion.csv"
        done("excite", rig.description, *limits, "-o", path, "--seed", seed, "--quiet")
        return path

    def _recorded(
        self, rig: Rig, seed: int, effects: str = "", limits: tuple[object, ...] | None = None
    ) -> Path:
        """A folder with train.csv, test.csv and truth.json."""
        folder = self._new()
        limits = rig.limits if limits is None else limits
        world = f"mujoco:{rig.model},perturb=A,seed={seed}{effects}"
        for k, name in enumerate(("train", "test")):
            motion = self.motion(rig, 2 * seed + k, limits)
            simulate = ("simulate", rig.description, "--trajectory", motion, "--world", world)
            noise = ("--seed", 2 * seed + k, "--quiet")
            truth = ("--truth", folder / "truth.json")
            done(*simulate, *noise, *truth, "-o", folder / f"{name}.csv")
        return folder

    def _identified(self, rig: Rig, folder: Path) -> Path:
        """RUN/ of what `recorded` left."""
        data = (folder / "train.csv", "--test", folder / "test.csv")
        done("identify", rig.description, *data, "-o", folder / "run", "--quiet")
        return folder / "run"


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return Bench(tmp_path_factory.mktemp("systems"))


def diagnosed(model: Path, folder: Path, out: Path) -> dict[str, Any]:
    data = (folder / "train.csv", "--test", folder / "test.csv")
    done("diagnose", model, *data, "-o", out, "--quiet")
    result: dict[str, Any] = load(out / "result.json")
    return result


def named(finding: dict[str, Any]) -> set[tuple[str, str]]:
    return {(cause["effect"], cause["where"]) for cause in finding["causes"]}


def size_of(finding: dict[str, Any], rig: Rig) -> float:
    """What was found of the hidden effect's first parameter over what it is."""
    cause = next(c for c in finding["causes"] if (c["effect"], c["where"]) == rig.hidden[:2])
    value: float = cause["parameters"][0]["value"]
    return value / float(rig.hidden[2].split("+")[0].split("=")[1])


@SEEDS
def test_what_identify_left_of_a_cart_is_named(bench: Bench, seed: int, tmp_path: Path) -> None:
    data = bench.recorded(CART_POLE, seed, effect_of(CART_POLE))
    finding = diagnosed(bench.identified(CART_POLE, data) / "model.json", data, tmp_path / "why")
    assert finding["causes"][0]["effect"] == "cogging", finding["sentence"]
    # 10 %: the 95 % interval is ± 9 %. Of seeds 21 to 32 eleven come within 1 % and one (23) is 6 %
    # too small; with friction that turns with the velocity it is another one (21), by 4 %.
    assert math.isclose(size_of(finding, CART_POLE), 1.0, rel_tol=0.1)


@SEEDS
def test_what_a_pendulum_lacks_is_named(bench: Bench, seed: int, tmp_path: Path) -> None:
    data = bench.recorded(FURUTA, seed, effect_of(FURUTA))
    finding = diagnosed(FURUTA.description, data, tmp_path / "why")
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
def test_nothing_is_named_where_nothing_is_hidden(
    bench: Bench, rig: Rig, seed: int, tmp_path: Path
) -> None:
    data = bench.recorded(rig, seed)
    finding = diagnosed(bench.identified(rig, data) / "model.json", data, tmp_path / "why")
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
@pytest.mark.parametrize("limits", [None, ()], ids=["brisk", "default"])
def test_zero_torque_of_the_pole_says_no_scale(
    bench: Bench, limits: tuple[object, ...] | None, seed: int
) -> None:
    """Small masses fit a torque that is zero better than large ones; the cart's force forbids it.

    A slow motion (the default limits) leaves as much noise as signal in the pole's row.
    """
    data = bench.recorded(CART_POLE, seed, limits=limits)
    result = load(bench.identified(CART_POLE, data) / "result.json")
    found = {p["name"]: p for p in result["parameters"]}
    truth = inertial(data, "pole")
    for name in ("hz", "Iyy"):
        p = found[f"pole.{name}"]
        # Five standard errors and 2 %: the filter's.
        allowed = 5 * p["std"] + 0.02 * abs(truth[name])
        assert math.isclose(p["value"], truth[name], rel_tol=0, abs_tol=allowed), p
