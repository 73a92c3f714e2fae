import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

import diffnea


def test_the_models_that_come_with_it_are_found_by_name() -> None:
    for name in ("wam4", "panda", "pendulum"):
        path = diffnea.models.path(name)
        assert path.stem == name
        assert diffnea.load_model(name) == diffnea.load_model(path)
    assert diffnea.models.path("wam4.xml").suffix == ".xml"
    with pytest.raises(diffnea.FileError, match=r"no model 'wam9'.*wam4"):
        diffnea.models.path("wam9.xml")


def test_models_of_a_folder_of_ones_own_come_first(arm, tmp_path: Path, monkeypatch) -> None:
    arm.save(tmp_path / "wam4.json")
    monkeypatch.setenv("DIFFNEA_MODELS", str(tmp_path))
    assert diffnea.models.path("wam4") == tmp_path / "wam4.json"
    assert diffnea.load_model("wam4") == arm


def test_a_model_says_what_it_is(rubbing_arm) -> None:
    assert rubbing_arm.num_joints == 2
    assert rubbing_arm.joint_names == ["shoulder", "elbow"]
    assert rubbing_arm.frame_names == ["hand", "upper", "lower"]
    np.testing.assert_array_equal(rubbing_arm.gravity, [0, -9.81, 0])
    lower = rubbing_arm.links[1]
    assert (lower.name, lower.parent, lower.type) == ("lower", "upper", "revolute")
    assert lower.mass == 1.0
    np.testing.assert_allclose(lower.com, [0.15, 0, 0])
    # Stored about the link's origin: one subtraction of like numbers.
    np.testing.assert_allclose(lower.inertia, [0.003, 0, 0, 0.01, 0, 0.01], atol=1e-15)
    assert (lower.lower, lower.effort) == (-3, 40)
    text = repr(rubbing_arm)
    for part in (
        "'planar'",
        "2 joints [shoulder, elbow]",
        "2 links",
        "3 kg",
        "armature ×1",
        "-9.81",
    ):
        assert part in text
    assert "shoulder" in rubbing_arm.info()


def test_effects_are_checked_and_get_their_units(arm) -> None:
    friction = diffnea.Effect("viscous_friction", "elbow", {"viscous": 0.5})
    bound = arm.with_effects([friction]).effects[0]
    assert bound.parameters == {"viscous": 0.5}
    assert bound.units == {"viscous": "N*m*s/rad"}
    assert arm.effects == []  # a copy
    with pytest.raises(diffnea.ModelError, match="viscous_friction"):
        diffnea.Effect("viscous_fricton", "elbow")
    with pytest.raises(diffnea.ModelError, match=r"wrist.*shoulder, elbow"):
        arm.with_effects([diffnea.Effect("viscous_friction", "wrist")])
    with pytest.raises(diffnea.ModelError, match="viscous"):
        arm.with_effects([diffnea.Effect("viscous_friction", "elbow", {"viscous": -1.0})])
    places = {e["effect"]: e["place"] for e in diffnea.effects()}
    assert {"viscous_friction", "armature"} <= places.keys()
    assert [places[e] for e in ("payload", "linear_drag", "string_mass", "camera_delay")] == [
        "tip",
        "ball",
        "string",
        "camera",
    ]


def test_parameters_go_in_as_they_come_out(arm) -> None:
    parameters = arm.inertial_parameters
    assert parameters.shape == (20,)
    parameters[0] *= 1.5
    heavier = arm.with_inertial_parameters(parameters)
    assert heavier.links[0].mass == 3.0
    assert arm.links[0].mass == 2.0
    with pytest.raises(diffnea.ShapeError, match="20"):
        arm.with_inertial_parameters(parameters[:10])


def test_issues_name_the_link(arm) -> None:
    assert arm.issues() == []
    parameters = arm.inertial_parameters
    parameters[10] = -1.0
    (issue,) = arm.with_inertial_parameters(parameters).issues()
    assert issue.link == "lower"
    assert "mass" in issue.text


@pytest.mark.parametrize("through", ["pickle", "dict", "file", "copy", "deepcopy"])
def test_nothing_is_lost_on_the_way(rubbing_arm, tmp_path: Path, through: str) -> None:
    file = tmp_path / "model.json"
    back = {
        "pickle": lambda m: pickle.loads(pickle.dumps(m)),
        "dict": lambda m: diffnea.Model.from_dict(m.to_dict()),
        "file": lambda m: (m.save(file), diffnea.load_model(file))[1],
        "copy": copy.copy,
        "deepcopy": copy.deepcopy,
    }[through](rubbing_arm)
    assert back == rubbing_arm
    assert back.to_dict() == rubbing_arm.to_dict()
    assert np.array_equal(back.inertial_parameters, rubbing_arm.inertial_parameters)


def test_an_mjcf_is_written_back_as_mjcf(tmp_path: Path) -> None:
    wam = diffnea.load_model("wam4")
    parameters = wam.inertial_parameters
    parameters[0] += 1.0
    heavier = wam.with_inertial_parameters(parameters)
    heavier.save(tmp_path / "heavier.xml")
    back = diffnea.load_model(tmp_path / "heavier.xml")
    # MuJoCo turns inertias into principal axes and back.
    np.testing.assert_allclose(back.inertial_parameters, parameters, atol=1e-9)


def test_errors_are_value_errors_with_the_place(tmp_path: Path) -> None:
    broken = tmp_path / "broken.json"
    broken.write_text('{"schema": "diffnea/model/1", "links": [{"name": "a", "wings": 2}]}')
    with pytest.raises(diffnea.ModelError, match=r"broken.json.*wings"):
        diffnea.load_model(broken)
    with pytest.raises(diffnea.FileError, match=r"nowhere\.urdf"):
        diffnea.load_model(tmp_path / "nowhere.urdf")
    for error in (diffnea.ShapeError, diffnea.ModelError, diffnea.DataError, diffnea.FileError):
        assert issubclass(error, diffnea.Error)
        assert issubclass(error, ValueError)
        assert error.__module__ == "diffnea"
