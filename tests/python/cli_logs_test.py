"""Logs whose joints, columns or units are not the model's: what the command makes of them."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from cli import BAD_INPUT, PENDULUM, diffnea, done, load, refused

import diffnea as module


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of the double pendulum, 20 s at 500 Hz."""
    folder = tmp_path_factory.mktemp("logs")
    motion, data = folder / "motion.csv", folder / "arm.csv"
    done("excite", PENDULUM, "-o", motion, "--seed", 1, "--quiet")
    done("simulate", PENDULUM, "--trajectory", motion, "--noise", 1, "-o", data, "--quiet")
    return data


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        rows = list(csv.reader(file))
    values = np.array(rows[1:], dtype=float)
    return {name: values[:, k] for k, name in enumerate(rows[0])}


def write(path: Path, columns: dict[str, np.ndarray]) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return path


def of(data: dict[str, np.ndarray], *names: str) -> dict[str, np.ndarray]:
    return {name: data[name] for name in names}


def test_a_joint_that_is_not_logged_is_locked(tmp_path: Path, log: Path) -> None:
    one = write(tmp_path / "one.csv", of(table(log), "time", "q_shoulder", "tau_shoulder"))
    answer = diffnea("identify", PENDULUM, one, "-o", tmp_path / "run")
    line = "locked: elbow at 0 rad, since the recordings do not have it (--lock JOINT=VALUE)"
    assert line in answer.stderr
    result = load(tmp_path / "run" / "result.json")
    assert result["notes"][0] == line
    assert list(result["rmse"]["train"]) == ["shoulder"]
    # The written model has the joint fixed, and is read again beside the same recording.
    assert 'type="fixed"' in (tmp_path / "run" / "model.urdf").read_text()
    for model in ("model.json", "model.urdf"):
        info = json.loads(done("info", tmp_path / "run" / model, "--json"))
        assert info["joints"] == ["shoulder"]
        assert "locked" not in diffnea("audit", log, "--model", tmp_path / "run" / model).stderr


def test_a_locked_joint_is_where_it_was_said(tmp_path: Path, log: Path) -> None:
    one = write(tmp_path / "one.csv", of(table(log), "time", "q_shoulder", "tau_shoulder"))
    bent = f"elbow={math.pi / 2}"
    done("identify", PENDULUM, one, "--lock", bent, "-o", tmp_path / "run", "--quiet")
    (lower,) = (x for x in load(tmp_path / "run" / "model.json")["links"] if x["name"] == "lower")
    assert lower["joint"]["type"] == "fixed"
    assert lower["joint"]["pose"]["rotation"][0] == pytest.approx([0, 0, 1], abs=1e-12)  # about y
    run = module.identify(PENDULUM, one, lock={"elbow": math.pi / 2})
    assert run.notes[0] == "locked: elbow at 1.571 rad"
    message = refused(tmp_path / "no", PENDULUM, one, "--lock", "elbw=0")
    assert "the model has no moving joint 'elbw'; joints: shoulder, elbow" in message


def test_an_mjcf_with_a_locked_joint_is_drawn_anew(tmp_path: Path) -> None:
    motion, data = tmp_path / "motion.csv", tmp_path / "data.csv"
    done("excite", "wam4", "-o", motion, "--seed", 1, "--quiet")
    words = ("wam4", "--trajectory", motion, "--lock", "joint4=0.5", "-o", data)
    answer = diffnea("simulate", *words)
    assert "locked: joint4 at 0.5 rad" in answer.stderr
    assert "q_joint4" not in data.read_text().splitlines()[0]
    done("identify", "wam4", data, "--lock", "joint4=0.5", "-o", tmp_path / "run", "--quiet")
    notes = " ".join(load(tmp_path / "run" / "result.json")["notes"])
    assert "original document, in which joints were locked" in notes
    for model in ("model.json", "model.xml"):
        info = json.loads(done("info", tmp_path / "run" / model, "--json"))
        assert info["joints"] == ["joint1", "joint2", "joint3"]


