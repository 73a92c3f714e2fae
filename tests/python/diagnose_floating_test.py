"""Causes in robots that float, named from flights; data by conservation of momentum.

Friction and torque gains are added to the torques of the generator, bodies to its links: no code in
common with the library.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli import BAD_INPUT, diffnea, done, load
from free_flyer import Flyer, quadruped
from identify_floating_test import (
    DRONE,
    ENCODER,
    FLIGHTS,
    POSE,
    TORQUE,
    flown,
    model_of,
    thrown,
    wrong,
)

import diffnea as package

Hidden = dict[str, dict[str, float]]  # viscous, dry, gain, by joint


def recorded(
    flyer: Flyer, seed: int, hidden: Hidden, pose: float = POSE
) -> list[package.Recording]:
    """Return flights as sensors have them, with what the drives give beside the links' torque."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(FLIGHTS):
        x = flown(flyer, rng)
        qd, tau = np.gradient(x["q"], x["time"], axis=0, edge_order=2), x["tau"].copy()
        for joint, of in hidden.items():
            j = flyer.joints.index(joint)
            tau[:, j] += of.get("viscous", 0) * qd[:, j]
            tau[:, j] += of.get("dry", 0) * np.tanh(qd[:, j] / 0.01)
            tau[:, j] *= 1 + of.get("gain", 0)
        out.append(
            package.Recording(
                time=x["time"],
                q=x["q"] + ENCODER * rng.normal(size=x["q"].shape),
                tau=tau + TORQUE * rng.normal(size=x["tau"].shape),
                joint_names=flyer.joints,
                base=x["base"] + pose * rng.normal(size=x["base"].shape),
                torque_sampling="instant",
                source=f"flight {seed}.{k}",
            )
        )
    return out


CASES = pytest.mark.parametrize(
    ("joint", "effect", "hidden", "size"),
    [
        ("j_knee2", "viscous_friction", "viscous", 0.15),
        ("j_hip1", "coulomb_friction", "dry", 0.3),
        ("j_knee0", "torque_gain", "gain", 0.1),
    ],
    ids=["knee-viscous", "hip-dry", "knee-gain"],
)


def diagnosed(model: package.Model, flyer: Flyer, seed: int, hidden: Hidden) -> package.Finding:
    """Diagnose six flights, six others held out."""
    return package.diagnose(
        model, recorded(flyer, 2 * seed, hidden), test=recorded(flyer, 2 * seed + 1, hidden)
    )


@pytest.fixture(scope="module")
def walker() -> Flyer:
    return quadruped()


@pytest.fixture(scope="module")
def nominal(walker: Flyer, tmp_path_factory: pytest.TempPathFactory) -> package.Model:
    """Return a description whose masses are a quarter off, and whose inertias a fifth."""
    return wrong(walker, tmp_path_factory.mktemp("nominal") / "walker.urdf")


@CASES
def test_a_cause_in_a_leg_is_named(
    walker: Flyer, nominal: package.Model, joint: str, effect: str, hidden: str, size: float
) -> None:
    """Alone, at its joint, with the truth in its interval; what is left is noise."""
    finding = diagnosed(nominal, walker, 1, {joint: {hidden: size}})
    assert finding.verdict == "NAMED"
    (cause,) = finding.causes
    assert (cause.effect, cause.where) == (effect, joint)
    assert cause.parameters[0].low <= size <= cause.parameters[0].high
    at = next(j for j in finding.joints if j.joint == joint)
    assert at.extended < 1.2 * at.noise_floor < 1.4 * at.noise_floor < at.base


def test_nothing_is_named_where_nothing_is_hidden(walker: Flyer, nominal: package.Model) -> None:
    """Its rows are those of the joints, and of the base by six names."""
    finding = diagnosed(nominal, walker, 1, {})
    assert (finding.verdict, finding.causes) == ("NONE", [])
    base = ["base_x", "base_y", "base_z", "base_yaw", "base_pitch", "base_roll"]
    assert [j.joint for j in finding.joints] == base + walker.joints
    assert [j.unit for j in finding.joints[:6]] == 3 * ["N"] + 3 * ["N*m"]
    assert not {c.where for c in finding.candidates} & set(base)
    assert finding.model.free_base == "trunk"
    assert not [p for p in finding.parameters if p.name.startswith("base_")]


