"""Properties of files that hold for every recording and model, not for one example.

The examples are the same in every run (``derandomize``); what hypothesis finds is added here as an
example of its own.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import diffnea

hypothesis = pytest.importorskip("hypothesis")
from hypothesis import HealthCheck, given, settings  # noqa: E402
from hypothesis import strategies as st  # noqa: E402

# Examples write files: some need longer than hypothesis' 200 ms on a loaded machine.
repeatable = settings(
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow],
)

NAMES = st.from_regex(r"[A-Za-z][A-Za-z0-9_./ -]{0,8}[A-Za-z0-9]", fullmatch=True)
ANY_NAME = st.text(max_size=8)


def numbers(largest: float) -> st.SearchStrategy[float]:
    return st.floats(-largest, largest, allow_subnormal=True)


@st.composite
def recordings(draw: st.DrawFn, names: st.SearchStrategy[str] = NAMES) -> diffnea.Recording:
    """Up to 12 rows of up to 3 joints, with gaps, and now and then every channel there is."""
    joints = draw(st.lists(names, min_size=1, max_size=3, unique=True))
    rows = draw(st.integers(2, 12))
    shape = (rows, len(joints))

    def series(largest: float, gaps: bool = False) -> np.ndarray:
        value = numbers(largest)
        if gaps:
            value = st.one_of(value, st.just(math.nan))
        count = shape[0] * shape[1]
        return np.array(draw(st.lists(value, min_size=count, max_size=count))).reshape(shape)

    steps = draw(st.lists(st.floats(1e-6, 10.0), min_size=rows, max_size=rows))
    tau = series(1e3, gaps=True)
    tau[0] = draw(st.floats(0.5, 2.0))  # a torque that is 0 or missing throughout is refused
    q = series(1e3, gaps=True)
    q[0] = draw(st.floats(-1.0, 1.0))  # a position that is missing throughout, too
    optional: dict[str, Any] = {}
    for name in ("qd", "qdd", "qcmd"):
        if draw(st.booleans()):
            optional[name] = series(1e3)
    if draw(st.booleans()):
        optional["ball"] = np.arange(3.0 * rows).reshape(rows, 3)
    if draw(st.booleans()):
        optional["period"] = draw(st.floats(0.1, 100.0))
    return diffnea.Recording(
        time=np.cumsum(steps),
        q=q,
        tau=tau,
        joint_names=joints,
        torque_side=draw(st.sampled_from(["motor", "link"])),
        **optional,
    )


def assert_same(a: diffnea.Recording, b: diffnea.Recording) -> None:
    assert a.joint_names == b.joint_names
    assert (a.torque_side, a.torque_sampling, a.period) == (
        b.torque_side,
        b.torque_sampling,
        b.period,
    )
    for name in ("time", "q", "tau", "qd", "qdd", "qcmd", "ball", "spin"):
        x, y = getattr(a, name), getattr(b, name)
        assert (x is None) == (y is None), name
        if x is not None:
            np.testing.assert_array_equal(x, y, err_msg=name)


@repeatable
@given(recording=recordings())
def test_a_recording_comes_back_from_csv_bit_by_bit(recording: diffnea.Recording) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.csv"
        diffnea.write_recording(recording, path)
        assert_same(recording, diffnea.read_recording(path))


@settings(repeatable, max_examples=15)
@given(recording=recordings())
def test_a_recording_comes_back_from_parquet_bit_by_bit(recording: diffnea.Recording) -> None:
    pytest.importorskip("pyarrow")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.parquet"
        diffnea.write_recording(recording, path)
        assert_same(recording, diffnea.read_recording(path))


@settings(repeatable, max_examples=30)
@given(recording=recordings())
def test_arrays_of_an_npz_come_back_bit_by_bit(recording: diffnea.Recording) -> None:
    arrays = {"time": recording.time, "q": recording.q, "tau": recording.tau}
    for name in ("qd", "qdd", "qcmd", "ball"):
        values = getattr(recording, name)
        if values is not None:
            arrays[name] = values
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.npz"
        np.savez(path, joint_names=np.array(recording.joint_names), **arrays)
        back = diffnea.read_recording(
            path,
            torque_side=recording.torque_side,
            torque_sampling=recording.torque_sampling,
            period=recording.period,
        )
        assert_same(recording, back)


@repeatable
@given(recording=st.one_of(recordings(ANY_NAME), recordings(st.text(",[]\"\n\r '#=é", max_size=3))))
def test_a_name_that_a_file_cannot_hold_is_refused_or_comes_back(
    recording: diffnea.Recording,
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.csv"
        try:
            diffnea.write_recording(recording, path)
        except diffnea.Error:
            return
        assert_same(recording, diffnea.read_recording(path))


UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "q_a": {"rad": 1.0, "deg": math.pi / 180, "mrad": 1e-3, "m": 1.0, "mm": 1e-3},
    "qd_a": {"rad/s": 1.0, "deg/s": math.pi / 180, "rpm": math.pi / 30, "m/s": 1.0},
    "tau_a": {"N*m": 1.0, "N·m": 1.0, "mNm": 1e-3, "N": 1.0, "kN": 1000.0},
}


@repeatable
@given(data=st.data())
def test_units_are_factors(data: st.DataObject) -> None:
    rows = data.draw(st.integers(2, 6))
    columns, expected, header = [], {}, []
    for name, units in UNITS.items():
        unit = data.draw(st.sampled_from(sorted(units)))
        values = data.draw(st.lists(st.floats(0.5, 1e4), min_size=rows, max_size=rows))
        if name == "time":
            values = np.cumsum(values).tolist()
        header.append(f"{name} [{unit}]")
        columns.append(values)
        expected[name] = np.array(values) * units[unit]
    text = ",".join(header) + "\n"
    text += "".join(",".join(map(repr, row)) + "\n" for row in zip(*columns, strict=True))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.csv"
        path.write_text(text, encoding="utf-8")
        read = diffnea.read_recording(path)
    np.testing.assert_array_equal(read.time, expected["time"])
    for name, values in (("q_a", read.q), ("qd_a", read.qd), ("tau_a", read.tau)):
        np.testing.assert_array_equal(values[:, 0], expected[name], err_msg=name)


@st.composite
def models(draw: st.DrawFn) -> dict[str, Any]:
    """The dictionary of a tree of up to 6 links."""

    def vector(largest: float) -> list[float]:
        return draw(st.lists(numbers(largest), min_size=3, max_size=3))

    names = draw(st.lists(ANY_NAME.filter(bool), min_size=1, max_size=6, unique=True))
    joints = draw(
        st.lists(ANY_NAME.filter(bool), min_size=len(names), max_size=len(names), unique=True)
    )
    links = []
    for i, name in enumerate(names):
        parent = draw(st.integers(-1, i - 1))
        kind = draw(st.sampled_from(["fixed", "revolute", "prismatic"]))
        joint = {"name": joints[i], "type": kind, "pose": {"position": vector(10.0)}}
        if kind != "fixed":
            joint["axis"] = draw(st.sampled_from([[1, 0, 0], [0, -1, 0], [0, 0.6, 0.8]]))
            if draw(st.booleans()):
                joint["limits"] = {"lower": -1.0, "upper": draw(st.floats(0.0, 10.0))}
        link = {"name": name, "joint": joint}
        if parent >= 0:
            link["parent"] = names[parent]
        if draw(st.booleans()):
            link["inertia"] = {
                "mass": draw(st.floats(1e-6, 1e3)),
                "first_moment": vector(10.0),
                "about_origin": [1.0, *draw(st.lists(numbers(1.0), min_size=5, max_size=5))],
            }
        links.append(link)
    return {"schema": "diffnea/model/1", "name": draw(ANY_NAME), "links": links}


@repeatable
@given(data=models())
def test_a_model_comes_back_from_its_json(data: dict[str, Any]) -> None:
    model = diffnea.Model.from_dict(data)
    assert model.joint_names == [
        link["joint"]["name"] for link in data["links"] if link["joint"]["type"] != "fixed"
    ]
    assert diffnea.Model.from_dict(model.to_dict()).to_dict() == model.to_dict()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.json"
        model.save(path)
        assert diffnea.load_model(path).to_dict() == model.to_dict()
