"""Servos of a model as MuJoCo's actuators: what the file holds, and how it plays there."""

from pathlib import Path

import diffnea
import numpy as np
import pytest
from cli import BAD_INPUT, done
from cli import diffnea as command
from drive_test import swing

DELAY = 0.0213  # [s]


def late(folder: Path) -> diffnea.Model:
    """A pendulum behind a servo that answers late, with a rotor."""
    model = swing(folder, delay=DELAY, reach=1.5)
    rotor = diffnea.Effect("armature", model.joint_names[0], {"armature": 0.01})
    return model.with_effects([*model.effects, rotor])


def test_a_delay_is_written_where_the_version_has_it(tmp_path: Path) -> None:
    model, file = late(tmp_path), tmp_path / "robot.xml"
    assert any(what.startswith("delay") for what in model.save(file))
    assert "delay" not in file.read_text(encoding="utf-8")
    assert not any(what.startswith("delay") for what in model.save(file, mujoco="3.5"))
    assert f'delay="{DELAY}"' in file.read_text(encoding="utf-8")
    back = diffnea.load_model(file)  # the model itself has no word for it
    assert back.joint_names == model.joint_names


def test_the_command_names_the_version(tmp_path: Path) -> None:
    model = tmp_path / "robot.json"
    late(tmp_path).save(model)
    said = done("export", model, "--mujoco", "3.5", "-o", tmp_path / "new.xml")
    assert "new.xml" in said
    assert "nsample" in (tmp_path / "new.xml").read_text(encoding="utf-8")
    for version in ("1.9", "new"):
        answer = command("export", model, "--mujoco", version, "-o", tmp_path / "no.xml")
        assert answer.returncode == BAD_INPUT
        assert "2.2" in answer.stderr and "3.5" in answer.stderr


def test_what_mujoco_plays_answers_as_late_as_the_model(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", minversion="3.5", reason="actuators without a delay")
    model, file = late(tmp_path), tmp_path / "robot.xml"
    model.save(file, mujoco="3.5")
    rate, rows = 100, 300
    told = np.where(np.arange(rows) < 20, 0.0, 0.4) + 0.2 * np.sin(0.06 * np.arange(rows))
    told -= told[0]
    drive = diffnea.Drive(model, damping=False)

    def play(file: Path, by_drive: bool) -> np.ndarray:
        world = mujoco.MjModel.from_xml_path(str(file))
        world.opt.timestep = 5e-4
        if by_drive:
            world.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
        data = mujoco.MjData(world)
        seen = []
        for command in told:
            seen.append(data.qpos[0])
            data.ctrl[0] = command
            for _ in range(round(1 / rate / world.opt.timestep)):
                if by_drive:
                    data.qfrc_applied[:] = drive(data.time, [command], data.qpos, data.qvel)
                mujoco.mj_step(world, data)
        return np.array(seen)

    whole = play(file, by_drive=True)
    model.save(tmp_path / "early.xml")
    early = np.abs(play(tmp_path / "early.xml", by_drive=False) - whole).max()
    # Within a step of the simulation the file's delay is interpolated, the drive's is not.
    assert np.abs(play(file, by_drive=False) - whole).max() < 0.05 * early
