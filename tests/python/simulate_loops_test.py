"""Closed linkages simulated, against Lagrange's equation in their driven angles."""

import json
from pathlib import Path

import numpy as np
import pytest
from cli import BAD_INPUT, diffnea
from planar_linkage import FIVE_BAR, FOUR_BAR, Linkage

import diffnea as package

LINKAGES = pytest.mark.parametrize("linkage", [FOUR_BAR, FIVE_BAR], ids=["four-bar", "five-bar"])


def model_of(tmp_path: Path, linkage: Linkage, change: tuple[str, str] = ("", "")) -> package.Model:
    """Return the linkage as read from its MJCF, with one text replaced."""
    path = tmp_path / "linkage.xml"
    path.write_text(linkage.mjcf().replace(*change) if change[0] else linkage.mjcf())
    return package.load_model(path)


def waves(linkage: Linkage, reach: float = 1.0) -> package.Trajectory:
    """Five seconds of sines of the drives, from rest, sampled at 100 Hz."""
    t = np.arange(0, 5.005, 0.01)
    w = 2 * np.pi * np.arange(1, linkage.drives + 1) / 5.0
    centre, size = ([-1.1], [0.6]) if linkage.drives == 1 else ([-1.6, 1.2], [0.25, 0.2])
    a, phase = reach * np.array(size), t[:, None] * w
    return package.Trajectory(
        time=t,
        q=centre - a * np.cos(phase),
        qd=a * w * np.sin(phase),
        qdd=a * w**2 * np.cos(phase),
        joint_names=[f"j{i + 1}" for i in range(linkage.drives)],
    )


def turned(angle: np.ndarray) -> np.ndarray:
    """Return angles within half a turn."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def held_torques(linkage: Linkage, r: package.Recording) -> tuple[np.ndarray, np.ndarray]:
    """Torques that the recorded motion takes by Lagrange, and those held about each row."""
    dt, q = r.time[1] - r.time[0], r.q[:, : linkage.drives]
    qd, qdd = (q[2:] - q[:-2]) / (2 * dt), (q[2:] - 2 * q[1:-1] + q[:-2]) / dt**2
    tau = r.tau[:, : linkage.drives]
    # Torque is held from row k to k+1: what acts about row k is the mean of two rows.
    return linkage.torques(q[1:-1], qd, qdd), (tau[:-2] + tau[1:-1]) / 2


@LINKAGES
@pytest.mark.parametrize("in_mujoco", [False, True], ids=["model", "mujoco"])
def test_a_linkage_moves_as_lagrange_s_equation_has_it(
    linkage: Linkage, in_mujoco: bool, tmp_path: Path
) -> None:
    """The loop is closed in every row, and the drives' torques are those of the motion."""
    model = model_of(tmp_path, linkage)
    world = f"mujoco:{tmp_path / 'linkage.xml'},perturb=none,noise=0" if in_mujoco else None
    motion = waves(linkage)
    found = package.simulate(model, motion, world=world)
    assert found.failure == ""
    r = found.recording
    assert list(r.joint_names) == list(model.joint_names)
    assert np.isfinite(r.tau[:, : linkage.drives]).all()
    assert not np.isfinite(r.tau[:, linkage.drives :]).any()
    # MuJoCo's loop yields: 2e-7 rad seen.
    gap = turned(r.q - linkage.joints(r.q[:, : linkage.drives]))
    assert np.abs(gap).max() < (1e-5 if in_mujoco else 1e-9)
    needed, held = held_torques(linkage, r)
    # Differences are of second order in dt = 2 ms: 3e-6 of torques of 4 N·m seen.
    assert np.abs(needed - held)[5:].max() < 1e-3 * np.abs(needed).max()
    wanted = np.array([np.interp(r.time, motion.time, c) for c in motion.q.T]).T
    assert np.abs(r.q[:, : linkage.drives] - wanted).max() < 0.05 * np.ptp(motion.q, axis=0).max()


