"""Recordings that are spoiled: what `diagnose` and `identify` say of them, fitted and held out."""

import random
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli import PENDULUM, Table, column, diffnea, done, edited, load, refused

FITTED, HELD_OUT = "train", "test"
Spoil = Callable[[Table], Table | None]

# --- ways to spoil a recording


def cut(rows: int) -> Spoil:
    return lambda table: table[: rows + 1]


def runs(rows: int, *, only: bool = False) -> Spoil:
    """A run of so many rows among good ones, or nothing but such runs."""

    def split(table: Table) -> Table:
        half = len(table) // 2

        def run(k: int) -> int:
            return k // rows if only else (k >= half) + (k >= half + rows)

        return [[*row, "run" if k == 0 else str(run(k - 1))] for k, row in enumerate(table)]

    return split


def cells(name: str, value: str, first: float = 0.0, last: float = 1.0) -> Spoil:
    """One value in a column, from one share of the rows to another."""

    def fill(table: Table) -> None:
        rows = len(table) - 1
        for row in table[1 + round(first * rows) : 1 + round(last * rows)]:
            row[column(table, name)] = value

    return fill


def still(table: Table) -> None:
    for name in ("q_shoulder", "q_elbow"):
        cells(name, table[1][column(table, name)])(table)


def share_no_row(table: Table) -> None:
    cells("q_elbow", "", 0.5, 1.0)(table)
    cells("tau_elbow", "", 0.0, 0.5)(table)


def clock(change: Callable[[int, float], float]) -> Spoil:
    """Another stamp of each row, counted from 0."""

    def turn(table: Table) -> None:
        for k, row in enumerate(table[1:]):
            row[0] = repr(round(change(k, float(row[0])), 6))

    return turn


def noise(size: float, *columns: str) -> Spoil:
    def add(table: Table) -> None:
        rng = random.Random(1)
        for row in table[1:]:
            for name in columns:
                k = column(table, name)
                row[k] = repr(float(row[k]) + rng.gauss(0.0, size))

    return add


def shift(seconds: float) -> Spoil:
    """A clock that is set anew after half of the rows."""
    return clock(lambda k, t: t + (seconds if k >= 5000 else 0.0))


def arguments(rubbing: Path, folder: Path, role: str, spoil: Spoil) -> list[object]:
    """Model, recording and held-out recording; one of these is spoiled."""
    files = {name: rubbing / f"{name}.csv" for name in (FITTED, HELD_OUT)}
    bad = edited(files[role], folder / "spoiled.csv", spoil)
    shutil.copy(files[role].with_suffix(".json"), bad.with_suffix(".json"))
    files[role] = bad
    return [PENDULUM, files[FITTED], "--test", files[HELD_OUT]]


# --- recordings that are refused

RECORD = r"spoiled\.csv.*expected the rows of a motion"
STILL = r"spoiled\.csv: .*no joint.* moves \(shoulder, elbow\)"
BACK = r"spoiled\.csv:5002: the clock is set back, from 9.998 to .* in a column `run`"
REPEATS = r"line 3: time repeats \(0\).*write `time` with more digits"
REFUSED = {
    "one row": (cut(1), r"spoiled\.csv: .*it has 1 row, expected"),
    "three rows": (cut(3), RECORD),
    "runs of three rows": (runs(3, only=True), RECORD),
    "0.2 s": (cut(100), r"spoiled\.csv: diagnose: 0\.\d* s of (fitted|held-out) rows"),
    "all positions equal": (still, STILL),
    "torque that ends": (cells("tau_elbow", "", 0.002), "'tau_elbow' ends at 0.038 s"),
    "torque that begins": (cells("tau_elbow", "NaN", 0.0, 0.998), "'tau_elbow' begins at 19.96"),
    "no torque": (cells("tau_elbow", ""), "column 'tau_elbow' has no value"),
    "no position": (cells("q_elbow", ""), "column 'q_elbow' has no value"),
    "no row": (share_no_row, "'q_elbow' ends at 9.998 s, 'tau_elbow' begins at 10 s"),
    "clock 10 ms back": (shift(-0.01), BACK),
    "clock a minute back": (shift(-60.0), BACK),
    "stamps twice": (clock(lambda k, t: t - 0.002 * (k % 2)), REPEATS),
    "stamps of 10 ms": (clock(lambda _, t: round(t, 2)), REPEATS),
    "milliseconds": (clock(lambda _, t: 1e3 * t), r"apart.* in ms\? Then name its column"),
    "noise": (noise(50.0, "tau_shoulder", "tau_elbow"), r"noise is more than half.*spoiled\.csv"),
}


