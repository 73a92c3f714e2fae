"""`diffnea audit` and `diffnea.audit` on files with faults that the test wrote into them."""

import json
import pickle
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from cli import BAD_INPUT, WRONG_USAGE, diffnea, done, schema

import diffnea as module

TIME = np.arange(0, 20, 0.004)


def columns() -> dict[str, np.ndarray]:
    """Two joints with friction, their measured velocities, and noise."""
    random = np.random.default_rng(1)
    out = {"time": TIME}
    for k, joint in enumerate(("shoulder", "elbow")):
        w = 2 * np.pi / 5 * np.array([1, 2 + k, 5])
        phase = np.array([0.3, 1.0 + k, 2.0])
        angle = w * TIME[:, None] + phase
        q = (np.sin(angle) * [0.8, 0.3, 0.1]).sum(1)
        qd = (w * np.cos(angle) * [0.8, 0.3, 0.1]).sum(1)
        tau = 8 * np.sin(q) + np.tanh(qd / 0.02) + 0.3 * qd
        out[f"q_{joint}"] = q + 2e-5 * random.standard_normal(len(TIME))
        out[f"qd_{joint}"] = qd + 2e-3 * random.standard_normal(len(TIME))
        out[f"tau_{joint}"] = tau + 0.02 * random.standard_normal(len(TIME))
    return out


def write(path: Path, data: dict[str, np.ndarray]) -> Path:
    text = np.column_stack(list(data.values()))
    np.savetxt(path, text, delimiter=",", header=",".join(data), comments="", fmt="%.9g")
    return path


def audited(path: Path, *arguments: object) -> dict:
    answer = json.loads(done("audit", path, "--json", *arguments))
    jsonschema.validate(answer, schema("audit"))
    return answer


def test_a_clean_file_has_no_fault(tmp_path: Path) -> None:
    answer = audited(write(tmp_path / "arm.csv", columns()))
    assert answer["audit"] == []
    assert answer["rows"] == len(TIME)
    assert answer["periods"][0]["seconds"] == pytest.approx(5, abs=1e-3)
    assert "no channel fault" in done("audit", tmp_path / "arm.csv")


def test_faults_are_named_with_channel_and_size(tmp_path: Path) -> None:
    data = columns()
    data["qd_elbow"] = 1.05 * data["qd_elbow"]
    data["tau_shoulder"] = np.minimum(data["tau_shoulder"], 5.0)
    data["tau_elbow"] = np.zeros_like(TIME)
    data["time"] = np.where(TIME < 10, TIME, TIME + 0.5)
    path = write(tmp_path / "arm.csv", data)
    lines = path.read_text().splitlines()
    lines.insert(100, lines[99])
    path.write_text("\n".join(lines) + "\n")
    faults = {f["fault"]: f for f in audited(path)["audit"]}
    assert set(faults) == {
        "velocity_scale",
        "torque_clipped",
        "dead_channel",
        "time_gap",
        "repeated_time",
    }
    assert faults["velocity_scale"]["channel"] == "qd_elbow"
    assert faults["velocity_scale"]["value"] == pytest.approx(
        1.05, abs=5 * faults["velocity_scale"]["std"] + 1e-3
    )
    assert faults["torque_clipped"]["value"] == 5.0
    assert faults["dead_channel"]["where"] == "elbow"
    assert faults["time_gap"]["value"] == pytest.approx(0.504)
    text = done("audit", path)
    for name, fault in faults.items():
        assert name in text
        assert fault["channel"] in text
    assert "dead_channel" not in {f["fault"] for f in audited(path, "--passive", "elbow")["audit"]}


def test_the_model_brings_limits(tmp_path: Path, arm) -> None:
    arm.save(tmp_path / "arm.json")
    data = columns()
    data["q_elbow"] = np.rad2deg(data["q_elbow"])
    data["qd_elbow"] = np.rad2deg(data["qd_elbow"])
    path = write(tmp_path / "data.csv", data)
    answer = audited(path, "--model", tmp_path / "arm.json")
    assert answer["model"] == arm.name
    assert [f["fault"] for f in answer["audit"]] == ["degrees"]


def test_python_says_what_the_command_says(tmp_path: Path) -> None:
    data = columns()
    data["qd_shoulder"] = -data["qd_shoulder"]
    path = write(tmp_path / "arm.csv", data)
    report = module.audit(path)
    assert report.to_dict() == audited(path)
    (fault,) = report.faults
    assert (fault.fault, fault.channel, fault.severity) == (
        "velocity_sign",
        "qd_shoulder",
        "fault",
    )
    assert fault.value == pytest.approx(-1, abs=1e-3)
    assert "velocity_sign" in report._repr_html_()
    assert "velocity_sign" in repr(report)
    assert pickle.loads(pickle.dumps(report)).to_dict() == report.to_dict()
    recording = module.read_recording(path)
    assert [f.fault for f in module.audit(recording).faults] == ["velocity_sign"]
    assert module.detect_period(recording).seconds == pytest.approx(5, abs=1e-3)


def test_what_cannot_be_audited_says_why(tmp_path: Path, arm) -> None:
    arm.save(tmp_path / "arm.json")
    data = {name.replace("elbow", "elbw"): values for name, values in columns().items()}
    path = write(tmp_path / "one.csv", data)
    answer = diffnea("audit", path, "--model", tmp_path / "arm.json")
    assert answer.returncode == BAD_INPUT
    assert "the joints are not the model's" in answer.stderr
    assert '--map "q_elbw=q_elbow"' in answer.stderr
    assert diffnea("audit", tmp_path / "nowhere.csv").returncode == BAD_INPUT
    answer = diffnea("audit", tmp_path / "arm.json", path)  # as the other commands have it
    assert answer.returncode == BAD_INPUT
    assert f"{tmp_path / 'arm.json'}: is no recording" in answer.stderr
    assert "--model" in answer.stderr
    with pytest.raises(module.FileError, match=r"\.json files are not read"):
        module.audit([tmp_path / "arm.json", path])
    assert diffnea("audit", path, "--significance", "1").returncode == WRONG_USAGE
    assert diffnea("audit").returncode == WRONG_USAGE
    with pytest.raises(module.FileError, match=r"nowhere\.csv"):
        module.audit(tmp_path / "nowhere.csv")
