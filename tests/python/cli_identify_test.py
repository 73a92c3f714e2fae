"""`diffnea identify` as a program sees it: files, streams, exit statuses, and what it refuses."""

import csv
import json
import math
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from cli import (
    BAD_INPUT,
    COMMAND,
    DONE,
    INTERRUPTED,
    MODELS,
    ROOT,
    WRONG_USAGE,
    diffnea,
    done,
    load,
)

PENDULUM = MODELS / "double_pendulum.urdf"
RUN_FILES = {"result.json", "series.json", "model.json", "model.urdf", "report.html"}

Table = list[list[str]]


def edited(source: Path, target: Path, edit: Callable[[Table], Table | None]) -> Path:
    """Copy a recording; `edit` may change its rows, the first of which is the header."""
    with source.open(newline="") as file:
        table = list(csv.reader(file))
    table = edit(table) or table
    with target.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(table)
    return target


def column(table: Table, name: str) -> int:
    return table[0].index(name)


def refused(run: Path, *arguments: object) -> str:
    """Run `identify`, which must refuse and leave nothing behind; return its message."""
    answer = diffnea("identify", *arguments, "-o", run, "--quiet")
    assert answer.returncode == BAD_INPUT, answer.stderr
    assert answer.stdout == ""
    assert not run.exists()
    return answer.stderr


# --- what it writes


def test_the_result_is_what_the_schema_says(run: Path) -> None:
    schema = load(ROOT / "docs/schema/identify.schema.json")
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(load(run / "result.json"), schema)


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


