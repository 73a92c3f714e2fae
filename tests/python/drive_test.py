"""Drives of a model in the loop of another simulator."""

from pathlib import Path

import diffnea
import numpy as np
import pytest
from numpy.testing import assert_allclose

NAN = float("nan")


ARM = """<robot name="bench"><link name="base"/>
<link name="arm"><inertial><origin xyz="0 0 -0.2"/><mass value="0.5"/>
<inertia ixx="0.001" iyy="0.001" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="servo" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-3.14" upper="3.14" effort="3" velocity="9"/></joint></robot>
"""


def swing(folder: Path, **servo: float) -> diffnea.Model:
    """A pendulum of 0.5 kg at 0.2 m behind a servo."""
    file = folder / "bench.urdf"
    file.write_text(ARM, encoding="utf-8")
    model = diffnea.load_model(file)
    joint = model.joint_names[0]
    values = {"stiffness": 4.0, "damping": 0.3, "delay": 0.0} | servo
    return model.with_effects([diffnea.Effect("position_servo", joint, values)])


def test_law_of_the_servo(tmp_path: Path) -> None:
    drive = diffnea.Drive(swing(tmp_path, dead_band=0.1, reach=0.5))
    assert_allclose(drive(0.0, [0.3], [0.0], [0.2]), [4.0 * 0.2 - 0.3 * 0.2])
    assert_allclose(drive(0.1, [0.05], [0.0], [0.0]), [0.0])
    assert_allclose(drive(0.2, [-9.0], [0.0], [0.0]), [-4.0 * 0.5])
    assert_allclose(drive(0.3, [NAN], [0.0], [1.0]), [0.0])
    within = diffnea.Drive(swing(tmp_path, derivative_time=0.05, reach=0.5))
    assert_allclose(within(0.0, [0.3], [0.0], [0.2]), [4.0 * 0.3 - 0.3 * 0.2])
    assert_allclose(within(0.1, [9.0], [0.0], [0.2]), [4.0 * 0.5 - 0.1 * 0.2])
    without = diffnea.Drive(swing(tmp_path), damping=False, gain=2.0)
    assert_allclose(without(0.0, [0.3], [0.1], [7.0]), [4.0 * 2.0 * 0.2])


def test_an_offset_acts_whether_the_drive_is_on_or_off(tmp_path: Path) -> None:
    model = swing(tmp_path)
    offset = diffnea.Effect("torque_offset", model.joint_names[0], {"offset": 0.3})
    drive = diffnea.Drive(model.with_effects([*model.effects, offset]), damping=False)
    assert_allclose(drive(0.0, [0.5], [0.0], [0.0]), [4.0 * 0.5 - 0.3])
    assert_allclose(drive(0.1, [NAN], [0.0], [0.0]), [-0.3])


def test_a_supply_that_sags(tmp_path: Path) -> None:
    model = swing(tmp_path, reach=0.5)
    sag = diffnea.Effect("supply_sag", model.joint_names[0], {"share": 0.8, "nominal": 7.5})
    drive = diffnea.Drive(model.with_effects([*model.effects, sag]))
    assert_allclose(drive(0.0, [9.0], [0.0], [0.2], supply=6.0), [4.0 * 0.5 * 0.84 - 0.3 * 0.2])
    assert_allclose(drive(0.1, [9.0], [0.0], [0.2]), [4.0 * 0.5 - 0.3 * 0.2])  # the nominal one


def test_what_is_told_beside_positions(tmp_path: Path) -> None:
    model = swing(tmp_path, delay=0.02)
    fed = diffnea.Effect("feed_forward", model.joint_names[0], {"damping": 0.5, "share": 0.9})
    drive = diffnea.Drive(model.with_effects([*model.effects, fed]))
    at_rest = {"q": [0.0], "qd": [0.0]}
    assert_allclose(drive(0.0, [0.0], **at_rest, velocity=[1.0], torque=[2.0]), [0.5 + 1.8])
    assert_allclose(drive(0.01, [0.0], **at_rest, velocity=[3.0]), [0.5 + 1.8])  # late
    assert_allclose(drive(0.03, [0.0], **at_rest), [1.5])
    assert_allclose(drive(0.04, [NAN], **at_rest, torque=[2.0]), [0.0])
    assert_allclose(drive(0.06, [0.0], **at_rest, velocity=[NAN], torque=[NAN]), [1.8])
    assert_allclose(drive(0.08, [0.0], **at_rest), [0.0])  # a gap is none
    # Without the effect they do nothing.
    plain = diffnea.Drive(swing(tmp_path))
    assert_allclose(plain(0.0, [0.0], **at_rest, velocity=[1.0], torque=[2.0]), [0.0])