def test_a_loop_that_starts_assembled_otherwise_stays_so(tmp_path: Path) -> None:
    """Columns of the joints that follow say which of two postures is meant."""
    model = model_of(tmp_path, FOUR_BAR)
    motion = waves(FOUR_BAR)
    first = FOUR_BAR.joints(motion.q[:1])[0]
    # The coupler and the rocker below the line from the crank's tip to the ground.
    tip = 0.3 * np.array([np.cos(first[0]), -np.sin(first[0])])
    way = np.array([0.9, 0.0]) - tip
    line = np.arctan2(-way[1], way[0])
    below = np.array([first[0], 2 * line - first[0] - (first[0] + first[1]), -first[2]])
    full = package.Trajectory(
        time=motion.time,
        q=np.hstack([motion.q, np.tile(below[1:], (len(motion), 1))]),
        qd=np.pad(motion.qd, ((0, 0), (0, 2))),
        qdd=np.pad(motion.qdd, ((0, 0), (0, 2))),
        joint_names=["j1", "j2", "j3"],
    )
    r = package.simulate(model, full).recording
    np.testing.assert_allclose(r.q[0], below, atol=1e-9)
    with pytest.raises(package.DataError, match="first row constraint 'pin' is apart by"):
        package.simulate(
            model,
            package.Trajectory(
                time=full.time, q=full.q + [0, 0.7, 0], qd=full.qd, qdd=full.qdd,
                joint_names=full.joint_names,
            ),
        )  # fmt: skip
    above = package.simulate(model, motion).recording
    assert np.abs(above.q[:, 2] - r.q[:, 2]).min() > 0.5


HINGE, SLIDE = 'axis="0 1 0"', 'type="slide" axis="1 0 0"'


def body(name: str, at: float, inner: str, *, joint: str = HINGE, anchor: float = 0.0) -> str:
    """Return a bar of an MJCF; its joint need not be at the body's origin."""
    return (
        f'<body name="{name}" pos="{at} 0 0"><inertial pos="0.2 0 0.01" mass="1" '
        f'diaginertia="0.01 0.02 0.015"/><joint name="j_{name}" pos="{anchor} 0 0" '
        f"{joint}/>{inner}</body>"
    )


def site(name: str, at: float, turn: float = 0.0) -> str:
    """Return a site of an MJCF, turned about y [degrees]."""
    return f'<site name="{name}" pos="{at} 0 0" euler="0 {turn} 0"/>'


WELDED = (  # closed where frames agree, and not where they are half a turn apart
    body("crank", 0.0, body("coupler", 0.3, site("a", 0.8, 30)))
    + body("rocker", 0.9, body("cap", 0.6, site("b", 0.0, -50))),
    '<weld name="closing" site1="a" site2="b"/>',
    "",
)
SLIDER = (  # joints off their bodies' origins, and one that slides
    body("crank", -0.1, body("rod", 0.35, site("a", 0.8), anchor=-0.05), anchor=0.1)
    + body("piston", 0.5, site("b", 0.0), joint=SLIDE),
    '<connect name="closing" site1="a" site2="b"/>',
    '<keyframe><key name="home" qpos="-0.6 0.8 0.5"/></keyframe>',
)


@pytest.mark.parametrize("parts", [WELDED, SLIDER], ids=["weld", "slider"])
def test_loops_of_other_joints_move_in_mujoco_as_in_the_model(
    parts: tuple[str, str, str], tmp_path: Path
) -> None:
    """Two engines, one designed motion: positions and torques of the drive."""
    links, closing, home = parts
    path = tmp_path / "loop.xml"
    path.write_text(
        f'<mujoco model="loop"><worldbody>{links}</worldbody><equality>{closing}</equality>'
        f'<actuator><motor joint="j_crank"/></actuator>{home}</mujoco>'
    )
    model = package.load_model(path)
    motion = package.excite(model, duration=5, period=5, seed=1)
    assert np.ptp(motion.q) > 0.5
    one = package.simulate(model, motion)
    two = package.simulate(model, motion, world=f"mujoco:{path},perturb=none,noise=0")
    assert one.failure == two.failure == ""
    # MuJoCo's constraints yield: 3e-6 rad and 2e-5 N·m of 4 N·m seen.
    np.testing.assert_allclose(one.recording.q, two.recording.q, atol=5e-5)
    np.testing.assert_allclose(one.recording.tau[:, 0], two.recording.tau[:, 0], atol=5e-4)