def test_a_later_run_replaces_an_earlier_one(recordings: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    train = recordings / "train.csv"
    done("identify", PENDULUM, train, "-o", run)
    (run / "mine.txt").write_text("kept")
    done("identify", run / "model.json", train, "-o", run)
    # The second model is JSON: the first one's URDF would be of another fit.
    assert {path.name for path in run.iterdir()} == RUN_FILES - {"model.urdf"} | {"mine.txt"}


def test_a_run_that_fails_leaves_the_earlier_one_alone(recordings: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    done("identify", PENDULUM, recordings / "train.csv", "-o", run)
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    bad = edited(recordings / "train.csv", tmp_path / "bad.csv", lambda t: t[:20])
    assert diffnea("identify", PENDULUM, bad, "-o", run).returncode == BAD_INPUT
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before


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


# --- wrong usage


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
        ("--window", "0", "-o", "run"),
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


@pytest.mark.parametrize(
    "arguments",
    [
        ("--kp", "-1", "-1"),
        ("--kd", "1", "-1"),
        ("--noise", "-1"),
        ("--rate", "0"),
        ("--kp", "inf"),
    ],
)
def test_simulate_refuses_what_cannot_be(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    motion = tmp_path / "motion.csv"
    done("excite", PENDULUM, "--duration", 10, "-o", motion)
    answer = diffnea(
        *("simulate", PENDULUM, "--trajectory", motion, "-o", tmp_path / "data.csv"), *arguments
    )
    assert answer.returncode == WRONG_USAGE, answer.stderr
    assert not (tmp_path / "data.csv").exists()


def test_an_input_is_never_overwritten(tmp_path: Path) -> None:
    motion, model = tmp_path / "motion.csv", tmp_path / "arm.json"
    done("excite", PENDULUM, "--duration", 10, "-o", motion)
    done("simulate", PENDULUM, "--trajectory", motion, "-o", tmp_path / "a.csv", "--truth", model)
    before = {path: path.read_bytes() for path in (motion, model)}
    for output in (motion, tmp_path / "arm.csv"):  # the second one's sidecar would be arm.json
        answer = diffnea("simulate", model, "--trajectory", motion, "-o", output)
        assert answer.returncode == BAD_INPUT
        assert "is an input" in answer.stderr
    assert diffnea("excite", model, "-o", model).returncode == BAD_INPUT
    assert {path: path.read_bytes() for path in before} == before


def test_what_no_run_left_in_the_folder_stays(recordings: Path, tmp_path: Path) -> None:
    data = shutil.copy(recordings / "train.csv", tmp_path / "recording_1.csv")
    done("identify", PENDULUM, data, "-o", tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == RUN_FILES | {"recording_1.csv"}


@pytest.mark.parametrize("command", ["identify", "diagnose"])
@pytest.mark.parametrize("name", ["result.json", "series.json", "model.xml"])
def test_a_file_that_diffnea_did_not_write_stays(
    recordings: Path, tmp_path: Path, command: str, name: str
) -> None:
    (tmp_path / name).write_text('{"mine": 1}')
    answer = diffnea(command, PENDULUM, recordings / "train.csv", "-o", tmp_path)
    assert answer.returncode == BAD_INPUT
    assert f"{name}: was not left by diffnea" in answer.stderr
    assert (tmp_path / name).read_text() == '{"mine": 1}'
    assert {path.name for path in tmp_path.iterdir()} == {name}


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_a_model_is_not_overwritten_by_its_fit(
    recordings: Path, tmp_path: Path, command: str
) -> None:
    model = shutil.copy(PENDULUM, tmp_path / "model.urdf")
    answer = diffnea(command, model, recordings / "train.csv", "-o", tmp_path)
    assert answer.returncode == BAD_INPUT
    assert "model.urdf: was not left by diffnea" in answer.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"model.urdf"}


def test_what_a_killed_run_left_is_replaced(recordings: Path, tmp_path: Path) -> None:
    done("identify", PENDULUM, recordings / "train.csv", "-o", tmp_path)
    for path in tmp_path.iterdir():  # series.json is published first, result.json last
        if path.name not in ("series.json", "model.json"):
            path.unlink()
    done("identify", PENDULUM, recordings / "train.csv", "-o", tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == RUN_FILES


def test_the_result_of_another_command_stays(recordings: Path, tmp_path: Path) -> None:
    done("identify", PENDULUM, recordings / "train.csv", "-o", tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    model = tmp_path / "model.json"
    answer = diffnea("diagnose", model, recordings / "train.csv", "-o", tmp_path)
    assert answer.returncode == BAD_INPUT
    assert "holds another command's result (diffnea/identify/" in answer.stderr
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_excite_says_what_it_does_without_limits(tmp_path: Path) -> None:
    answer = diffnea("excite", PENDULUM, "--duration", 10, "-o", tmp_path / "motion.csv")
    assert "no position limits" in answer.stderr
    printed = done("excite", PENDULUM, "--duration", 10, "-o", tmp_path / "motion.csv", "--json")
    assert any("no position limits" in note for note in json.loads(printed)["notes"])


# --- bad input: one message that says where, what, and what there is


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


def test_a_file_that_is_not_there(recordings: Path, tmp_path: Path) -> None:
    assert "nothing.csv" in refused(tmp_path / "run", PENDULUM, tmp_path / "nothing.csv")
    train = recordings / "train.csv"
    assert "nothing.urdf" in refused(tmp_path / "run", tmp_path / "nothing.urdf", train)


@pytest.mark.parametrize("missing", ["time", "q_elbow"])
def test_a_missing_column(recordings: Path, tmp_path: Path, missing: str) -> None:
    def drop(table: Table) -> Table:
        k = column(table, missing)
        return [row[:k] + row[k + 1 :] for row in table]

    bad = edited(recordings / "train.csv", tmp_path / "bad.csv", drop)
    message = refused(tmp_path / "run", PENDULUM, bad)
    assert "bad.csv:1" in message
    assert missing.removeprefix("q_") in message


def test_a_column_that_is_there_twice(recordings: Path, tmp_path: Path) -> None:
    def repeat(table: Table) -> None:
        table[0][column(table, "tau_elbow")] = "tau_shoulder"

    bad = edited(recordings / "train.csv", tmp_path / "bad.csv", repeat)
    message = refused(tmp_path / "run", PENDULUM, bad)
    assert "bad.csv:1" in message
    assert "tau_shoulder" in message


def test_other_columns_are_kept_and_named(recordings: Path, tmp_path: Path) -> None:
    def add(table: Table) -> Table:
        return [[*row, "temperature" if k == 0 else "20"] for k, row in enumerate(table)]

    data = edited(recordings / "train.csv", tmp_path / "more.csv", add)
    done("identify", PENDULUM, data, "-o", tmp_path / "run")
    assert load(tmp_path / "run" / "result.json")["preprocessing"]["extra_channels"] == [
        "temperature"
    ]


def test_a_few_impossible_rows_are_left_out_and_reported(recordings: Path, tmp_path: Path) -> None:
    def spoil(table: Table) -> None:
        table[100][column(table, "q_elbow")] = "1e30"

    data = edited(recordings / "train.csv", tmp_path / "data.csv", spoil)
    done("identify", PENDULUM, data, "-o", tmp_path / "run")
    preprocessing = load(tmp_path / "run" / "result.json")["preprocessing"]
    assert preprocessing["quarantined"] == 1
    assert [row["line"] for row in preprocessing["quarantined_rows"]] == [101]


@pytest.mark.parametrize("robust", ["none", "cauchy"])
def test_an_absurd_torque_does_not_ruin_the_fit(
    run: Path, recordings: Path, tmp_path: Path, robust: str
) -> None:
    def spoil(table: Table) -> None:
        table[2500][column(table, "tau_elbow")] = "1e6"

    data = edited(recordings / "train.csv", tmp_path / "data.csv", spoil)
    test = recordings / "test.csv"
    done(*("identify", PENDULUM, data, "--test", test, "--robust", robust, "-o", tmp_path / "run"))
    result = load(tmp_path / "run" / "result.json")
    assert result["preprocessing"]["quarantined"] == 1
    row = result["preprocessing"]["quarantined_rows"][0]
    assert row["line"] == 2501
    assert "tau_elbow" in row["reason"]
    for joint, rmse in load(run / "result.json")["rmse"]["test"].items():
        # One row of 5001 less; Cauchy's weights cost some efficiency.
        assert result["rmse"]["test"][joint] == pytest.approx(rmse, rel=0.1)


def test_torque_beyond_the_effort_limit_brings_a_warning(recordings: Path, tmp_path: Path) -> None:
    def to_millis(table: Table) -> None:
        for row in table[1:]:
            row[column(table, "tau_elbow")] = str(1000 * float(row[column(table, "tau_elbow")]))

    data = edited(recordings / "train.csv", tmp_path / "data.csv", to_millis)
    done("identify", PENDULUM, data, "-o", tmp_path / "run")
    result = load(tmp_path / "run" / "result.json")
    assert result["preprocessing"]["quarantined"] == 0
    assert "effort limit" in result["notes"][0]
    assert "elbow" in result["notes"][0]


def test_an_impossible_inertia_is_named_first(recordings: Path, tmp_path: Path) -> None:
    model = tmp_path / "impossible.urdf"
    text = PENDULUM.read_text()
    at = text.index("<inertia ", text.index('<link name="lower"'))
    end = text.index("/>", at)
    model.write_text(
        text[:at] + '<inertia ixx="-0.5" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"' + text[end:]
    )
    answer = diffnea("identify", model, recordings / "train.csv", "-o", tmp_path / "run")
    note = load(tmp_path / "run" / "result.json")["notes"][0]
    assert note.startswith("WARNING: ")
    assert "lower" in note
    assert "0.5" in note  # by how much
    assert note in answer.stdout


def test_an_angle_cannot_be_that_of_a_slide(recordings: Path, tmp_path: Path) -> None:
    def rename(table: Table) -> None:
        table[0][column(table, "q_elbow")] = "q_elbow [mm]"

    bad = edited(recordings / "train.csv", tmp_path / "bad.csv", rename)
    message = refused(tmp_path / "run", PENDULUM, bad)
    assert "'mm' cannot be that of 'elbow'" in message


def test_too_many_impossible_rows(recordings: Path, tmp_path: Path) -> None:
    def spoil(table: Table) -> None:
        for row in table[1:200]:
            row[column(table, "q_elbow")] = "inf"

    bad = edited(recordings / "train.csv", tmp_path / "bad.csv", spoil)
    assert "199" in refused(tmp_path / "run", PENDULUM, bad)


def test_fewer_samples_than_parameters(recordings: Path, tmp_path: Path) -> None:
    bad = edited(recordings / "train.csv", tmp_path / "bad.csv", lambda table: table[:20])
    refused(tmp_path / "run", PENDULUM, bad)


def silent_elbow(table: Table) -> None:
    for row in table[1:]:
        row[column(table, "tau_elbow")] = "0"


def test_a_torque_that_is_always_zero(recordings: Path, tmp_path: Path) -> None:
    bad = edited(recordings / "train.csv", tmp_path / "bad.csv", silent_elbow)
    message = refused(tmp_path / "run", PENDULUM, bad)
    assert "elbow" in message
    assert "passive" in message


def test_a_torque_of_zero_at_a_joint_that_is_declared_passive(run: Path, tmp_path: Path) -> None:
    # The robot: the double pendulum whose elbow swings freely.
    robot = load(run / "model.json")
    elbow = next(x["joint"] for x in robot["links"] if x.get("joint", {}).get("name") == "elbow")
    elbow["passive"] = True
    robot["effects"] = []
    model, motion, data = (tmp_path / name for name in ("robot.json", "motion.csv", "data.csv"))
    model.write_text(json.dumps(robot))
    done("excite", PENDULUM, "--duration", 10, "-o", motion)
    done("simulate", model, "--trajectory", motion, "--noise", 1, "-o", data)
    (tmp_path / "data.json").unlink()  # which declares it too

    def add_silence(table: Table) -> Table:
        return [[*row, "tau_elbow" if k == 0 else "0"] for k, row in enumerate(table)]

    edited(data, data, add_silence)
    assert "elbow" in refused(tmp_path / "run", PENDULUM, data)
    done("identify", PENDULUM, data, "--passive", "elbow", "-o", tmp_path / "run")


def test_degrees_bring_a_warning(recordings: Path, tmp_path: Path) -> None:
    def to_degrees(table: Table) -> None:
        for name in ("q_shoulder", "q_elbow"):
            k = column(table, name)
            for row in table[1:]:
                row[k] = str(float(row[k]) * 57.29577951308232)

    data = edited(recordings / "train.csv", tmp_path / "data.csv", to_degrees)
    # The double pendulum has no limits; a copy that has them tells what an angle may be.
    model = tmp_path / "limited.urdf"
    model.write_text(
        PENDULUM.read_text()
        .replace('type="continuous"', 'type="revolute"')
        .replace('<limit effort="12"', '<limit lower="-3.2" upper="3.2" effort="12"')
    )
    answer = diffnea("identify", model, data, "-o", tmp_path / "run")
    notes = answer.stdout[answer.stdout.index("notes\n") :].splitlines()
    assert notes[1].startswith("  WARNING: shoulder: ")
    assert "degrees" in notes[1]


@pytest.mark.parametrize(
    ("change", "warning"),
    [
        (lambda q, tau: (math.remainder(q + 3.0, 2.0 * math.pi), tau), "jumps by a whole turn"),
        (lambda q, tau: (q, -3.0 * tau), "explains little of the measured torque"),
    ],
)
def test_what_is_wrong_with_a_channel_is_a_warning_of_the_fit(
    recordings: Path, tmp_path: Path, change: Callable[..., tuple[float, float]], warning: str
) -> None:
    def edit(table: Table) -> None:
        q, tau = column(table, "q_elbow"), column(table, "tau_elbow")
        for row in table[1:]:
            row[q], row[tau] = (repr(x) for x in change(float(row[q]), float(row[tau])))

    held_out = edited(recordings / "test.csv", tmp_path / "data.csv", edit)
    train = recordings / "train.csv"
    words = (PENDULUM, train, "--test", held_out, "-o", tmp_path / "run", "--quiet")
    text = diffnea("identify", *words).stdout
    assert re.search(rf"WARNING: .*elbow.*{warning}", text), text


def test_joints_that_are_not_the_models(recordings: Path, tmp_path: Path) -> None:
    message = refused(tmp_path / "run", MODELS / "wam4.xml", recordings / "train.csv")
    for joint in ("joint1", "joint4", "shoulder", "elbow"):
        assert joint in message


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("bad.urdf", "<robot name='x'><link"),
        ("bad.xml", "<mujoco><worldbody><body></worldbody></mujoco>"),
        ("bad.json", '{"schema": "diffnea/model/1", '),
        ("bad.txt", "nothing that a robot could be"),
        ("empty.urdf", ""),
    ],
)
def test_a_malformed_model(recordings: Path, tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    message = refused(tmp_path / "run", tmp_path / name, recordings / "train.csv")
    assert name in message


def test_a_joint_that_never_moves(recordings: Path, tmp_path: Path) -> None:
    def freeze(table: Table) -> None:
        for row in table[1:]:
            row[column(table, "q_elbow")] = "0.5"

    data = edited(recordings / "train.csv", tmp_path / "data.csv", freeze)
    done("identify", PENDULUM, data, "-o", tmp_path / "run")
    result = load(tmp_path / "run" / "result.json")
    assert any("elbow never moves" in note for note in result["notes"])
    parameters = {item["name"]: item for item in result["parameters"]}
    assert not parameters["elbow.viscous_friction.viscous"]["identifiable"]
    assert parameters["shoulder.viscous_friction.viscous"]["identifiable"]


def test_data_of_the_fit_cannot_be_held_out(recordings: Path, tmp_path: Path) -> None:
    train = recordings / "train.csv"
    (tmp_path / "link.csv").symlink_to(train)
    assert "--test" in refused(tmp_path / "run", PENDULUM, train, "--test", train)
    assert "--test" in refused(tmp_path / "run", PENDULUM, train, "--test", tmp_path / "link.csv")
    assert "twice" in refused(tmp_path / "run", PENDULUM, train, train)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--effects", "friktion"), "viscous_friction"),
        (("--effects", "viscous_friction@wrist"), "elbow"),
        (("--fit", "masses"), "inertia"),
        (("--fix", "nothing.mass"), "nothing.mass"),
        (("--passive", "wrist"), "wrist"),
    ],
)
def test_a_name_that_does_not_exist(
    recordings: Path, tmp_path: Path, arguments: tuple[str, str], named: str
) -> None:
    assert named in refused(tmp_path / "run", PENDULUM, recordings / "train.csv", *arguments)


def test_a_folder_that_cannot_be_written(recordings: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    answer = diffnea(
        "identify", PENDULUM, recordings / "train.csv", "-o", tmp_path / "file" / "run"
    )
    assert answer.returncode == BAD_INPUT
    assert str(tmp_path / "file" / "run") in answer.stderr
    assert "reading" not in answer.stderr  # known before the work


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission(recordings: Path, tmp_path: Path) -> None:
    (tmp_path / "closed").mkdir(mode=0o500)
    message = refused(tmp_path / "closed" / "run", PENDULUM, recordings / "train.csv")
    assert "closed" in message


# --- interruption


def interrupted(
    arguments: list[object], after: str, by: signal.Signals = signal.SIGINT
) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [COMMAND, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith(after):
            process.send_signal(by)
            break
    return process


@pytest.fixture(scope="session")
def long_recording(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The training data forty times over, as runs of one file: seconds of work."""

    def repeat(table: Table) -> Table:
        runs = [[*row, str(run)] for run in range(40) for row in table[1:]]
        return [[*table[0], "run"], *runs]

    return edited(recordings / "train.csv", tmp_path_factory.mktemp("long") / "long.csv", repeat)


def test_ctrl_c_keeps_what_there_is(long_recording: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    process = interrupted(
        ["identify", PENDULUM, long_recording, "--robust", "cauchy", "-o", run], after="reading"
    )
    _, errors = process.communicate(timeout=60)
    assert process.returncode == INTERRUPTED, errors
    assert "interrupted" in errors
    assert {path.name for path in run.iterdir()} == RUN_FILES
    summary: dict[str, Any] = load(run / "result.json")["summary"]
    assert summary["interrupted"]
    assert "interrupted" in summary["termination"]


def test_the_second_ctrl_c_ends_it_at_once(long_recording: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    process = interrupted(
        ["identify", PENDULUM, long_recording, "-o", run], after="opening", by=signal.SIGSTOP
    )
    # Two of one kind would be merged; these wait for each other until the program goes on.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGCONT):
        process.send_signal(number)
    process.communicate(timeout=10)
    assert process.returncode in {
        -signal.SIGINT,
        -signal.SIGTERM,
    }  # the later one's turn is not set
    assert not run.exists()


def test_what_a_killed_run_left_goes_with_the_next(
    long_recording: Path, recordings: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    process = interrupted(
        ["identify", PENDULUM, long_recording, "-o", run], after="reading", by=signal.SIGKILL
    )
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGKILL
    assert [path.name for path in run.iterdir()] == [f".partial-{process.pid}"]
    done("identify", PENDULUM, recordings / "train.csv", "-o", run)
    assert {path.name for path in run.iterdir()} == RUN_FILES


# --- report and compare


def test_report_builds_the_same_page_again(run: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(run, copy)
    (copy / "report.html").unlink()
    (copy / "model.json").unlink()
    done("report", copy)
    assert (copy / "report.html").read_bytes() == (run / "report.html").read_bytes()


def test_report_says_that_there_is_nothing_to_draw(run: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(run, copy)
    (copy / "series.json").unlink()
    answer = diffnea("report", copy)
    assert answer.returncode == DONE
    assert "series.json" in answer.stderr
    assert "series.json" in (copy / "report.html").read_text(encoding="utf-8")


def test_report_refuses_a_folder_that_is_no_run(tmp_path: Path) -> None:
    answer = diffnea("report", tmp_path)
    assert answer.returncode == BAD_INPUT
    assert "result.json" in answer.stderr


def test_report_refuses_a_result_that_is_broken(run: Path, tmp_path: Path) -> None:
    for text in ("{", '{"schema": "diffnea/other/1"}', '{"schema": "diffnea/identify/1"}', "[]"):
        (tmp_path / "result.json").write_text(text)
        answer = diffnea("report", tmp_path)
        assert answer.returncode == BAD_INPUT, text
        assert str(tmp_path / "result.json") in answer.stderr


def test_a_fit_compared_with_itself_has_not_changed(run: Path) -> None:
    comparison = json.loads(done("compare", run, run, "--json"))
    assert comparison["schema"] == "diffnea/compare/1"
    assert not comparison["changed"]
    assert comparison["not_comparable"] == 0
    assert all(change["p"] == 1 for change in comparison["base_parameters"])


def test_compare_finds_more_friction_and_nothing_else(
    recordings: Path, run: Path, tmp_path: Path
) -> None:
    heavier = tmp_path / "heavier.urdf"
    text = PENDULUM.read_text()
    joint = text.index('<joint name="elbow"')
    at = text.index("<limit", joint)
    heavier.write_text(text[:at] + '<dynamics damping="0.3"/>' + text[at:])
    motion, data = tmp_path / "motion.csv", tmp_path / "data.csv"
    done("excite", PENDULUM, "--duration", 10, "--seed", 1, "-o", motion)
    done("simulate", heavier, "--trajectory", motion, "--noise", 1, "--seed", 9, "-o", data)
    done("identify", PENDULUM, data, "-o", tmp_path / "RUN")
    comparison = json.loads(done("compare", run, tmp_path / "RUN", "--json"))
    significant = [item for item in comparison["parameters"] if item["significant"]]
    assert [item["name"] for item in significant] == ["elbow.viscous_friction.viscous"]
    difference = significant[0]["after"] - significant[0]["before"]
    assert difference == pytest.approx(0.3, abs=4 * significant[0]["std"])
    assert comparison["changed"]
    assert "elbow.viscous_friction" in done("compare", run, tmp_path / "RUN")


def test_compare_says_that_a_fit_that_holds_worse_hides_changes(run: Path, tmp_path: Path) -> None:
    motion, data, noisy = tmp_path / "motion.csv", tmp_path / "data.csv", tmp_path / "noisy"
    done("excite", PENDULUM, "--duration", 10, "--seed", 1, "-o", motion)
    done("simulate", PENDULUM, "--trajectory", motion, "--noise", 20, "--seed", 9, "-o", data)
    done("identify", PENDULUM, data, "-o", noisy)
    comparison = json.loads(done("compare", run, noisy, "--json"))
    elbow = {item["joint"]: item for item in comparison["left_over"]}["elbow"]
    assert elbow["after"] > 2 * elbow["before"]
    assert comparison["std_ratio"] > 3
    text = done("compare", run, noisy)
    assert "elbow: the second fit leaves" in text
    assert "the standard errors of the second are" in text
    assert "leaves" not in done("compare", run, run)


def test_compare_refuses_different_robots(run: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(run, other)
    text = (other / "result.json").read_text()
    (other / "result.json").write_text(text.replace('"elbow"', '"wrist"'))
    answer = diffnea("compare", run, other)
    assert answer.returncode == BAD_INPUT
    assert "elbow" in answer.stderr
    assert "wrist" in answer.stderr
