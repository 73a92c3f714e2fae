"""Causes in closed linkages, named from the torques of their drives; data by Lagrange's equation.

Friction of passive joints reaches the drives by virtual work: no code in common with the library.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli import done, load
from planar_linkage import FIVE_BAR, FOUR_BAR, Bar, Linkage, described

NOISE, ENCODER = 0.02, 2e-5  # [N·m], [rad]
Friction = dict[int, tuple[float, float]]  # viscous [N·m·s/rad], dry [N·m], by joint
OF_DRIVES: Friction = {0: (0.2, 0.3), 1: (0.1, 0.2)}  # in the base model


def record(path: Path, linkage: Linkage, seed: int, hidden: Friction) -> Path:
    """Write twenty seconds of random Fourier series of the drives, and the torque they need."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 20, 0.002)
    reach = 1.2 if linkage.drives == 1 else 0.28
    q, qd, qdd = linkage.moves(rng, t, 10.0, 6, reach)
    tau = linkage.torques(q, qd, qdd) + linkage.friction(q, qd, hidden)
    tau += linkage.friction(q, qd, {j: OF_DRIVES[j] for j in range(linkage.drives)})
    joints = linkage.joints(q)
    names = [f"j{i + 1}" for i in range(len(linkage.bars))]
    columns = [f"q_{j}" for j in names] + [f"tau_{j}" for j in names[: linkage.drives]]
    noisy = joints + ENCODER * rng.normal(size=joints.shape), tau + NOISE * rng.normal(
        size=tau.shape
    )
    np.savetxt(
        path, np.column_stack([t, *noisy]), delimiter=",", fmt="%.9g", comments="",
        header=",".join(["time", *columns]),
    )  # fmt: skip
    return path


def diagnosed(folder: Path, linkage: Linkage, hidden: Friction, seed: int = 0) -> Any:
    """Identify with the drives' own friction alone, then diagnose; return the result."""
    truth, _ = described(folder, linkage)
    train, test = (
        record(folder / f"{name}.csv", linkage, 2 * seed + k, hidden)
        for k, name in enumerate(["train", "test"], 1)
    )
    effects = [
        f"{effect}@j{k + 1}"
        for effect in ("armature", "viscous_friction", "coulomb_friction", "torque_offset")
        for k in range(linkage.drives)
    ]
    done(
        "identify", truth, train, "--test", test, "--effects", ",".join(effects), "-o",
        folder / "run", "--quiet",
    )  # fmt: skip
    done(
        "diagnose", folder / "run" / "model.json", train, "--test", test, "-o", folder / "why",
        "--quiet",
    )  # fmt: skip
    return load(folder / "why" / "result.json")


def friction(joint: int, effect: str, size: float) -> Friction:
    """Return one friction of one joint."""
    return {joint: (size, 0.0) if effect == "viscous_friction" else (0.0, size)}


CASES = pytest.mark.parametrize(
    ("linkage", "joint", "effect", "size"),
    [
        (FOUR_BAR, 2, "viscous_friction", 0.15),
        (FOUR_BAR, 1, "coulomb_friction", 0.05),
        (FIVE_BAR, 3, "viscous_friction", 0.15),
    ],
    ids=["rocker-viscous", "coupler-dry", "five-bar-viscous"],
)


@CASES
def test_friction_of_a_passive_joint_is_named(
    linkage: Linkage, joint: int, effect: str, size: float, tmp_path: Path
) -> None:
    """Where nothing is measured: it shows in the drives' torques, by the ratio of speeds."""
    result = diagnosed(tmp_path, linkage, friction(joint, effect, size))
    assert result["verdict"] in ("NAMED", "CLASS")
    (cause,) = result["causes"]
    assert (cause["effect"], cause["where"]) == (effect, f"j{joint + 1}")
    low, high = cause["parameters"][0]["ci95"]
    assert low <= size <= high
    # Noise is left, of the rows that no fit has seen.
    assert result["gain"]["test_rmse_after"] < 1.2 < 1.4 < result["gain"]["test_rmse_before"]
    assert [j["joint"] for j in result["joints"]] == [f"j{k + 1}" for k in range(linkage.drives)]


