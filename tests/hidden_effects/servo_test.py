"""Effects hidden in a servo, of which commands and positions are logged and no torque."""

from pathlib import Path
from typing import Any

import pytest
from cli import done, load, refused
from servo_bench import GEARS, SIZES, Bench, write_case

SEED = 2001


def diagnosed(effect: str, folder: Path) -> tuple[Bench, Any]:
    bench = write_case(folder, effect, SEED)
    done(
        *("diagnose", folder / "bench.urdf", folder / "train.csv", "--test", folder / "test.csv"),
        *("-o", folder / "run", "--quiet"),
    )
    return bench, load(folder / "run/result.json")


def test_a_servo_that_lacks_nothing(tmp_path: Path) -> None:
    _, finding = diagnosed("none", tmp_path)
    assert finding["verdict"] == "NONE", finding["sentence"]
    assert finding["causes"] == []
    assert "your simulation is off by" in finding["sentence"]
    # No run needs a bound of the drive: at the edge of what was seen, it would hold others back.
    effects = load(tmp_path / "run/model.json")["effects"]
    (servo,) = (e for e in effects if e["effect"] == "position_servo")
    values = {p["name"]: p["value"] for p in servo["parameters"]}
    assert (values["reach"], values["speed"], values["dead_band"]) == (1000.0, 1000.0, 0.0)
    # Springs and gaps in gears have nothing left to explain, states of friction no derivative; a
    # reader is told.
    assert {r["effect"] for r in finding["refused"]} >= {
        *("backlash", "joint_elasticity"),
        "presliding_dahl",
    }


def test_a_servo_that_sticks_between_steps_lacks_nothing(tmp_path: Path) -> None:
    # Friction that is smoothed creeps by several counts in a wait: a false excess at standstill.
    write_case(tmp_path, "none", SEED, steps=True)
    done(
        *("diagnose", tmp_path / "bench.urdf", tmp_path / "train.csv"),
        *("--test", tmp_path / "test.csv", "-o", tmp_path / "run", "--quiet"),
    )
    finding = load(tmp_path / "run/result.json")
    assert finding["verdict"] == "NONE", finding["sentence"]
    (joint,) = finding["joints"]
    assert joint["base"] < 1.3 * joint["noise_floor"]


def test_bases_that_drives_cannot_have_are_refused(tmp_path: Path) -> None:
    write_case(tmp_path, "none", SEED, seconds=2.0)
    bench, data = tmp_path / "bench.urdf", tmp_path / "train.csv"
    message = refused(tmp_path / "run", bench, data, "--base", "fixed", command="diagnose")
    assert "--base: got fixed" in message
    assert "expected refit or auto" in message


@pytest.mark.parametrize("seed", [101, 104])
def test_a_gap_whose_rotor_begins_at_neither_flank(seed: int, tmp_path: Path) -> None:
    # The arm hangs where no load says which flank it is: the fit's first state is at a jump.
    bench = write_case(tmp_path, "backlash", seed)
    effects = "position_servo,armature,coulomb_friction,torque_offset,backlash"
    done(
        *("identify", tmp_path / "bench.urdf", tmp_path / "train.csv"),
        *("--effects", effects, "-o", tmp_path / "run", "--quiet"),
    )
    result = load(tmp_path / "run/result.json")
    assert result["summary"]["converged"]
    (gap,) = (p for p in result["parameters"] if p["name"].endswith("backlash.gap"))
    # Flanks of a fit give way a little, and its gap is that much smaller.
    assert gap["value"] == pytest.approx(bench.size, abs=3.0 * gap["std"] + 0.02 * bench.size)


@pytest.mark.parametrize("effect", sorted(set(SIZES) - {"none"}))
def test_it_is_named(effect: str, tmp_path: Path) -> None:
    bench, finding = diagnosed(effect, tmp_path)
    (cause,) = finding["causes"]
    assert (cause["effect"], cause["where"]) == (effect, "servo"), finding["sentence"]
    size = cause["parameters"][0]
    if effect == "cogging":  # a sine and a cosine
        value = (size["value"] ** 2 + cause["parameters"][1]["value"] ** 2) ** 0.5
        assert value == pytest.approx(bench.size, rel=0.05)
    elif effect == "asymmetric_viscous":  # the servo's damping takes over what both sides have
        assert size["value"] == pytest.approx(2.0 * bench.size, rel=0.05)
    else:
        assert size["std"] < 0.1 * bench.size  # told to a tenth, and no further off than that says
        assert size["value"] == pytest.approx(bench.size, abs=3.0 * size["std"] + 0.02 * bench.size)
    if effect == "backlash":  # flanks of a fit give way, the generator's do not
        low, high = size["ci95"]
        assert low <= bench.size <= high
        assert high - size["value"] > 1.1 * (size["value"] - low)
    if effect in GEARS:
        values = {p["name"]: p["value"] for p in cause["parameters"]}
        assert values["encoder_side"] == bench.at_motor
        assert values["motor_inertia"] == pytest.approx(bench.armature, rel=0.1)
    # On held-out motion nothing is left but the encoder.
    (joint,) = finding["joints"]
    assert joint["extended"] < min(1.5 * joint["noise_floor"], joint["base"])
