"""Files that state other masses than the robot has: what is found hangs on the recording alone."""

import csv
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli import done, load

Generate = Callable[..., tuple[Path, dict[str, Any]]]

UNIT = 16.0  # one of the log's torques, in those that the file's masses go with


def with_torques_divided(seen: Path, folder: Path) -> None:
    for part in ("train", "test"):
        with (seen / f"{part}.csv").open(encoding="utf-8") as file:
            head, *rows = list(csv.reader(file))
        torques = [i for i, name in enumerate(head) if name.startswith("tau_")]
        for row in rows:
            for i in torques:
                row[i] = repr(float(row[i]) / UNIT)
        with (folder / f"{part}.csv").open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows([head, *rows])
        shutil.copy(seen / f"{part}.json", folder)


def diagnosis(model: Path, recordings: Path, folder: Path) -> dict[str, Any]:
    run = ("diagnose", model, recordings / "train.csv", "--test", recordings / "test.csv")
    done(*run, "--base", "refit", "-o", folder, "--quiet")
    finding: dict[str, Any] = load(folder / "result.json")
    return finding


def only_cause(finding: dict[str, Any]) -> dict[str, Any]:
    causes: list[dict[str, Any]] = finding["causes"]
    assert len(causes) == 1
    return causes[0]


@pytest.mark.parametrize(
    ("family", "seed"),
    [
        ("asymmetric_coulomb", 1205),
        ("joint_elasticity", 1202),
        ("quadratic_friction", 1040),  # at a joint that nothing drives
    ],
)
def test_torques_in_another_unit(
    family: str, seed: int, generate: Generate, tmp_path: Path
) -> None:
    folder, truth = generate(family, seed)
    (model,) = folder.glob("seen/model.*")
    with_torques_divided(folder / "seen", tmp_path)
    usual = only_cause(diagnosis(model, folder / "seen", tmp_path / "usual"))
    divided = only_cause(diagnosis(model, tmp_path, tmp_path / "divided"))
    (hidden,) = truth["effects"]
    for cause in (usual, divided):
        assert (cause["effect"], cause["where"]) == (hidden["effect"], hidden["where"])
    # The rows' band moves with the square root of the inertia that is fitted: by some per cent.
    assert divided["delta_bic"] == pytest.approx(usual["delta_bic"], rel=0.1)
    for size in divided["parameters"]:
        if size["name"] in hidden["parameters"] and size["unit"] != "rad/s":
            low, high = size["ci95"]
            assert low <= hidden["parameters"][size["name"]] / UNIT <= high


def test_a_spring_before_a_rotor_that_no_file_states(
    generate: Generate, tmp_path: Path
) -> None:
    folder, truth = generate("joint_elasticity", 1202)
    stated = (folder / "seen/model.xml").read_text(encoding="utf-8")
    model = tmp_path / "model.xml"
    model.write_text(re.sub(r' armature="[^"]*"', "", stated), encoding="utf-8")
    finding = diagnosis(model, folder / "seen", tmp_path / "run")
    cause = only_cause(finding)
    (hidden,) = truth["effects"]
    assert (cause["effect"], cause["where"]) == ("joint_elasticity", hidden["where"])
    sizes = {size["name"]: size for size in cause["parameters"]}
    for name in ("stiffness", "motor_inertia"):
        low, high = sizes[name]["ci95"]
        assert low < hidden["parameters"][name] < high
    found, true = (
        of["stiffness"] / of["motor_inertia"]
        for of in ({n: s["value"] for n, s in sizes.items()}, hidden["parameters"])
    )
    assert found == pytest.approx(true, rel=0.5)  # 23.3 for 19.9 Hz
    assert any("show as their ratio alone" in note for note in finding["notes"])
