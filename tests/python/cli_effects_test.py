"""``diffnea effects``, and what the other commands do with a model that has one with memory."""

import json
from pathlib import Path

from cli import BAD_INPUT, MODELS, diffnea, done

from diffnea import effects as effects_in_python


def test_effects_are_listed_for_people_and_programs() -> None:
    listed = json.loads(done("effects", "--json"))
    assert listed["schema"] == "diffnea/effects/1"
    effects = {e["effect"]: e for e in listed["effects"]}
    assert len(effects) == 55
    lag = effects["actuator_lag"]
    assert lag["acts_on"] == "torque with memory"
    assert [(p["name"], p["unit"]) for p in lag["parameters"]] == [("time_constant", "s")]
    assert effects_in_python() == listed["effects"]
    text = done("effects")
    for name in effects:
        assert f"\n{name}   " in text


def test_a_late_drive_is_simulated_and_identify_says_who_fits_it(
    tmp_path: Path,
) -> None:
    model = json.loads((MODELS / "pendulum.json").read_text(encoding="utf-8"))
    joint = model["links"][-1]["joint"]
    joint.pop("passive", None)
    joint["limits"] = {"lower": -3, "upper": 3, "velocity": 5, "effort": 20}
    lag = {"name": "time_constant", "value": 0.02, "unit": "s"}
    model["effects"] = [{"effect": "actuator_lag", "where": joint["name"], "parameters": [lag]}]
    late, motion, data = tmp_path / "late.json", tmp_path / "motion.csv", tmp_path / "data.csv"
    late.write_text(json.dumps(model), encoding="utf-8")
    done("excite", late, "-o", motion, "--duration", 4)
    done("simulate", late, "--trajectory", motion, "-o", data)
    assert len(data.read_text(encoding="utf-8").splitlines()) > 1000
    refused = diffnea("identify", late, data, "-o", tmp_path / "run")
    assert refused.returncode == BAD_INPUT
    assert f"cannot fit actuator_lag at '{joint['name']}'" in refused.stderr
    assert "diffnea diagnose" in refused.stderr