def test_two_drives_of_one_motion_are_asked_for_what_agrees(tmp_path: Path) -> None:
    """A second drive follows the first, and is refused where it would work against it."""
    model = model_of(tmp_path, FOUR_BAR, ("</actuator>", '<motor joint="j3"/></actuator>'))
    motion = waves(FOUR_BAR)
    q = FOUR_BAR.joints(motion.q)

    def with_third(shift: float) -> package.Trajectory:
        h = motion.time[1] - motion.time[0]
        third = q[:, 2] + shift * np.arange(len(q)) / len(q)
        qd = np.gradient(third, h)
        return package.Trajectory(
            time=motion.time,
            q=np.column_stack([motion.q, third]),
            qd=np.column_stack([motion.qd, qd]),
            qdd=np.column_stack([motion.qdd, np.gradient(qd, h)]),
            joint_names=["j1", "j3"],
        )

    r = package.simulate(model, with_third(0.0)).recording
    assert np.abs(r.q - FOUR_BAR.joints(r.q[:, :1])).max() < 1e-9
    assert np.isfinite(r.tau[:, [0, 2]]).all()
    with pytest.raises(package.DataError, match="joint 'j[13]' is to be at .* and the loop has it"):
        package.simulate(model, with_third(0.1))


def test_refusals_name_the_constraint_and_the_time(tmp_path: Path) -> None:
    """Motions that open the loop, too few drives, loops that never close."""
    model = model_of(tmp_path, FIVE_BAR)
    with pytest.raises(package.DataError, match=r"first row \(j1 = -2.6, .*out of reach.*dead poi"):
        package.simulate(model, waves(FIVE_BAR, reach=4.0))
    far = waves(FIVE_BAR)
    drift = np.array([[0.1, 0.1]]) * far.time[:, None]
    leaving = package.Trajectory(
        time=far.time, q=far.q + drift, qd=far.qd, qdd=far.qdd, joint_names=far.joint_names
    )
    with pytest.raises(package.DataError, match=r"at [1-4]\.\d* s the loop does not close.*j1 = "):
        package.simulate(model, leaving)
    model = model_of(tmp_path, FIVE_BAR, ('<motor joint="j2"/>', ""))
    with pytest.raises(package.ModelError, match="leave 2 of 4 motions .* hold 1 of them .*j1"):
        package.simulate(model, waves(FOUR_BAR))
    model = model_of(tmp_path, FOUR_BAR, ('name="ground" pos="0.9', 'name="ground" pos="3'))
    with pytest.raises(package.ModelError, match="no posture near .* closes its loops: 'pin' is"):
        package.simulate(model, waves(FOUR_BAR))


def with_effects(model: package.Model, tmp_path: Path, effects: list[dict]) -> package.Model:
    """Return the model with effects in its file."""
    path = tmp_path / "with.json"
    model.save(path)
    text = json.loads(path.read_text())
    text["effects"] = effects
    path.write_text(json.dumps(text))
    return package.load_model(path)


def effect(name: str, where: str, **parameters: float) -> dict:
    """Return an effect as the JSON of a model has it."""
    return {
        "effect": name,
        "where": where,
        "parameters": [{"name": k, "value": v} for k, v in parameters.items()],
    }