def loaded(bar: Bar, mass: float, along: float) -> Bar:
    """Return a bar that carries a point mass on its line."""
    total = bar.mass + mass
    x, z = (bar.mass * bar.along + mass * along) / total, bar.mass * bar.across / total
    inertia = bar.inertia + bar.mass * ((bar.along - x) ** 2 + (bar.across - z) ** 2)
    return Bar(bar.length, total, x, z, inertia + mass * ((along - x) ** 2 + z**2))


def test_a_payload_on_the_coupler_is_named(tmp_path: Path) -> None:
    """Beside what the unloaded linkage has told, at the link that carries it."""
    diagnosed(tmp_path, FOUR_BAR, {})
    crank, coupler, rocker = FOUR_BAR.bars
    heavier = replace(FOUR_BAR, bars=(crank, loaded(coupler, 0.5, 0.4), rocker))
    train, test = (record(tmp_path / f"{n}.csv", heavier, s, {}) for s, n in ((3, "a"), (4, "b")))
    done(
        "diagnose", tmp_path / "run" / "model.json", train, "--test", test, "-o",
        tmp_path / "payload", "--quiet",
    )  # fmt: skip
    result = load(tmp_path / "payload" / "result.json")
    (cause,) = result["causes"]
    assert (cause["effect"], cause["where"]) == ("payload", "j2")
    intervals = {p["name"]: p["ci95"] for p in cause["parameters"] if p["ci95"][0] is not None}
    assert set(intervals) == {"mass", "hx", "hz", "Iyy"}  # the plane hides the others
    for name, true in (("mass", 0.5), ("hx", 0.2), ("hz", 0.0), ("Iyy", 0.08)):
        low, high = intervals[name]
        assert low <= true <= high


def test_nothing_is_named_where_nothing_is_hidden(tmp_path: Path) -> None:
    """The result lists what is not tried, and says that no window is simulated."""
    result = diagnosed(tmp_path, FOUR_BAR, {})
    assert result["verdict"] == "NONE"
    assert result["causes"] == []
    assert "closed loops" in result["simulated"]["reason"]
    refused = {r["effect"]: r["reason"] for r in result["refused"]}
    assert {"joint_elasticity", "backlash", "load_friction"} <= set(refused)
    assert "closed loop" in refused["joint_elasticity"]
    tried = {(c["effect"], c["where"]) for c in result["candidates"]}
    assert ("coulomb_friction", "j3") in tried
    assert not {("armature", "j3"), ("torque_offset", "j2"), ("cogging", "j2")} & tried


@pytest.mark.study
@CASES
def test_friction_of_a_passive_joint_is_named_in_ten_recordings(
    linkage: Linkage, joint: int, effect: str, size: float, tmp_path: Path
) -> None:
    """The right name alone in nine at least, and intervals that hold the truth in as many."""
    named = inside = 0
    for seed in range(10, 20):
        folder = tmp_path / str(seed)
        folder.mkdir()
        causes = diagnosed(folder, linkage, friction(joint, effect, size), seed)["causes"]
        found = [(c["effect"], c["where"]) for c in causes]
        named += found == [(effect, f"j{joint + 1}")]
        for cause in causes:
            low, high = cause["parameters"][0]["ci95"] or (np.inf, -np.inf)
            inside += low <= size <= high
    print(f"{named} of 10 named, {inside} of 10 intervals hold the truth")
    assert named >= 9
    assert inside >= 9


@pytest.mark.study
@pytest.mark.parametrize("linkage", [FOUR_BAR, FIVE_BAR], ids=["four-bar", "five-bar"])
def test_nothing_is_named_in_ten_recordings(linkage: Linkage, tmp_path: Path) -> None:
    """A name where nothing is hidden would be false."""
    for seed in range(10, 20):
        folder = tmp_path / str(seed)
        folder.mkdir()
        result = diagnosed(folder, linkage, {}, seed)
        assert (seed, result["verdict"], result["causes"]) == (seed, "NONE", [])
