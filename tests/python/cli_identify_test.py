"""`diffnea identify` as a program sees it: files, streams, exit statuses."""

import json
from pathlib import Path

import jsonschema
import pytest
from cli import (
    BAD_INPUT,
    DONE,
    PENDULUM,
    RUN_FILES,
    WRONG_USAGE,
    diffnea,
    done,
    load,
    refused,
    schema,
)

# --- what it writes


def test_the_result_is_what_the_schema_says(run: Path) -> None:
    for name, file in (("identify", "result.json"), ("series", "series.json")):
        jsonschema.Draft202012Validator.check_schema(schema(name))
        jsonschema.validate(load(run / file), schema(name))


def test_the_run_holds_these_files_and_no_others(run: Path) -> None:
    assert {path.name for path in run.iterdir()} == RUN_FILES


def test_the_fit_of_a_robot_that_is_its_model_explains_the_torque(run: Path) -> None:
    result = load(run / "result.json")
    assert result["summary"]["converged"]
    assert result["physically_consistent"]
    for joint in ("shoulder", "elbow"):
        assert result["rmse"]["relative"]["fitted"][joint] < 0.1
        assert result["rmse"]["test"][joint] < result["rmse"]["torque_rms"][joint]


def test_the_inputs_are_named_with_their_checksums(run: Path, recordings: Path) -> None:
    import hashlib

    inputs = load(run / "result.json")["reproduce"]["inputs"]
    assert [item["role"] for item in inputs] == ["model", "data", "test"]
    for item in inputs:
        content = Path(item["path"]).read_bytes()
        assert item["bytes"] == len(content)
        assert item["sha256"] == hashlib.sha256(content).hexdigest()


def test_the_series_have_equal_columns(run: Path) -> None:
    series = load(run / "series.json")
    assert series["schema"] == "diffnea/series/1"
    for joint in series["train"] + series["test"]:
        columns = [joint[name] for name in ("time", "measured", "fitted", "nominal")]
        assert len({len(values) for values in columns}) == 1
        assert len(columns[0]) > 50


@pytest.mark.parametrize("name", ["model.json", "model.urdf"])
def test_the_fitted_model_can_be_read(run: Path, name: str) -> None:
    info = json.loads(done("info", run / name, "--json"))
    assert info["schema"] == "diffnea/info/1"


def test_the_fitted_model_is_a_fixed_point(run: Path, recordings: Path, tmp_path: Path) -> None:
    done("identify", run / "model.json", recordings / "train.csv", "-o", tmp_path / "again")
    first, again = load(run / "result.json"), load(tmp_path / "again" / "result.json")
    for joint, rmse in first["rmse"]["train"].items():
        # The prior moved with the model, which shifts what the data hardly see: 1 % of an error.
        assert again["rmse"]["nominal_train"][joint] == pytest.approx(rmse, rel=0.01)


def test_json_prints_the_result_and_nothing_else(recordings: Path, tmp_path: Path) -> None:
    answer = diffnea(
        "identify", PENDULUM, recordings / "train.csv", "-o", tmp_path / "run", "--json", "--quiet"
    )
    assert answer.returncode == DONE
    assert answer.stderr == ""
    assert json.loads(answer.stdout) == load(tmp_path / "run" / "result.json")


def test_progress_goes_to_standard_error(recordings: Path, tmp_path: Path) -> None:
    answer = diffnea("identify", PENDULUM, recordings / "train.csv", "-o", tmp_path / "run")
    assert "reading" in answer.stderr
    assert "reading" not in answer.stdout
    assert "shoulder" in answer.stdout


def test_several_files_count_together(recordings: Path, tmp_path: Path) -> None:
    train, test = recordings / "train.csv", recordings / "test.csv"
    rows = {}
    for name, files in {"one": [train], "two": [train, test]}.items():
        done("identify", PENDULUM, *files, "-o", tmp_path / name)
        rows[name] = load(tmp_path / name / "result.json")["preprocessing"]["rows"]
    assert rows == {"one": 5001, "two": 10002}
    # Twice the data of one robot: the same robot.
    assert not json.loads(done("compare", tmp_path / "one", tmp_path / "two", "--json"))["changed"]


def test_effects_and_held_parameters_can_be_chosen(recordings: Path, tmp_path: Path) -> None:
    done(
        *("identify", PENDULUM, recordings / "train.csv", "-o", tmp_path / "run"),
        *("--effects", "viscous_friction,coulomb_friction@elbow", "--fix", "lower.*"),
    )
    result = load(tmp_path / "run" / "result.json")
    effects = {(item["effect"], item["where"]) for item in result["effects"]}
    assert effects == {
        ("viscous_friction", "shoulder"),
        ("viscous_friction", "elbow"),
        ("coulomb_friction", "elbow"),
    }
    for item in result["parameters"]:
        if item["name"].startswith("lower."):
            assert item["fixed"]
            assert item["value"] == item["prior"]


