"""The motion that `diffnea diagnose` proposes where a cause has no one name, recorded in turn."""

import json
from pathlib import Path
from typing import Any

from cli import PENDULUM, done, load, schema

SCHEMA = schema("diagnose")["$defs"]["NextExperiment"]


def late_pendulum(folder: Path) -> Path:
    """A double pendulum whose shoulder's drive lags by 8 ms."""
    motion, late = folder / "any.csv", folder / "late.json"
    done("excite", PENDULUM, "--iterations", 0, "--duration", 4, "-o", motion, "--quiet")
    out = folder / "any_data.csv"
    done("simulate", PENDULUM, "--trajectory", motion, "-o", out, "--truth", late, "--quiet")
    model = json.loads(late.read_text(encoding="utf-8"))
    lag = {"name": "time_constant", "value": 0.008, "unit": "s"}
    model["effects"].append({"effect": "actuator_lag", "where": "shoulder", "parameters": [lag]})
    late.write_text(json.dumps(model), encoding="utf-8")
    return late


def record(late: Path, motion: Path, out: Path, seed: int) -> Path:
    common = ("--noise", 1, "--seed", seed, "--period", 10, "--quiet")
    done("simulate", late, "--trajectory", motion, "-o", out, *common)
    return out


def finding(run: Path, train: Path, test: Path) -> Any:
    asked = ("--effects", "actuator_lag,actuator_delay")
    done("diagnose", PENDULUM, train, "--test", test, *asked, "-o", run, "--quiet")
    return load(run / "result.json")


def test_the_proposed_motion_tells_what_the_recording_could_not(tmp_path: Path) -> None:
    late = late_pendulum(tmp_path)
    slow = []
    for seed in (1, 2):
        motion = tmp_path / f"motion{seed}.csv"
        common = ("--iterations", 0, "--duration", 40, "--seed", seed)
        done("excite", PENDULUM, *common, "-o", motion, "--quiet")
        slow.append(record(late, motion, tmp_path / f"slow{seed}.csv", seed))
    before = finding(tmp_path / "before", *slow)
    assert before["verdict"] == "CLASS"
    proposal = before["next_experiment"]
    assert set(SCHEMA["required"]) <= set(proposal)
    assert [sorted(pair) for pair in proposal["separates"]] == [["actuator_delay", "actuator_lag"]]
    (pair,) = proposal["pairs"]
    assert pair["expected_delta_bic"] > 10 > pair["delta_bic"]
    page = (tmp_path / "before" / "report.html").read_text(encoding="utf-8")
    assert "Next experiment" in page
    assert proposal["trajectory"] in page

    motion = tmp_path / "before" / proposal["trajectory"]
    fast = record(late, motion, tmp_path / "fast.csv", 3)
    after = finding(tmp_path / "after", fast, slow[1])
    assert after["verdict"] == "NAMED"
    assert [(c["effect"], c["where"]) for c in after["causes"]] == [("actuator_lag", "shoulder")]
    assert after["next_experiment"] is None
    assert not (tmp_path / "after" / "next_experiment.csv").exists()
