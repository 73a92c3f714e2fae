"""The files that a result says it was made of."""

from pathlib import Path

import pytest

import diffnea


@pytest.fixture
def folder(arm, train, tmp_path: Path) -> Path:
    """Hold arm.json and train.csv."""
    arm.save(tmp_path / "arm.json")
    diffnea.write_recording(train, tmp_path / "train.csv")
    return tmp_path


def roles(result) -> list[str]:
    return [item.role for item in result.reproduce.inputs]


def test_a_model_that_was_changed_in_memory_is_not_its_file(folder) -> None:
    model = diffnea.load_model(folder / "arm.json")
    data = folder / "train.csv"
    assert roles(diffnea.identify(model, data)) == ["model", "data"]
    friction = diffnea.Effect("viscous_friction", model.joint_names[0], {"viscous": 0.1})
    for other in (
        model.with_effects([friction]),
        model.with_inertial_parameters(1.1 * model.inertial_parameters),
    ):
        assert other.source == model.source  # it can be saved in the form it came in
        assert roles(diffnea.identify(other, data)) == ["data"]


def test_a_file_that_was_changed_since_is_not_the_model(folder) -> None:
    model = diffnea.load_model(folder / "arm.json")
    (folder / "arm.json").write_text("{}")
    assert roles(diffnea.identify(model, folder / "train.csv")) == ["data"]


def test_the_model_of_a_run_is_its_model_file(folder) -> None:
    diffnea.identify(folder / "arm.json", folder / "train.csv").save(folder / "run")
    again = diffnea.identify(diffnea.load_model(folder / "run"), folder / "train.csv")
    assert [Path(item.path).name for item in again.reproduce.inputs] == ["model.json", "train.csv"]


@pytest.mark.parametrize("work", [diffnea.identify, diffnea.diagnose])
def test_files_that_are_gone_afterwards_cost_no_result(folder, work) -> None:
    """They are described as they were when they were read."""
    data = folder / "train.csv"

    def progress(p: diffnea.FitProgress) -> None:
        if p.stage not in ("reading", "preparing"):
            (folder / "arm.json").unlink(missing_ok=True)
            data.unlink(missing_ok=True)

    result = work(folder / "arm.json", data, progress=progress)
    assert not data.exists()
    assert roles(result) == ["model", "data"]
    assert all(item.sha256 for item in result.reproduce.inputs)
