"""Recordings that are spoiled: what `diagnose` and `identify` say of them, fitted and held out."""

import math
import random
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from cli import PENDULUM, Table, column, diffnea, done, edited, load, refused

FITTED, HELD_OUT = "train", "test"
Spoil = Callable[[Table], Table | None]

# --- what can be wrong


def cut(rows: int) -> Spoil:
    return lambda table: table[: rows + 1]


def runs(rows: int, *, every: bool = False) -> Spoil:
    """A run of so many rows among good ones, or of nothing else."""

    def split(table: Table) -> Table:
        half = len(table) // 2
        run = (lambda k: k // rows) if every else (lambda k: (k >= half) + (k >= half + rows))
        return [[*row, "run" if k == 0 else str(run(k - 1))] for k, row in enumerate(table)]

    return split


def column_of(name: str, value: str, first: float = 0.0, last: float = 1.0) -> Spoil:
    """One value from one part of the rows to another."""

    def fill(table: Table) -> None:
        rows = len(table) - 1
        for row in table[1 + round(first * rows) : 1 + round(last * rows)]:
            row[column(table, name)] = value

    return fill


def still(table: Table) -> None:
    for name in ("q_shoulder", "q_elbow"):
        column_of(name, table[1][column(table, name)])(table)


def shared_by_none(table: Table) -> None:
    column_of("q_elbow", "", 0.5, 1.0)(table)
    column_of("tau_elbow", "", 0.0, 0.5)(table)


def clock(change: Callable[[int, float], float]) -> Spoil:
    """Time stamps of rows, counted from 0."""

    def turn(table: Table) -> None:
        for k, row in enumerate(table[1:]):
            row[0] = repr(round(change(k, float(row[0])), 6))

    return turn


def noise(*columns: str, size: float) -> Spoil:
    def add(table: Table) -> None:
        rng = random.Random(1)
        for row in table[1:]:
            for name in columns:
                k = column(table, name)
                row[k] = repr(float(row[k]) + rng.gauss(0.0, size))

    return add


def set_back(by: float) -> Spoil:
    return clock(lambda k, t: t - (by if k >= 5000 else 0.0))


ROW = "it has 1 row, expected the rows of a motion"
SHORT = r"\.csv: .*[Rr]ecord"
STILL = r"no joint.* moves \(shoulder, elbow\)"
ENDS = "'tau_elbow' ends at 0.038 s"
BACK = r"spoiled\.csv:\d+: the clock is set back, from .* in a column `run`"
REPEATS = r"line 3: time repeats \(0\).*write `time` with more digits"
NO_ROW = "'q_elbow' ends at 9.998 s, 'tau_elbow' begins at 10 s"


def spoiled(rubbing: Path, folder: Path, role: str, spoil: Spoil) -> tuple[Path, ...]:
    """Arguments of model, recordings and held-out ones, one of which is spoiled."""
    bad = edited(rubbing / f"{role}.csv", folder / "spoiled.csv", spoil)
    (folder / "spoiled.json").write_bytes((rubbing / f"{role}.json").read_bytes())
    files = {name: rubbing / f"{name}.csv" for name in (FITTED, HELD_OUT)} | {role: bad}
    return PENDULUM, files[FITTED], Path("--test"), files[HELD_OUT]


@pytest.mark.parametrize(
    ("spoil", "roles", "words"),
    [
        pytest.param(cut(1), "both", ROW, id="one row"),
        pytest.param(cut(3), "both", SHORT, id="three rows"),
        pytest.param(runs(3, every=True), "both", SHORT, id="runs of three rows"),
        pytest.param(still, "both", STILL, id="all positions equal"),
        pytest.param(column_of("tau_elbow", "", 0.002), "both", ENDS, id="torque ends at once"),
        pytest.param(column_of("tau_elbow", ""), "both", "'tau_elbow' has no value", id="no torque"),
        pytest.param(column_of("q_elbow", ""), "both", "'q_elbow' has no value", id="no position"),
        pytest.param(shared_by_none, "both", NO_ROW, id="columns that share no row"),
        pytest.param(set_back(0.01), "both", BACK, id="clock set back by 10 ms"),
        pytest.param(set_back(60.0), "both", BACK, id="clock set back by a minute"),
        pytest.param(clock(lambda k, t: t - 0.002 * (k % 2)), "both", REPEATS, id="stamps twice"),
        pytest.param(clock(lambda k, t: round(t, 2)), "both", REPEATS, id="stamps of 10 ms"),
        pytest.param(clock(lambda k, t: 1e3 * t), "both", r"in ms\?", id="milliseconds"),
        pytest.param(cut(100), "both", r"0\.2 s of (fitted|held-out) rows", id="0.2 s"),
        pytest.param(
            noise("tau_shoulder", "tau_elbow", size=50.0),
            "both",
            "noise is more than half of the torque's power",
            id="torque that is noise",
        ),
    ],
)
@pytest.mark.parametrize("role", [FITTED, HELD_OUT])
def test_diagnose_refuses(
    rubbing: Path, tmp_path: Path, role: str, spoil: Spoil, roles: str, words: str
) -> None:
    arguments = spoiled(rubbing, tmp_path, role, spoil)
    message = refused(tmp_path / "run", *arguments, command="diagnose")
    assert re.search(words, message), message
    assert "ms" in words or "milli" not in message