def test_a_part_s_values_go_into_the_whole_robot(tmp_path: Path) -> None:
    """The document keeps its joints, comments and what the part did not move."""
    data = tmp_path / "data.csv"
    motion = tmp_path / "motion.csv"
    words = ("--lock", "joint4=0.5")
    done("excite", "wam4", "-o", motion, "--seed", 1, "--quiet")
    done("simulate", "wam4", "--trajectory", motion, *words, "-o", data, "--quiet")
    done("identify", "wam4", data, *words, "-o", tmp_path / "run", "--quiet")
    whole = tmp_path / "whole.xml"
    answer = diffnea("export", tmp_path / "run", "--into", "wam4", "-o", whole)
    assert "torque_offset at joint1" in answer.stderr
    part, first, now = (
        module.load_model(x) for x in (tmp_path / "run" / "model.json", "wam4", whole)
    )
    assert now.joint_names == first.joint_names
    assert "<!--" in whole.read_text()
    # The link beyond the lock is as it was, and the whole with the joint held is the part.
    links = [{x["name"]: x for x in m.to_dict()["links"]} for m in (part, first, now)]
    last = links[1]["forearm"]["inertia"]
    assert "inertia" not in links[0]["forearm"]  # part of the upper arm's
    np.testing.assert_allclose(
        links[2]["forearm"]["inertia"]["about_origin"], last["about_origin"], rtol=0, atol=1e-12
    )
    rng = np.random.default_rng(0)
    q, qd, qdd = rng.normal(size=(3, 20, 4)) * [1, 1, 1, 0] + [[[0, 0, 0, 0.5]]] * np.array(
        [[[1]], [[0]], [[0]]]
    )
    tau = module.rnea(now, q=q, qd=qd, qdd=qdd)[:, :3]
    of_part = module.rnea(part, q=q[:, :3], qd=qd[:, :3], qdd=qdd[:, :3])
    np.testing.assert_allclose(tau, of_part, rtol=0, atol=1e-9)
    same = first.with_part(part).inertial_parameters
    np.testing.assert_allclose(now.inertial_parameters, same, rtol=0, atol=1e-9)
    answer = diffnea("export", tmp_path / "run", "--into", "panda", "-o", tmp_path / "no.urdf")
    assert answer.returncode == BAD_INPUT
    assert "has no link" in answer.stderr


def test_columns_of_other_joints_are_left_out(tmp_path: Path, log: Path) -> None:
    data = table(log)
    data |= {"q_wheel": data["time"], "tau_wheel": 0 * data["time"]}
    more = write(tmp_path / "more.csv", data)
    answer = diffnea("identify", PENDULUM, more, "-o", tmp_path / "more")
    assert "columns left out: those of wheel" in answer.stderr
    done("identify", PENDULUM, log, "-o", tmp_path / "plain")
    a, b = (load(tmp_path / x / "result.json")["parameters"] for x in ("more", "plain"))
    assert a == b


def test_names_in_two_spellings_are_asked_about(tmp_path: Path, log: Path) -> None:
    data = {name.replace("elbow", "Elbow_"): x for name, x in table(log).items()}
    other = write(tmp_path / "other.csv", data)
    message = refused(tmp_path / "run", PENDULUM, other)
    assert '--map "q_Elbow_=q_elbow"' in message
    names = ",".join(f"{name}={name.replace('Elbow_', 'elbow')}" for name in data if "Elb" in name)
    done("identify", PENDULUM, other, "--map", names, "-o", tmp_path / "run", "--quiet")
    (tmp_path / "names.json").write_text(
        json.dumps({name: name.replace("Elbow_", "elbow") for name in data if "Elb" in name})
    )
    done("audit", other, "--model", PENDULUM, "--map", tmp_path / "names.json")


