"""Models written in another form than they came in, and read back; the command that does it."""

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from cli import BAD_INPUT, MODELS, done
from cli import diffnea as command

import diffnea

ROBOTS = ["panda", "double_pendulum", "emps", "pendulum", "wam4", "wam4_ball", "cart_pole"]
JOINT_TERMS = {
    ".urdf": ("viscous_friction", "coulomb_friction"),
    ".xml": ("viscous_friction", "coulomb_friction", "armature", "joint_spring"),
}
#: Rotations through quaternions or roll, pitch, yaw, inertias through principal axes.
TOL = 1e-9


def states(model: diffnea.Model, rows: int = 20) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    return {name: rng.normal(size=(rows, model.num_joints)) for name in ("q", "qd", "qdd")}


def drawn(model: diffnea.Model, path: Path) -> tuple[diffnea.Model, list[str]]:
    """Write a model that knows no original document, and read it back."""
    left_out = diffnea.Model.from_dict(model.to_dict()).save(path)
    return diffnea.load_model(path), left_out


@pytest.mark.parametrize("suffix", [".urdf", ".xml"])
@pytest.mark.parametrize("name", ROBOTS)
def test_what_is_drawn_has_the_same_dynamics(tmp_path: Path, name: str, suffix: str) -> None:
    model = diffnea.load_model(name)
    back, left_out = drawn(model, tmp_path / f"robot{suffix}")
    assert back.joint_names == model.joint_names
    kept = JOINT_TERMS[suffix]
    bare = model.with_effects([e for e in model.effects if e.effect in kept])
    if suffix == ".urdf" and not np.array_equal(model.gravity, [0, 0, -9.81]):
        assert any(what.startswith("gravity") for what in left_out)
        pytest.skip("a URDF has the gravity of the Earth")
    x = states(model)
    expected = diffnea.rnea(bare, **x, effects=True)
    got = diffnea.rnea(back, **x, effects=True)
    np.testing.assert_allclose(got, expected, rtol=0, atol=TOL * max(1, np.abs(expected).max()))
    tau = expected
    forward = diffnea.aba(bare, q=x["q"], qd=x["qd"], tau=tau, effects=True)
    np.testing.assert_allclose(
        diffnea.aba(back, q=x["q"], qd=x["qd"], tau=tau, effects=True), forward, rtol=TOL, atol=1e-7
    )
    of = {(e.effect, e.where): e.parameters for e in back.effects}
    assert of == {(e.effect, e.where): e.parameters for e in bare.effects}
    for effect in model.effects:
        lost = any(what.startswith(f"{effect.effect} at {effect.where}") for what in left_out)
        assert lost == (effect.effect not in kept)


def test_a_ball_comes_through_an_mjcf(tmp_path: Path) -> None:
    for name in ("table_tennis", "wam4_ball_in_cup"):
        model = diffnea.load_model(name)
        back, left_out = drawn(model, tmp_path / "ball.xml")
        before, after = model.to_dict(), back.to_dict()
        assert after.keys() >= {"ball", "cup", "obstacles", "home"} & before.keys()
        for key in {"cup", "home"} & before.keys():
            assert after[key] == pytest.approx(before[key])
        assert after["ball"]["mass"] == before["ball"]["mass"]
        assert len(after.get("obstacles", [])) == len(before.get("obstacles", []))
        assert not [what for what in left_out if "ball" in what or "cup" in what]
        _, without = drawn(model, tmp_path / "ball.urdf")
        assert "the ball" in without


def test_mujoco_feels_the_friction_that_was_exported(rubbing_arm, tmp_path: Path) -> None:
    """The exported robot, simulated by MuJoCo, gives the torques that the model predicts."""
    back, _ = drawn(rubbing_arm, tmp_path / "arm.xml")
    motion = diffnea.excite(rubbing_arm, duration=10, seed=1)
    world = f"mujoco:{tmp_path / 'arm.xml'},perturb=none,noise=0"
    recorded = diffnea.simulate(back, motion, world=world, seed=1).recording
    result = diffnea.identify(back, recorded, fit=["effects"], effects=["torque_offset"])
    for error in result.errors:
        # Torque is held over 2 ms, and Coulomb friction slips where MuJoCo's sticks.
        assert error.nominal_train < 0.05 * error.torque_rms, error