def test_friction_of_a_joint_that_follows_reaches_the_drive(tmp_path: Path) -> None:
    """Its torque counts by the square of the ratio of speeds: virtual work."""
    viscous = 0.4
    plain = model_of(tmp_path, FOUR_BAR)
    model = with_effects(plain, tmp_path, [effect("viscous_friction", "j3", viscous=viscous)])
    r = package.simulate(model, waves(FOUR_BAR)).recording
    needed, held = held_torques(FOUR_BAR, r)
    h = 1e-6
    q = r.q[1:-1, :1]
    ratio = (FOUR_BAR.joints(q + h) - FOUR_BAR.joints(q - h))[:, 2] / (2 * h)
    speed = (r.q[2:, 0] - r.q[:-2, 0]) / (2 * (r.time[1] - r.time[0]))
    rubbing = viscous * ratio**2 * speed
    assert np.abs(rubbing).max() > 0.05  # of torques of 4 N·m
    # Differences in time leave as much as without friction.
    assert np.abs(needed[:, 0] + rubbing - held[:, 0])[5:].max() < 1e-3 * np.abs(needed).max()


def test_a_spring_in_the_drive_is_wound_by_the_whole_linkage(tmp_path: Path) -> None:
    """At rest the motor is ahead by what the drive holds, over the stiffness."""
    stiffness = 500.0
    plain = model_of(tmp_path, FOUR_BAR)
    model = with_effects(
        plain,
        tmp_path,
        [
            effect("armature", "j1", armature=0.05),
            effect(
                "joint_elasticity", "j1", stiffness=stiffness, damping=2.0, motor_inertia=0.05,
                friction_share=1.0, encoder_side=1.0,
            ),
        ],
    )  # fmt: skip
    t = np.arange(0, 2, 0.01)
    hold = np.full((len(t), 1), -1.1)
    still = package.Trajectory(time=t, q=hold, qd=0 * hold, qdd=0 * hold, joint_names=["j1"])
    r = package.simulate(model, still).recording
    # The encoder reads the motor; the followers are where the link is.
    link = r.q[-1, 0] - r.tau[-1, 0] / stiffness
    np.testing.assert_allclose(r.q[-1, 1:], FOUR_BAR.joints(np.array([[link]]))[0, 1:], atol=1e-4)
    np.testing.assert_allclose(
        r.tau[-1, 0], FOUR_BAR.torques(np.array([[link]]), *np.zeros((2, 1, 1)))[0, 0], rtol=1e-3
    )


def test_friction_that_follows_the_load_is_refused(tmp_path: Path) -> None:
    """The constraint changes the torque that a joint transmits."""
    plain = model_of(tmp_path, FOUR_BAR)
    model = with_effects(plain, tmp_path, [effect("load_friction", "j1", mu=0.1)])
    with pytest.raises(package.ModelError, match="load_friction at 'j1'.*'pin'"):
        package.simulate(model, waves(FOUR_BAR))
    with pytest.raises(package.ModelError, match="excite: load_friction at 'j1'"):
        package.design_excitation(model)


def test_the_command_refuses_what_a_world_lacks(tmp_path: Path) -> None:
    """A document without the loop is not the model's robot; nothing is written."""
    model_of(tmp_path, FOUR_BAR)
    path = tmp_path / "linkage.xml"
    open_loop = tmp_path / "open.xml"
    text = path.read_text()
    open_loop.write_text(text[: text.index("<equality>")] + text[text.index("</equality>") + 11 :])
    waves(FOUR_BAR).save(tmp_path / "motion.csv")
    said = diffnea(
        "simulate", path, "--trajectory", tmp_path / "motion.csv", "--world",
        f"mujoco:{open_loop},perturb=none", "-o", tmp_path / "log.csv",
    )  # fmt: skip
    assert said.returncode == BAD_INPUT
    assert "'pin'" in said.stderr
    assert not (tmp_path / "log.csv").exists()