def test_a_log_without_torque_is_told_so(tmp_path: Path, log: Path) -> None:
    data = of(table(log), "time", "q_shoulder", "q_elbow", "qcmd_shoulder", "qcmd_elbow")
    # Drives are fitted, though no servo leads this robot, whose controller knows its dynamics.
    blind = write(tmp_path / "blind.csv", {name: column[:1000] for name, column in data.items()})
    answer = diffnea("identify", PENDULUM, blind, "-o", tmp_path / "fit", "--quiet")
    assert "no joint has a torque column" not in answer.stderr
    assert "milliseconds" not in answer.stderr
    blinder = write(tmp_path / "blinder.csv", of(data, "time", "q_shoulder", "q_elbow"))
    for command in ("identify", "diagnose"):
        message = refused(tmp_path / "run", PENDULUM, blinder, command=command)
        assert "no joint has a torque column (tau_JOINT)" in message
    assert "milliseconds" not in message


def test_a_continuous_joint_is_unwrapped(tmp_path: Path) -> None:
    model = tmp_path / "wheel.urdf"
    model.write_text(
        '<robot name="wheel"><link name="base"/><link name="wheel"><inertial><mass value="1"/>'
        '<origin xyz="0.1 0 0"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
        '</inertial></link><joint name="hub" type="continuous"><parent link="base"/>'
        '<child link="wheel"/><axis xyz="0 1 0"/></joint></robot>'
    )
    time = np.arange(8000) / 200.0
    q = 8 * np.sin(0.9 * time) + 3 * np.sin(2.3 * time)
    qd = 7.2 * np.cos(0.9 * time) + 6.9 * np.cos(2.3 * time)
    qdd = -6.48 * np.sin(0.9 * time) - 15.87 * np.sin(2.3 * time)
    # (0.02 + izz) q̈ − m g l cos(q) about y, and friction.
    noise = np.random.default_rng(0).normal(scale=0.01, size=len(q))
    tau = 0.02 * qdd - 9.81 * 0.1 * np.cos(q) + 0.05 * np.tanh(qd / 0.01) + noise
    free = write(tmp_path / "free.csv", {"time": time, "q_hub": q, "tau_hub": tau})
    turn = (q + np.pi) % (2 * np.pi) - np.pi
    wrapped = write(tmp_path / "wrapped.csv", {"time": time, "q_hub": turn, "tau_hub": tau})
    fits = {}
    for name, data in (("free", free), ("wrapped", wrapped)):
        done("identify", model, data, "-o", tmp_path / name, "--quiet")
        fits[name] = load(tmp_path / name / "result.json")
    notes = fits["wrapped"]["preprocessing"]["notes"]
    assert any("unwrapped: q_hub (" in note for note in notes)
    for a, b in zip(fits["free"]["parameters"], fits["wrapped"]["parameters"], strict=True):
        assert a["value"] == pytest.approx(b["value"], rel=1e-6, abs=1e-9)


def test_an_effort_that_is_a_current_is_named(tmp_path: Path, log: Path) -> None:
    data = table(log)
    data["tau_shoulder"] = data["tau_shoulder"] / 12.0
    data["tau_elbow"] = data["tau_elbow"] / 9.0
    amps = write(tmp_path / "amps.csv", data)
    report = json.loads(done("audit", amps, "--model", PENDULUM, "--json"))
    (fault,) = (f for f in report["audit"] if f["fault"] == "effort_is_current")
    assert "torque_constant" in fault["evidence"]
    assert fault["value"] == pytest.approx(1 / 10.5, rel=0.3)
    plain = json.loads(done("audit", log, "--model", PENDULUM, "--json"))
    assert "effort_is_current" not in [f["fault"] for f in plain["audit"]]


def test_bad_maps_are_refused(tmp_path: Path, log: Path) -> None:
    for text, message in (
        ("q_elbow", "expected COLUMN=NAME"),
        ("nothing=q_elbow", "map: there is no column 'nothing'"),
        (tmp_path / "no.json", "no.json"),
    ):
        answer = diffnea("audit", log, "--map", text)
        assert answer.returncode == BAD_INPUT
        assert message in answer.stderr
