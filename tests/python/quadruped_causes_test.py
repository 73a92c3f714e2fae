"""A quadruped in the air of a MuJoCo world, torques logged: causes in two of its legs.

It hangs by its trunk, or flies. What is hidden is MuJoCo's own friction, or acts on its torques.
"""

from pathlib import Path

import pytest

import diffnea as package

Hidden = dict[tuple[str, str], dict[str, float]]  # parameters, by effect and joint

LEG = """
<body name="{n}_hip" pos="{x} {y} 0">
  <inertial pos="0 0 0" mass="0.7" diaginertia="8e-4 6e-4 6e-4"/>
  <joint name="{n}_hip" axis="1 0 0" range="-1 1"/>
  <body name="{n}_thigh" pos="0 {s} 0">
    <inertial pos="0 0 -0.05" mass="1.0" diaginertia="6e-3 6e-3 1e-3"/>
    <joint name="{n}_thigh" axis="0 1 0" range="-1.5 3.4"/>
    <body name="{n}_calf" pos="0 0 -0.21">
      <inertial pos="0.01 0 -0.12" mass="0.25" diaginertia="3e-3 3e-3 3e-5"/>
      <joint name="{n}_calf" axis="0 1 0" range="-2.7 -0.8"/>
      <geom type="sphere" size="0.02" pos="0 0 -0.21"/>
    </body>
  </body>
</body>"""
LEGS = {"FL": (1, 1), "FR": (1, -1), "RL": (-1, 1), "RR": (-1, -1)}


def dog(path: Path, drives: str, *, hangs: bool) -> package.Model:
    """Write twelve joints on a trunk that floats above a floor; read it as it hangs, or floats."""
    legs = "".join(
        LEG.format(n=n, x=0.19 * i, y=0.05 * j, s=0.09 * j) for n, (i, j) in LEGS.items()
    )
    joints = [f"{n}_{part}" for n in LEGS for part in ("hip", "thigh", "calf")]
    motors = "".join(f'<motor joint="{j}" ctrlrange="-23 23"/>' for j in joints)
    path.write_text(
        f"""<mujoco model="dog"><compiler angle="radian" autolimits="true"/>
<default><joint {drives}/></default>
<worldbody><geom type="plane" size="5 5 0.1"/>
<body name="trunk" pos="0 0 0.3"><freejoint/>
<inertial pos="0 0 0" mass="6.9" diaginertia="0.02 0.1 0.1"/>
<geom type="box" size="0.3 0.1 0.06"/>{legs}</body></worldbody>
<actuator>{motors}</actuator></mujoco>"""
    )
    return package.load_model(path, fix_base=hangs)


def diagnosed(model: package.Model, hidden: Hidden, seed: int) -> package.Finding:
    """Diagnose 10 s of a designed motion, 10 s of another held out."""
    effects = [
        f"effect={effect}@{where}:" + "+".join(f"{name}={x}" for name, x in of.items())
        for (effect, where), of in hidden.items()
    ]
    world = ",".join([f"mujoco:{model.source}", "perturb=none", "seed=1", *effects])
    train, test = (
        package.simulate(
            model,
            package.design_excitation(
                model, duration=10, period=10, seed=1 + k, iterations=20
            ).trajectory,
            world=world,
            seed=2 * seed + k,
        ).recordings
        for k in range(2)
    )
    return package.diagnose(model, train, test=test)


# Drives whose friction nobody described, and drives whose friction is known.
FRICTION: Hidden = {
    ("viscous_friction", "FL_calf"): {"viscous": 0.15},
    ("coulomb_friction", "RR_thigh"): {"coulomb": 0.4},
}
DRIVES: Hidden = {
    ("cogging", "FL_calf"): {"sine": 0.2, "cycles": 30},
    ("torque_gain", "RR_thigh"): {"gain_error": 0.1},
}
SMOOTH = 'armature="0.01"'
ROUGH = 'armature="0.01" damping="0.1" frictionloss="0.2"'


def count(model: package.Model, hidden: Hidden, seeds: range) -> tuple[int, int, int]:
    """Recordings that are named right, false names, and intervals of sizes that hold the truth."""
    named = others = inside = 0
    for seed in seeds:
        causes = diagnosed(model, hidden, seed).causes
        found = {(c.effect, c.where) for c in causes}
        named += found == set(hidden)
        others += len(found - set(hidden))
        for c in causes:
            size, p = hidden.get((c.effect, c.where)), c.parameters[0]
            inside += size is not None and p.low <= size[p.name] <= p.high
        print(seed, sorted(found), flush=True)
    print(f"{named} of {len(seeds)} named, {others} others, {inside} intervals hold the truth")
    return named, others, inside


HANGS = pytest.mark.parametrize("hangs", [True, False], ids=["hung", "flown"])


@HANGS
def test_causes_in_two_legs_are_named(hangs: bool, tmp_path: Path) -> None:
    model = dog(tmp_path / "dog.xml", SMOOTH, hangs=hangs)
    assert count(model, FRICTION, range(1, 2)) == (1, 0, 2)


def test_causes_beside_known_friction_are_named(tmp_path: Path) -> None:
    """Ripple of one drive and a wrong torque constant of another, on a hung robot."""
    model = dog(tmp_path / "dog.xml", ROUGH, hangs=True)
    assert count(model, DRIVES, range(1, 2)) == (1, 0, 2)


@pytest.mark.study
@HANGS
def test_causes_in_two_legs_are_named_in_ten_recordings(hangs: bool, tmp_path: Path) -> None:
    """Both names and no other in nine at least; as many intervals hold the truth."""
    model = dog(tmp_path / "dog.xml", SMOOTH, hangs=hangs)
    named, _, inside = count(model, FRICTION, range(10, 20))
    assert named >= 9
    assert inside >= 18


@pytest.mark.study
@HANGS
def test_nothing_is_named_in_ten_recordings(hangs: bool, tmp_path: Path) -> None:
    assert count(dog(tmp_path / "dog.xml", SMOOTH, hangs=hangs), {}, range(10, 20))[1] == 0