def test_an_integral(tmp_path: Path) -> None:
    model = swing(tmp_path, reach=0.5)
    rate = diffnea.Effect("integral_action", model.joint_names[0], {"rate": 2.0})
    drive = diffnea.Drive(model.with_effects([*model.effects, rate]), damping=False)
    told = [drive(0.1 * k, [0.1], [0.0], [0.0])[0] / 4.0 for k in range(4)]
    assert_allclose(told, [0.1, 0.12, 0.14, 0.16])
    assert_allclose(drive(0.4, [NAN], [0.0], [0.0]), [0.0])
    assert_allclose(drive(0.5, [0.0], [0.0], [0.0])[0] / 4.0, 0.08)  # the sum is kept
    drive(0.6, [0.6], [0.0], [0.0])  # saturates: nothing more is summed up
    drive(9.0, [0.6], [0.0], [0.0])
    assert_allclose(drive(9.1, [0.0], [0.0], [0.0])[0] / 4.0, 0.08)
    drive.reset()
    assert_allclose(drive(0.0, [0.1], [0.0], [0.0])[0] / 4.0, 0.1)


def test_a_delay_and_a_speed(tmp_path: Path) -> None:
    late = diffnea.Drive(swing(tmp_path, delay=0.02))
    told = [late(0.01 * k, [1.0 if k > 0 else 0.0], [0.0], [0.0])[0] / 4.0 for k in range(5)]
    assert told == [0.0, 0.0, 0.0, 1.0, 1.0]
    slow = diffnea.Drive(swing(tmp_path, speed=5.0))
    slow(0.0, [0.0], [0.0], [0.0])
    led = [slow(0.1 * k, [1.2], [0.0], [0.0])[0] / 4.0 for k in range(1, 5)]
    assert_allclose(led, [0.0, 0.5, 1.0, 1.2])  # told at 0.1 s
    slow.reset()
    assert_allclose(slow(0.0, [1.2], [0.0], [0.0]), [4.8])


def test_what_a_drive_refuses(tmp_path: Path) -> None:
    model = swing(tmp_path)
    with pytest.raises(diffnea.ModelError, match="no position servo"):
        diffnea.Drive(model.with_effects([]))
    with pytest.raises(diffnea.ModelError, match="no position servo at elbow; there are at servo"):
        diffnea.Drive(model, ["elbow"])
    with pytest.raises(ValueError, match="gain"):
        diffnea.Drive(model, gain=0.0)
    drive = diffnea.Drive(model)
    with pytest.raises(ValueError, match=r"shape \(2,\)"):
        drive(0.0, [0.0, 0.0], [0.0, 0.0], [0.0, 0.0])
    drive(0.1, [0.0], [0.0], [0.0])
    with pytest.raises(ValueError, match="expected it to ascend"):
        drive(0.0, [0.0], [0.0], [0.0])


def test_robots_at_once_are_as_one_by_one(tmp_path: Path) -> None:
    model = swing(tmp_path, delay=0.03, speed=3.0, dead_band=0.01)
    rng = np.random.default_rng(1)
    commands = rng.normal(size=(20, 3, 1))
    both = diffnea.Drive(model)
    at_once = [both(0.01 * k, c, 0.1 * c, c) for k, c in enumerate(commands)]
    for robot in range(3):
        one = diffnea.Drive(model)
        for k, c in enumerate(commands[:, robot]):
            assert_allclose(one(0.01 * k, c, 0.1 * c, c), at_once[k][robot], rtol=1e-12)


def test_friction_of_the_load(tmp_path: Path) -> None:
    model = swing(tmp_path)
    joint = model.joint_names[0]
    model = model.with_effects(
        [
            *model.effects,
            diffnea.Effect("coulomb_friction", joint, {"coulomb": 0.1}),
            diffnea.Effect("load_friction", joint, {"mu": 0.2, "braking_ratio": 0.5}),
        ]
    )
    drive = diffnea.Drive(model)
    assert_allclose(drive.frictionloss([0.1], [2.0]), [0.1 + 0.4])
    assert_allclose(drive.frictionloss([-0.1], [2.0]), [0.1 + 0.2])


def test_the_library_finds_the_drive_that_moved_a_robot(tmp_path: Path) -> None:
    """Commands in steps, simulated here; what the library identifies is the drive."""
    truth = {"stiffness": 6.0, "damping": 0.3, "delay": 0.013, "speed": 6.0}
    model = swing(tmp_path, **truth)
    joint = model.joint_names[0]
    links = model.with_effects([])
    row, step = 0.02, 2e-4
    time = np.arange(0.0, 6.0, row)
    steps = np.where(np.floor(time / 0.5) % 2 == 0, 0.0, 0.6)
    command = (steps + 0.3 * np.sin(5.0 * time))[:, None]
    drive = diffnea.Drive(model)
    q, qd, seen = np.zeros(1), np.zeros(1), []
    for k, told in enumerate(command):
        seen.append(q.copy())
        for i in range(round(row / step)):
            tau = drive(k * row + i * step, told, q, qd)
            qd = qd + step * diffnea.aba(links, q=q, qd=qd, tau=tau)
            q = q + step * qd
    noise = np.random.default_rng(1).normal(scale=2e-4, size=command.shape)
    recording = diffnea.Recording(
        time=time,
        q=np.array(seen) + noise,
        tau=np.full_like(command, NAN),
        qcmd=command,
        joint_names=model.joint_names,
    )
    found = diffnea.identify(links, recording, effects=["position_servo"]).parameters
    for name, value in truth.items():
        got = found[f"{joint}.position_servo.{name}"].value
        assert_allclose(got, value, rtol=0.03, err_msg=name)
