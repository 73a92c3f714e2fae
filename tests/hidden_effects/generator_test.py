"""The generator: what it hides is there, in the size it says, and nowhere else."""

import json
import math
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli import done, load

Generate = Callable[..., tuple[Path, dict[str, Any]]]

HERE = Path(__file__).resolve().parent
SEEN = {"model.xml", "train.csv", "train.json", "test.csv", "test.json"}
SHORT = ("--duration", 10)

# Runge–Kutta at 0.5 ms, midpoints in the bookkeeping: 1e-7 to 6e-7 observed, most in fast motions.
INTEGRATION = 2e-6
# Scaled to 10 % on one period of a motion without noise.
SIZE_TOLERANCE = 0.15
# What a hidden friction's shape (a hard or smooth sign) shifts its fitted value by; 1.3 % observed.
SHAPE_TOLERANCE = 0.05


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_a_seed_makes_the_same_case_again_and_another_seed_another(generate: Generate) -> None:
    first, _ = generate("joint_spring", 7, *SHORT)
    again, _ = generate("joint_spring", 7, *SHORT)
    other, _ = generate("joint_spring", 8, *SHORT)
    assert contents(first) == contents(again)
    assert contents(first)["seen/train.csv"] != contents(other)["seen/train.csv"]


def test_train_and_test_are_other_motions_of_one_robot(generate: Generate) -> None:
    folder, _ = generate("none", 3, *SHORT)
    train, test = ((folder / "seen" / name).read_text() for name in ("train.csv", "test.csv"))
    assert train.splitlines()[0] == test.splitlines()[0]
    assert train.splitlines()[1] != test.splitlines()[1]


@pytest.mark.parametrize("seed", range(4))
def test_nothing_hidden_leaves_mujoco_to_itself(generate: Generate, seed: int) -> None:
    _, truth = generate("none", seed, *SHORT)
    assert truth["effects"] == []
    assert max(truth["effect_share"]) < INTEGRATION


@pytest.mark.parametrize("seed", range(3))
def test_nothing_hidden_is_fitted_to_the_noise(
    generate: Generate, tmp_path: Path, seed: int
) -> None:
    folder, truth = generate("none", seed, "--position-noise", 0.1)
    seen, run = folder / "seen", tmp_path / "run"
    done("identify", seen / "model.xml", seen / "train.csv", "-o", run, "--quiet")
    result = load(run / "result.json")
    recording, output_rate = truth["recording"], result["preprocessing"]["decimated_to_hz"]
    # White noise in the band that is left; coloured noise keeps more of itself, at most all.
    share = min(1.0, output_rate / recording["rate"])
    if recording["torque_noise_corner"]:
        share = min(1.0, 2 * output_rate / recording["torque_noise_corner"])
    for rmse, noise in zip(
        result["rmse"]["train"].values(), recording["torque_noise"], strict=True
    ):
        # 40 s of 10 Hz leave 400 values: 4 % of spread, thrice that, and the positions' noise,
        # whose accelerations are a tenth of the torque's noise where they are most.
        assert rmse < 1.3 * noise * math.sqrt(share)


@pytest.mark.parametrize(
    "family",
    [
        "coulomb_friction",
        "viscous_friction",
        "armature",
        "joint_spring",
        "cogging",
        "torque_offset",
        "actuator_delay",
        "presliding_dahl",
        "base_tilt",
    ],
)
def test_the_effect_has_the_size_that_was_asked_for(generate: Generate, family: str) -> None:
    _, truth = generate(family, 5, "--smallest", 0.02, "--largest", 0.02)
    (effect,) = truth["effects"]
    assert effect["effect"] == family
    assert effect["size"] == pytest.approx(0.02, rel=SIZE_TOLERANCE)
    assert max(truth["effect_share"]) == pytest.approx(effect["size"])
    assert effect["expected_lm"] <= effect["raw_lm"]


def test_position_noise_hides_fast_effects_not_slow_ones(generate: Generate) -> None:
    reached = {}
    for family in ("backlash", "torque_gain"):
        for noise in (0, 1):
            _, truth = generate(family, 5, "--position-noise", noise)
            (effect,) = truth["effects"]
            reached[family, noise] = effect["reachable_lm"] / effect["expected_lm"]
    # Parseval: without noise all frequencies count alike.
    assert reached["torque_gain", 0] == pytest.approx(1.0, abs=0.02)
    assert reached["backlash", 0] > 0.99  # means over 1/50 s smooth the impulses
    assert reached["backlash", 1] < 0.8 * reached["backlash", 0]
    assert reached["torque_gain", 1] > 0.9 * reached["torque_gain", 0]