@pytest.mark.parametrize("case", REFUSED)
@pytest.mark.parametrize("role", [FITTED, HELD_OUT])
def test_diagnose_refuses(rubbing: Path, tmp_path: Path, role: str, case: str) -> None:
    spoil, words = REFUSED[case]
    message = refused(
        tmp_path / "run", *arguments(rubbing, tmp_path, role, spoil), command="diagnose"
    )
    assert re.search(words, message), message
    assert "millisecond" not in message


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ("one row", "it has 1 row"),
        ("three rows", "6 positions for 4 initial states"),
        ("all positions equal", STILL),
        ("no position", "'q_elbow' has no value"),
        ("no row", "'q_elbow' ends at 9.998 s, 'tau_elbow' begins at 10 s"),
        ("clock 10 ms back", BACK),
        ("stamps twice", REPEATS),
        ("milliseconds", r"rows are 2 s apart, .* time \[ms\]"),
    ],
)
def test_the_motion_loss_refuses(rubbing: Path, tmp_path: Path, case: str, words: str) -> None:
    model, data, *_ = arguments(rubbing, tmp_path, FITTED, REFUSED[case][0])
    message = refused(tmp_path / "run", model, data, "--loss", "motion")
    assert re.search(words, message), message


def test_the_motion_loss_refuses_held_out_rows_that_stand_still(
    rubbing: Path, tmp_path: Path
) -> None:
    message = refused(
        tmp_path / "run", *arguments(rubbing, tmp_path, HELD_OUT, still), "--loss", "motion"
    )
    assert re.search(STILL, message), message


@pytest.mark.parametrize("case", ["all positions equal", "one row", "no row", "milliseconds"])
def test_identify_refuses(rubbing: Path, tmp_path: Path, case: str) -> None:
    spoil, words = REFUSED[case]
    model, data, *rest = arguments(rubbing, tmp_path, FITTED, spoil)
    message = refused(tmp_path / "run", model, data, *(rest if case == "milliseconds" else ()))
    assert re.search(words, message), message
    assert "millisecond" not in message


# --- recordings that are not


def diagnosed(rubbing: Path, folder: Path, role: str, spoil: Spoil) -> tuple[Any, str]:
    """Result and text."""
    run = folder / "run"
    text = done("diagnose", *arguments(rubbing, folder, role, spoil), "-o", run, "--quiet")
    return load(run / "result.json"), text


def causes(result: Any) -> list[tuple[str, str]]:
    return [(cause["effect"], cause["where"]) for cause in result["causes"]]


