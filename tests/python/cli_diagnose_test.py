"""`diffnea diagnose` as a program sees it: files, streams, exit statuses, and what it refuses."""

import csv
import json
import shutil
from functools import partial
from pathlib import Path

import cli
import pytest
import whole_files
from cli import BAD_INPUT, DONE, PENDULUM, WRONG_USAGE, diffnea, done, load

import diffnea as python

TRUTH = {"effect": "coulomb_friction", "where": "elbow"}


refused = partial(cli.refused, command="diagnose")


def rows(source: Path, target: Path, keep: slice) -> Path:
    head, *lines = source.read_text().splitlines()
    target.write_text("\n".join([head, *lines[keep]]) + "\n")
    sidecar = source.with_suffix(".json")
    if sidecar.exists():
        shutil.copy(sidecar, target.with_suffix(".json"))
    return target


# --- what it writes


def test_json_prints_the_result_and_nothing_else(rubbing: Path, tmp_path: Path) -> None:
    train, test, run = rubbing / "train.csv", rubbing / "test.csv", tmp_path / "run"
    answer = diffnea("diagnose", PENDULUM, train, "--test", test, "-o", run, "--json", "--quiet")
    assert answer.returncode == DONE
    assert answer.stderr == ""
    result = json.loads(answer.stdout)
    assert result == load(run / "result.json")
    assert result["schema"] == "diffnea/diagnose/1"
    assert result["verdict"] == "NAMED"
    assert [{key: c[key] for key in TRUTH} for c in result["causes"]] == [TRUTH]
    parameter = result["causes"][0]["parameters"][0]
    assert parameter["ci95"][0] <= 0.05 <= parameter["ci95"][1]
    assert [item["role"] for item in result["reproduce"]["inputs"]] == ["model", "data", "test"]
    assert load(run / "series.json")["schema"] == "diffnea/diagnose-series/1"
    whole_files.check(run)


def test_the_extended_model_has_nothing_left_to_explain(rubbing: Path, tmp_path: Path) -> None:
    train, test, run = rubbing / "train.csv", rubbing / "test.csv", tmp_path / "run"
    text = done("diagnose", PENDULUM, train, "--test", test, "-o", run)
    assert text.startswith("Your simulation follows ")
    assert "\n\nNAMED: " in text
    assert "coulomb friction" in text
    again = tmp_path / "again"
    done("diagnose", run / "model.json", train, "--test", test, "-o", again, "--base", "refit")
    assert load(again / "result.json")["verdict"] == "NONE"


def test_without_a_test_recording_it_says_what_was_held_out(
    recordings: Path, tmp_path: Path
) -> None:
    done("diagnose", PENDULUM, recordings / "train.csv", "-o", tmp_path / "run")
    assert load(tmp_path / "run/result.json")["held_out"] == "time blocks"


def test_a_seed_gives_the_same_result_again(rubbing: Path, tmp_path: Path) -> None:
    results = []
    for name in ("one", "two"):
        done("diagnose", PENDULUM, rubbing / "train.csv", "-o", tmp_path / name, "--seed", 3)
        result = load(tmp_path / name / "result.json")
        results.append({k: v for k, v in result.items() if k not in ("reproduce", "summary")})
    assert results[0] == results[1]


# --- what it refuses