def test_other_joints_stay_as_they_are(generate: Generate) -> None:
    _, truth = generate("cogging", 2, *SHORT)
    shares = sorted(truth["effect_share"])
    assert shares[-1] == pytest.approx(truth["effects"][0]["size"])
    assert all(share < INTEGRATION for share in shares[:-1])


@pytest.mark.parametrize("seed", range(6))
def test_absorbed_effects_are_absorbed(generate: Generate, seed: int) -> None:
    _, truth = generate("absorbed", seed)
    (effect,) = truth["effects"]
    # What is left is the integration's error, or what the model declares at the same joint.
    assert effect["visible_share"] < 1e-3
    assert effect["size"] > 1e-3


@pytest.mark.parametrize("family", ["two", "three"])
def test_several_effects_are_different_ones_at_different_joints(
    generate: Generate, family: str
) -> None:
    _, truth = generate(family, 1)
    count = {"two": 2, "three": 3}[family]
    assert len({e["effect"] for e in truth["effects"]}) == count
    assert len({e["where"] for e in truth["effects"]}) == count


def test_identify_finds_the_hidden_friction(generate: Generate, tmp_path: Path) -> None:
    folder, truth = generate("coulomb_friction", 4, "--smallest", 0.05, "--largest", 0.05)
    seen, run = folder / "seen", tmp_path / "run"
    done("identify", seen / "model.xml", seen / "train.csv", "-o", run, "--quiet")
    (hidden,) = truth["effects"]
    fitted = [
        e["parameters"][0]["value"]
        for e in load(run / "result.json")["effects"]
        if (e["effect"], e["where"]) == ("coulomb_friction", hidden["where"])
    ]
    assert fitted == [pytest.approx(hidden["parameters"]["coulomb"], rel=SHAPE_TOLERANCE)]


def test_what_is_seen_does_not_tell_the_truth(generate: Generate) -> None:
    folder, truth = generate("stribeck_friction", 1, *SHORT)
    assert {path.name for path in (folder / "seen").iterdir()} == SEEN
    assert {path.name for path in folder.iterdir()} == {"seen", "truth"}
    for name in ("model.xml", "train.json", "test.json"):
        text = (folder / "seen" / name).read_text()
        assert "stribeck" not in text
        assert "seed" not in text
    header = (folder / "seen" / "train.csv").read_text().splitlines()[0]
    channels = {re.sub(r"_.*", "", name) for name in header.split(",")}
    assert channels <= {"time", "q", "qd", "tau", "qcmd"}
    assert truth["effects"][0]["effect"] == "stribeck_friction"


def test_a_family_that_there_is_not_is_answered_with_those_there_are(
    generator: Path, tmp_path: Path
) -> None:
    command = [generator, "--family", "gremlins", "-o", tmp_path / "case"]
    answer = subprocess.run(command, capture_output=True, text=True)
    assert answer.returncode == 1
    assert "gremlins" in answer.stderr
    assert "coulomb_friction" in answer.stderr
    assert not (tmp_path / "case").exists()


@pytest.mark.parametrize("folder", [HERE, HERE / "rigs"])
def test_the_generators_are_independent_of_the_library_and_of_each_other(folder: Path) -> None:
    allowed = re.compile(r"<(CLI|Eigen|catch2|mujoco|nlohmann)/[\w./]+>|<\w+>|\"\w+\.hpp\"")
    sources = [*folder.glob("*.cpp"), *folder.glob("*.hpp")]
    assert len(sources) > 10
    for path in sources:
        for included in re.findall(r"#\s*include\s*(\S+)", path.read_text()):
            assert allowed.fullmatch(included), f"{path.name} includes {included}"
            if included.startswith('"'):
                assert (folder / included.strip('"')).exists()
        if path.parent.name == "rigs":
            assert "hidden::" not in path.read_text()
    lists = (folder / "CMakeLists.txt").read_text()
    assert "diffnea::" not in lists
    assert "../" not in lists


def test_aperiodic_motions_repeat_nowhere(generate: Generate) -> None:
    """By the audit's own search; the same seed's other motion does, and says so."""
    for options, repeats in (((), True), (("--aperiodic",), False)):
        folder, truth = generate("none", 3, *options)
        sidecar = load(folder / "seen" / "train.json")
        assert ("period" in sidecar) == repeats
        assert (truth["recording"]["period"] > 0) == repeats
        found = done("audit", folder / "seen" / "train.csv", "--json")
        (period,) = json.loads(found)["periods"]
        assert (period["seconds"] is not None) == repeats