def test_no_effects_at_all_can_be_chosen(recordings: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    done("identify", PENDULUM, recordings / "train.csv", "-o", run, "--effects", "none")
    assert load(run / "result.json")["effects"] == []


# --- what it is asked


def test_a_robot_that_comes_along_needs_no_path(recordings: Path, tmp_path: Path) -> None:
    train = recordings / "train.csv"
    done("identify", "double_pendulum", train, "-o", tmp_path / "run", "--quiet")
    inputs = load(tmp_path / "run" / "result.json")["reproduce"]["inputs"]
    assert Path(inputs[0]["path"]).name == PENDULUM.name  # that of the tree, or an installed one
    assert "or one of: cart_pole" in refused(tmp_path / "other", "triple_pendulum", train)


def test_a_pair_of_joints_may_be_named(recordings: Path, tmp_path: Path) -> None:
    asked = "viscous_friction@elbow,transmission_coupling@shoulder,elbow,torque_offset"
    train = recordings / "train.csv"
    done("identify", PENDULUM, train, "--effects", asked, "-o", tmp_path / "run")
    fitted = {(e["effect"], e["where"]) for e in load(tmp_path / "run" / "result.json")["effects"]}
    assert fitted == {
        ("viscous_friction", "elbow"),
        ("transmission_coupling", "shoulder,elbow"),
        ("torque_offset", "shoulder"),
        ("torque_offset", "elbow"),
    }
    words = ("--effects", "transmission_coupling@shoulder,elbow", "-o", tmp_path / "why")
    done("diagnose", PENDULUM, train, *words)
    tried = load(tmp_path / "why" / "result.json")
    names = {c["effect"] for c in tried["candidates"] + tried["absorbed"]}
    assert names == {"transmission_coupling"}


def test_what_only_combinations_show_has_no_error_of_its_own(tmp_path: Path) -> None:
    """A lift: mass and rotor turn up in m + J, mass and offset in m g + c."""
    model = tmp_path / "lift.urdf"
    model.write_text(
        """<robot name="lift"><link name="foot"/>
          <link name="carriage"><inertial><mass value="3"/>
            <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
          <joint name="lift" type="prismatic"><parent link="foot"/><child link="carriage"/>
            <axis xyz="0 0 1"/><limit lower="0" upper="0.6" velocity="0.5" effort="200"/></joint>
        </robot>"""
    )
    motion, train = tmp_path / "motion.csv", tmp_path / "train.csv"
    done("excite", model, "--iterations", 2, "-o", motion)
    done("simulate", model, "--trajectory", motion, "--noise", 1, "-o", train)
    names = ("carriage.mass", "lift.armature.armature", "lift.torque_offset.offset")
    asked = ("identify", model, train, "--effects")
    done(*asked, "armature,torque_offset,viscous_friction", "-o", tmp_path / "all")
    done(*asked, "torque_offset,viscous_friction", "-o", tmp_path / "two")
    seen = {
        run: {
            p["name"]: p["identifiable"]
            for p in load(tmp_path / run / "result.json")["parameters"]
            if p["name"] in (*names, "lift.viscous_friction.viscous")
        }
        for run in ("all", "two")
    }
    assert seen["all"] == dict.fromkeys(names, False) | {"lift.viscous_friction.viscous": True}
    assert all(seen["two"].values())


def test_a_joint_may_have_a_colon_in_its_name_and_no_comma(tmp_path: Path) -> None:
    for name, status in (("elbow:2", DONE), ("elbow,2", BAD_INPUT)):
        model = tmp_path / "arm.urdf"
        model.write_text(PENDULUM.read_text().replace('"elbow"', f'"{name}"'))
        # What is refused, is so before the work: 100 000 take many minutes.
        iterations = 2 if status == DONE else 100_000
        words = ("--duration", 10, "--iterations", iterations, "-o", tmp_path / "motion.csv")
        answer = diffnea("excite", model, *words)
        assert answer.returncode == status, answer.stderr
        if status == BAD_INPUT:
            assert f"cannot be named '{name}'" in answer.stderr
            continue
        train = tmp_path / "train.csv"
        done("simulate", model, "--trajectory", tmp_path / "motion.csv", "-o", train)
        words = ("--effects", f"viscous_friction@{name},torque_offset", "-o", tmp_path / "run")
        done("identify", model, train, *words)
        effects = load(tmp_path / "run" / "result.json")["effects"]
        assert ("viscous_friction", name) in {(e["effect"], e["where"]) for e in effects}


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("--no-such-option", "-o", "run"),
        ("--loss", "none", "-o", "run"),
        ("--robust", "median", "-o", "run"),
        ("--prior", "entropic", "-o", "run"),
        ("--prior", "entropic=-1", "-o", "run"),
        ("--filter", "-3", "-o", "run"),
        ("--filter", "inf", "-o", "run"),
        ("--horizon", "-1", "-o", "run"),
        ("--loss", "0", "-o", "run"),
        ("--prior", "entropic=inf", "-o", "run"),
        ("--prior", "entropic=1e300", "-o", "run"),
        ("--prior", "entropic=nan", "-o", "run"),
        ("--threads", "-1", "-o", "run"),
        ("--seed", "-1", "-o", "run"),
        ("--seed", "1.5", "-o", "run"),
    ],
)
def test_wrong_usage(recordings: Path, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    answer = diffnea("identify", PENDULUM, recordings / "train.csv", *arguments, cwd=tmp_path)
    assert answer.returncode == WRONG_USAGE, answer.stderr
    assert answer.stdout == ""
    assert answer.stderr
    assert len(answer.stderr) < 400  # no number of 309 digits
    assert "->" not in answer.stderr  # no table of the program's own numbers
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("command", ["identify", "excite", "simulate", "compare"])
def test_the_help_is_for_people(command: str) -> None:
    text = done(command, "--help")
    for raw in ("->", "ENUM", "NONNEGATIVE", "POSITIVE", "e+308"):
        assert raw not in text