def test_a_test_recording_of_another_robot(recordings: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.csv"
    text = (recordings / "test.csv").read_text()
    other.write_text(text.replace("elbow", "wrist", 3))
    train = recordings / "train.csv"
    message = refused(tmp_path / "run", PENDULUM, train, "--test", other)
    assert "other.csv" in message
    assert "elbow" in message
    assert "wrist" in message


def test_training_data_cannot_be_held_out(recordings: Path, tmp_path: Path) -> None:
    train = recordings / "train.csv"
    message = refused(tmp_path / "run", PENDULUM, train, "--test", train)
    assert "train.csv: is given as data of the fit and as --test" in message
    copy = tmp_path / "copy.csv"
    shutil.copy(train, copy)
    message = refused(tmp_path / "run", PENDULUM, train, "--test", copy)
    assert "same rows" in message
    assert "held-out data must be other recordings" in message
    assert "given twice" in refused(tmp_path / "run", PENDULUM, train, train)


@pytest.mark.parametrize("count", [3, 100, 400])
def test_too_short_a_recording(recordings: Path, tmp_path: Path, count: int) -> None:
    short = rows(recordings / "train.csv", tmp_path / "short.csv", slice(count))
    message = refused(tmp_path / "run", PENDULUM, short)
    assert "short" in message or "longer than" in message


def test_too_short_a_test_recording(recordings: Path, tmp_path: Path) -> None:
    short = rows(recordings / "test.csv", tmp_path / "short.csv", slice(100))
    message = refused(tmp_path / "run", PENDULUM, recordings / "train.csv", "--test", short)
    assert "short" in message or "longer than" in message


def test_a_robot_that_does_not_move(recordings: Path, tmp_path: Path) -> None:
    still = tmp_path / "still.csv"
    with (recordings / "train.csv").open(newline="") as file:
        head, *table = list(csv.reader(file))
    moving = [i for i, name in enumerate(head) if name.startswith(("q", "tau"))]
    for row in table:
        for i in moving:
            row[i] = table[0][i]
    with still.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([head, *table])
    message = refused(tmp_path / "run", PENDULUM, still)
    assert "mov" in message
    assert "still.csv" in message


def test_an_effect_that_does_not_exist(recordings: Path, tmp_path: Path) -> None:
    train = recordings / "train.csv"
    message = refused(tmp_path / "run", PENDULUM, train, "--effects", "viscosity")
    assert "viscosity" in message
    assert "coulomb_friction" in message
    assert "viscous_friction" in message
    message = refused(tmp_path / "run", PENDULUM, train, "--effects", "cogging@wrist")
    assert "wrist" in message
    assert "elbow" in message


def test_a_prior_that_the_model_does_not_have(recordings: Path, run: Path, tmp_path: Path) -> None:
    train = recordings / "train.csv"
    message = refused(tmp_path / "run", PENDULUM, train, "--base", "prior")
    assert "double_pendulum.urdf has no posterior" in message
    assert "identify" in message
    done("diagnose", run / "model.json", train, "--base", "prior", "-o", tmp_path / "prior")
    assert load(tmp_path / "prior/result.json")["base"] == "prior"


def test_a_recording_that_the_model_was_identified_from_does_not_count_twice(
    recordings: Path, run: Path, tmp_path: Path
) -> None:
    again = ("diagnose", run / "model.json", recordings / "train.csv", "-o", tmp_path / "again")
    note = "identified from this recording"
    assert note in done(*again)
    assert load(tmp_path / "again/result.json")["base"] == "refit"
    # As arrays it is the same recording.
    loaded = python.read_recording(recordings / "train.csv")
    assert python.diagnose(python.load_model(run / "model.json"), loaded).base == "refit"
    done("diagnose", run / "model.json", recordings / "test.csv", "-o", tmp_path / "other")
    other = load(tmp_path / "other/result.json")
    assert other["base"] == "prior"
    assert not any(note in n for n in other["notes"])


def test_a_folder_that_cannot_be_written(recordings: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    answer = diffnea(
        "diagnose", PENDULUM, recordings / "train.csv", "-o", tmp_path / "file/run", "--quiet"
    )
    assert answer.returncode == BAD_INPUT
    assert "file/run" in answer.stderr
    assert answer.stdout == ""


@pytest.mark.parametrize("missing", ["model", "data", "test"])
def test_a_file_that_is_not_there(recordings: Path, tmp_path: Path, missing: str) -> None:
    paths = {
        "model": PENDULUM,
        "data": recordings / "train.csv",
        "test": recordings / "test.csv",
    } | {missing: tmp_path / "missing.file"}
    message = refused(tmp_path / "run", paths["model"], paths["data"], "--test", paths["test"])
    assert "missing.file" in message


@pytest.mark.parametrize(
    "options",
    [
        ("--base", "free"),
        ("--filter", "-1"),
        ("--filter", "nan"),
        ("--decimate", "fast"),
        ("--torque-side", "outside"),
        ("--what", "1"),
    ],
)
def test_wrong_usage(recordings: Path, tmp_path: Path, options: tuple[str, ...]) -> None:
    run = tmp_path / "run"
    answer = diffnea("diagnose", PENDULUM, recordings / "train.csv", "-o", run, *options)
    assert answer.returncode == WRONG_USAGE
    assert options[0].strip("-") in answer.stderr
    assert not run.exists()