def loaded(flyer: Flyer, name: str, mass: float, at: tuple[float, float, float]) -> Flyer:
    """Return the robot with a point mass on one of its links."""
    bodies, place = list(flyer.bodies), np.array(at)
    k = [b.name for b in bodies].index(name)
    body = bodies[k]
    whole = body.mass + mass
    com = (body.mass * np.array(body.com) + mass * place) / whole

    def about(m: float, arm: np.ndarray) -> np.ndarray:
        return np.asarray(m * (arm @ arm * np.eye(3) - np.outer(arm, arm)))

    tensor = body.tensor() + about(body.mass, np.array(body.com) - com) + about(mass, place - com)
    inertia = tuple(float(x) for x in tensor[np.triu_indices(3)])
    bodies[k] = replace(body, mass=whole, com=tuple(map(float, com)), inertia=inertia)  # type: ignore[arg-type]
    return Flyer(tuple(bodies))


@pytest.mark.parametrize(
    ("link", "where", "mass"), [("knee3", "j_knee3", 0.3), ("trunk", "base", 0.5)]
)
def test_a_payload_is_named_at_its_link(
    walker: Flyer, tmp_path: Path, link: str, where: str, mass: float
) -> None:
    """By the file's masses: in the air the base alone tells what it carries itself."""
    at = (0.02, 0.01, -0.15)
    model = model_of(walker, tmp_path / "walker.urdf")
    heavy = loaded(walker, link, mass, at)
    finding = package.diagnose(
        model, recorded(heavy, 2, {}), test=recorded(heavy, 3, {}), base="fixed"
    )
    (cause,) = finding.causes
    assert (cause.effect, cause.where) == ("payload", where)
    true = dict(zip(("mass", "hx", "hy", "hz"), (mass, *(mass * np.array(at))), strict=True))
    for p in cause.parameters[:4]:
        assert p.low <= true[p.name] <= p.high
    assert [e.where for e in finding.model.effects] == [where]
    package.load_model(finding.model.save(tmp_path / "heavy.json") or tmp_path / "heavy.json")


def test_a_robot_on_the_ground_is_refused(walker: Flyer, nominal: package.Model) -> None:
    """In one sentence, with the run and what to do."""
    held = []
    for r in recorded(walker, 1, {}):
        base = np.tile([0, 0, 0.4, 0, 0, 0, 1.0], (len(r), 1))
        base += POSE * np.random.default_rng(r.run).normal(size=base.shape)
        held.append(package.Recording(time=r.time, q=r.q, tau=r.tau, joint_names=r.joint_names,
                                      base=base, source=r.source))  # fmt: skip
    with pytest.raises(
        package.DataError, match=r"flight 1\.0: .*not as in free fall.*holds or touches.*--fix-base"
    ):
        package.diagnose(nominal, held)


def test_a_drone_s_base_is_fitted_by_its_thrust(tmp_path: Path) -> None:
    """No joint at all: known wrenches are torques of the base's joints, and nothing is hidden."""
    model = wrong(Flyer((DRONE,)), tmp_path / "drone.urdf")
    finding = package.diagnose(model, thrown(1), test=thrown(2))
    assert (finding.verdict, finding.causes) == ("NONE", [])
    value = Flyer((DRONE,)).parameters()
    for p in finding.parameters:
        assert abs(p.value - value[p.name]) < 4 * p.std


@pytest.mark.study
@CASES
def test_a_cause_in_a_leg_is_named_in_ten_recordings(
    walker: Flyer, nominal: package.Model, joint: str, effect: str, hidden: str, size: float
) -> None:
    """The right name alone in nine at least, and intervals that hold the truth in as many."""
    named = inside = 0
    for seed in range(10, 20):
        causes = diagnosed(nominal, walker, seed, {joint: {hidden: size}}).causes
        named += [(c.effect, c.where) for c in causes] == [(effect, joint)]
        inside += any(
            c.effect == effect and c.parameters[0].low <= size <= c.parameters[0].high
            for c in causes
        )
    print(f"{named} of 10 named, {inside} of 10 intervals hold the truth")
    assert named >= 9
    assert inside >= 9


@pytest.mark.study
def test_nothing_is_named_in_twenty_recordings(walker: Flyer, nominal: package.Model) -> None:
    """A name where nothing is hidden would be false."""
    for seed in range(2, 22):
        finding = diagnosed(nominal, walker, seed, {})
        assert (seed, finding.causes) == (seed, [])