NOTHING = r"\ANAMED"
HARMLESS = {
    "a run of three rows": (runs(3), NOTHING),
    "a run of one row": (runs(1), NOTHING),
    "torque that ends early": (cells("tau_elbow", "", 0.7), r"'tau_elbow' in .*ends at 14 s"),
    "torque that begins late": (cells("tau_elbow", "NaN", 0, 0.3), r"'tau_elbow' in .*begins at 6"),
    "position that ends early": (cells("q_elbow", "", 0.7), r"'q_elbow' in .*ends at 14 s"),
    "clock a minute ahead": (shift(60.0), NOTHING),
    "a stamp that repeats": (clock(lambda k, t: t - 0.002 * (k % 250 == 50)), "quarantined"),
    "a stamp a minute ahead": (clock(lambda k, t: t + 60.0 * (k == 5000)), "quarantined"),
    "clock a ms ahead": (clock(lambda k, t: t + 0.001 * (k // 400)), NOTHING),
    "stamps a ms late": (clock(lambda k, t: t + 0.001 * (k % 97 == 50)), NOTHING),
}


@pytest.mark.parametrize("case", HARMLESS)
@pytest.mark.parametrize("role", [FITTED, HELD_OUT])
def test_diagnose_names_the_cause_all_the_same(
    rubbing: Path, tmp_path: Path, role: str, case: str
) -> None:
    spoil, words = HARMLESS[case]
    result, text = diagnosed(rubbing, tmp_path, role, spoil)
    assert result["verdict"] == "NAMED"
    assert causes(result) == [("coulomb_friction", "elbow")]
    low, high = result["causes"][0]["parameters"][0]["ci95"]
    assert low <= 0.05 <= high
    # The base has no friction at all, which is said first.
    assert text.count("WARNING") == text.count("WARNING: the base has no dry friction at elbow") == 1
    if words != NOTHING:
        assert re.search(words, text), text
        notes = " ".join(result["preprocessing"]["notes"])
        assert re.search(words, notes), notes
        assert ("held-out data: " in notes) == (role == HELD_OUT)


@pytest.mark.parametrize("role", [FITTED, HELD_OUT])
@pytest.mark.parametrize(
    ("spoil", "warning"),
    [
        (cells("tau_elbow", "0", 0.7), "tau_elbow is at fault.* last 3000 rows, from t = 14.002 s"),
        (cells("tau_elbow", "0.2", 0, 0.3), "tau_elbow is at fault.* first 3000 rows"),
        (cells("tau_elbow", "0.2"), "tau_elbow is at fault.* stays 0.2 N"),
        (cells("q_elbow", "0.2"), "q_elbow is at fault.* stays 0.2 rad"),
        (noise(10.0, "tau_elbow"), r"noise is more than half.*elbow: noise of 3.*spoiled\.csv"),
    ],
    ids=["zero at the end", "held at the start", "held", "dead encoder", "noise"],
)
def test_a_channel_that_says_nothing_is_named_first(
    rubbing: Path, tmp_path: Path, role: str, spoil: Spoil, warning: str
) -> None:
    result, text = diagnosed(rubbing, tmp_path, role, spoil)
    assert result["verdict"] not in ("NONE", "NAMED", "CLASS")
    assert re.search("WARNING: " + warning, text), text
    assert text.index("WARNING: ") < text.index("torque error on held-out data")


def test_floors_of_a_simulation_without_noise_are_said(tmp_path: Path) -> None:
    for seed, name in enumerate((FITTED, HELD_OUT), start=1):
        motion, out = tmp_path / "motion.csv", tmp_path / f"{name}.csv"
        done("excite", PENDULUM, "--duration", 10, "-o", motion, "--seed", seed, "--quiet")
        done("simulate", PENDULUM, "--trajectory", motion, "-o", out, "--noise", 0, "--quiet")
    files = (tmp_path / "train.csv", "--test", tmp_path / "test.csv")
    text = done("diagnose", PENDULUM, *files, "-o", tmp_path / "run", "--quiet")
    result = load(tmp_path / "run" / "result.json")
    assert result["verdict"] == "NONE"
    note = next(note for note in result["notes"] if "less noise than any sensor" in note)
    assert "shoulder" in note
    assert "elbow" in note
    assert note in text


def test_a_drive_at_its_limit_all_the_time_is_no_fault(tmp_path: Path) -> None:
    """Torques that are measured at the limit are the torques."""
    rubs = PENDULUM.read_text().replace(
        '<joint name="elbow" type="continuous">',
        '<joint name="elbow" type="continuous"><dynamics friction="0.05"/>',
    )
    at = rubs.index('effort="12"', rubs.index('<joint name="elbow"'))
    weak = tmp_path / "weak.urdf"
    weak.write_text(rubs[:at] + 'effort="0.25"' + rubs[at + len('effort="12"') :])
    for seed, name in enumerate((FITTED, HELD_OUT), start=1):
        motion, out = tmp_path / "motion.csv", tmp_path / f"{name}.csv"
        common = ("--seed", seed, "--quiet")
        done("excite", PENDULUM, "--duration", 10, "-o", motion, *common)
        done("simulate", weak, "--trajectory", motion, "-o", out, "--noise", 1, *common)
    files = (tmp_path / "train.csv", "--test", tmp_path / "test.csv")
    done("diagnose", PENDULUM, *files, "-o", tmp_path / "run", "--quiet")
    result = load(tmp_path / "run" / "result.json")
    assert result["verdict"] == "NAMED"
    assert causes(result) == [("coulomb_friction", "elbow")]


def test_windows_that_fall_apart_are_counted_with_time_joint_and_horizon(
    rubbing: Path, tmp_path: Path
) -> None:
    result, text = diagnosed(rubbing, tmp_path, HELD_OUT, cut(10000))
    apart = result["simulated"]["apart"]
    of_base = [a for a in apart if a["model"] == "base"]
    horizon = next(
        h for h in result["simulated"]["horizons"] if h["horizon"] == of_base[0]["horizon"]
    )
    assert len(of_base) == horizon["apart"]["base"] <= horizon["windows"]
    first = of_base[0]
    assert first["joint"] in ("shoulder", "elbow")
    assert 0.0 <= first["time"] <= 20.0
    words = rf"with the base model from windows of .* s on, {len(of_base)} of {horizon['windows']}"
    assert re.search(rf"{words}: {first['joint']} at [\d.]+ s", text), text


def test_held_out_windows_that_fall_apart_are_no_wrong_sign(rubbing: Path, tmp_path: Path) -> None:
    """A wrong unit of held-out torques: the motion loss says what it sees, and blames nothing."""

    def scale(table: Table) -> Table:
        k = column(table, "tau_elbow")
        for row in table[1:]:
            row[k] = repr(3.0 * float(row[k]))
        return [table[0], *table[1:2001:5]]

    thin = edited(rubbing / "train.csv", tmp_path / "thin.csv", lambda t: [t[0], *t[1:2001:5]])
    shutil.copy(rubbing / "train.json", tmp_path / "thin.json")
    bad = edited(rubbing / "test.csv", tmp_path / "bad.csv", scale)
    shutil.copy(rubbing / "test.json", tmp_path / "bad.json")
    run = tmp_path / "run"
    text = diffnea("identify", PENDULUM, thin, "--test", bad, "--loss", "motion", "-o", run).stdout
    note = next(n for n in load(run / "result.json")["notes"] if "of held-out data falls" in n)
    assert re.search(r"horizon of .* s: in 1 of 1 windows, after .* e\.g\. \w+ at [\d.]+ s", note)
    assert note in text
    assert "same signs" not in text
