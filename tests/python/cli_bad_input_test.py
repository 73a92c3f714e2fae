"""What `diffnea identify` refuses or warns of: one message with where, what, and what there is."""

import json
import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from cli import MODELS, PENDULUM, Table, column, diffnea, done, edited, load, refused


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
    brief = edited(recordings / "train.csv", tmp_path / "bad.csv", lambda table: table[:2001])
    message = refused(tmp_path / "run", PENDULUM, brief, "--decimate", "5")
    assert "parameters" in message


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
    # A joint without limits would be unwrapped.
    model = tmp_path / "limited.urdf"
    limited = PENDULUM.read_text().replace('type="continuous"', 'type="revolute"')
    model.write_text(limited.replace("<limit ", '<limit lower="-9" upper="9" '))
    words = (model, train, "--test", held_out, "-o", tmp_path / "run", "--quiet")
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