@pytest.mark.parametrize("suffix", [".urdf", ".xml", ".json"])
def test_the_command_exports_a_model_and_says_what_is_lost(tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"wam{suffix}"
    answer = command("export", MODELS / "wam4.xml", "-o", out)
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout == f"{out}\n"
    lost = [] if suffix != ".urdf" else ["armature at joint1"]
    assert all(what in answer.stderr for what in lost)
    assert bool(lost) == bool(answer.stderr)
    report = json.loads(done("export", MODELS / "wam4.xml", "-o", out, "--json"))
    assert report["schema"] == "diffnea/export/1"
    assert report["format"] == {".urdf": "urdf", ".xml": "mjcf", ".json": "json"}[suffix]
    assert bool(report["left_out"]) == bool(lost)
    assert diffnea.load_model(out).num_joints == 4


def test_the_command_exports_what_a_run_fitted(run: Path, tmp_path: Path) -> None:
    fitted = diffnea.load_model(run)
    assert fitted.to_dict() == diffnea.load_model(run / "model.json").to_dict()
    for suffix in (".urdf", ".xml"):
        out = tmp_path / f"fitted{suffix}"
        left_out = json.loads(done("export", run, "-o", out, "--json"))["left_out"]
        assert "the posterior of the parameters" in left_out
        back = diffnea.load_model(out)
        x = states(fitted)
        kept = [e for e in fitted.effects if e.effect in JOINT_TERMS[suffix]]
        np.testing.assert_allclose(
            diffnea.rnea(back, **x, effects=True),
            diffnea.rnea(fitted.with_effects(kept), **x, effects=True),
            atol=TOL,
        )


def test_an_export_overwrites_no_input(tmp_path: Path) -> None:
    out = tmp_path / "arm.urdf"
    out.write_text((MODELS / "panda.urdf").read_text())
    answer = command("export", out, "-o", out)
    assert answer.returncode == BAD_INPUT
    assert "is an input" in answer.stderr
    answer = command("export", MODELS, "-o", out)
    assert answer.returncode == BAD_INPUT
    assert "no run of a robot" in answer.stderr
    answer = command("export", MODELS / "panda.urdf", "-o", tmp_path / "arm.sdf")
    assert answer.returncode == BAD_INPUT
    assert "choices: .json, .urdf, .xml" in answer.stderr


BODY = '<inertial pos="0 0 -.2" mass="1" diaginertia=".01 .01 .001"/>'


def test_couplings_stay_in_their_document(tmp_path: Path) -> None:
    """A gripper whose second finger follows by an equality is written in place."""
    finger = f'<body name="{{0}}"><joint name="{{0}}" type="slide" axis="0 1 0"/>{BODY}</body>'
    (tmp_path / "gripper.xml").write_text(
        f"<mujoco><!-- mine --><worldbody>{finger.format('left')}{finger.format('right')}"
        '</worldbody><equality><joint joint1="right" joint2="left" polycoef="0 -1 0 0 0"/>'
        "</equality></mujoco>"
    )
    gripper = diffnea.load_model(tmp_path / "gripper.xml")
    assert not gripper.save(tmp_path / "written.xml")
    assert "<!-- mine -->" in (tmp_path / "written.xml").read_text()
    assert diffnea.load_model(tmp_path / "written.xml").followers == gripper.followers


def test_meshes_are_found_from_the_new_place(tmp_path: Path) -> None:
    """MuJoCo looks beside the document that it reads, as loaders of a URDF do."""
    old, new = tmp_path / "robot", tmp_path / "runs" / "1"
    (old / "assets").mkdir(parents=True)
    new.mkdir(parents=True)
    mesh = old / "assets" / "part.stl"
    mesh.write_bytes(bytes(84))
    limb = f'<body name="a"><joint name="j"/>{BODY}<geom type="mesh" mesh="part"/></body>'
    for compiler in ('<compiler meshdir="assets"/>', '<compiler assetdir="assets"/>', ""):
        file = "part.stl" if compiler else "assets/part.stl"
        (old / "r.xml").write_text(
            f'<mujoco>{compiler}<asset><mesh name="part" file="{file}"/></asset>'
            f"<worldbody>{limb}</worldbody></mujoco>"
        )
        diffnea.load_model(old / "r.xml").save(new / "r.xml")
        root = ElementTree.parse(new / "r.xml").getroot()
        folders = [c.get("meshdir") or c.get("assetdir") for c in root.iter("compiler")]
        assert (new / str(folders[-1]) / file).resolve() == mesh.resolve()
        diffnea.load_model(new / "r.xml").save(old / "again.xml")  # there and back
        assert "runs" not in (old / "again.xml").read_text()
    tensor = '<inertia ixx="1" iyy="2" izz="2" ixy="0" ixz="0" iyz="0"/>'
    inertial = f'<inertial><mass value="1"/>{tensor}</inertial>'
    looks = "".join(
        f'<visual><geometry><mesh filename="{f}"/></geometry></visual>'
        for f in ("assets/part.stl", "package://robot/part.stl")
    )
    (old / "r.urdf").write_text(
        f'<robot name="r"><link name="b"/><link name="a">{inertial}{looks}</link><joint name="j" '
        'type="continuous"><parent link="b"/><child link="a"/><axis xyz="0 1 0"/></joint></robot>'
    )
    diffnea.load_model(old / "r.urdf").save(new / "r.urdf")
    there, package = (
        m.get("filename", "") for m in ElementTree.parse(new / "r.urdf").getroot().iter("mesh")
    )
    assert (new / there).resolve() == mesh.resolve()
    assert package == "package://robot/part.stl"
