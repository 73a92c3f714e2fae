import pickle
from pathlib import Path

import numpy as np
import pytest

import diffnea

N = 50
TIME = 0.002 * np.arange(N)
NAMES = ["shoulder", "elbow"]


def series(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(N, 2))


def full() -> diffnea.Recording:
    return diffnea.Recording(
        time=TIME,
        q=series(0),
        tau=series(1),
        joint_names=NAMES,
        qd=series(2),
        qcmd=series(3),
        extra={"temperature": series(4)[:, 0]},
        torque_side="link",
        period=10.0,
    )


def assert_same(a: diffnea.Recording, b: diffnea.Recording) -> None:
    for name in ("time", "q", "qd", "qdd", "qcmd", "tau", "ball", "spin"):
        x, y = getattr(a, name), getattr(b, name)
        assert (x is None) == (y is None), name
        if x is not None:
            np.testing.assert_array_equal(x, y, err_msg=name)
    for name in ("joint_names", "has_tau", "torque_side", "torque_sampling", "passive", "period"):
        assert getattr(a, name) == getattr(b, name), name
    assert a.extra.keys() == b.extra.keys()
    for name in a.extra:
        np.testing.assert_array_equal(a.extra[name], b.extra[name])


def test_arrays_come_out_as_they_went_in() -> None:
    r = full()
    np.testing.assert_array_equal(r.q, series(0))
    np.testing.assert_array_equal(r.tau, series(1))
    np.testing.assert_array_equal(r.extra["temperature"], series(4)[:, 0])
    assert r.qdd is None
    assert len(r) == N
    assert (r.torque_side, r.torque_sampling, r.period) == ("link", "instant", 10.0)
    assert "50 rows, 0.098 s, 2 joints [shoulder, elbow]: q, qd, qcmd, tau" in repr(r)
    r.q[:] = 0  # a copy
    np.testing.assert_array_equal(r.q, series(0))


def test_one_joint_needs_no_second_index() -> None:
    r = diffnea.Recording(time=TIME, q=TIME, tau=TIME + 1, joint_names=["slide"])
    assert r.q.shape == (N, 1)
    assert r.tau.shape == (N, 1)


def test_passive_and_prescribed_joints() -> None:
    tau = series(1)
    tau[:, 1] = 0
    r = diffnea.Recording(time=TIME, q=series(0), tau=tau, joint_names=NAMES, passive=["elbow"])
    assert r.has_tau == [True, False]
    tau[:, 1] = np.nan
    r = diffnea.Recording(time=TIME, q=series(0), tau=tau, joint_names=NAMES)
    assert r.has_tau == [True, False]
    assert np.isnan(r.tau[:, 1]).all()


BACKWARD = TIME.copy()
BACKWARD[7] = 0.0
INFINITE = series(0)
INFINITE[3, 1] = np.inf
DEAD = series(1)
DEAD[:, 1] = 0


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"time": BACKWARD}, diffnea.DataError, r"time\[7\] is 0.0+ after 0.012"),
        ({"time": TIME[:-1]}, diffnea.ShapeError, r"q: got shape \(50, 2\), expected \(49, n\)"),
        ({"q": INFINITE}, diffnea.DataError, r"q\[3, 1\] is infinite"),
        (
            {"tau": series(0)[:, :1]},
            diffnea.ShapeError,
            r"tau: got shape \(50, 1\), expected \(50, 2\)",
        ),
        ({"tau": DEAD}, diffnea.DataError, r"'elbow' is zero in every row; passive=\['elbow'\]"),
        ({"joint_names": ["a"]}, diffnea.ShapeError, "q: got shape"),
        ({"joint_names": ["a", "a"]}, diffnea.DataError, "twice"),
        ({"passive": ["wrist"]}, diffnea.DataError, "'wrist', which is not in joint_names"),
        ({"passive": ["elbow"]}, diffnea.DataError, "torque is not zero"),
        ({"torque_side": "left"}, diffnea.DataError, "choices: motor, link"),
        ({"extra": {"x": [1, 2]}}, diffnea.ShapeError, r"extra\['x'\]: got shape \(2,\)"),
        ({"q": "fast"}, TypeError, "q: got str"),
        ({"q": None}, TypeError, "q: got NoneType, expected an array of real numbers"),
        ({"q": series(0) * 1j}, TypeError, "q: got ndarray, expected an array of real numbers"),
    ],
)
def test_what_cannot_be_true_is_refused(change, error, message) -> None:
    arguments = {"time": TIME, "q": series(0), "tau": series(1), "joint_names": NAMES} | change
    with pytest.raises(error, match=message):
        diffnea.Recording(**arguments)


def test_a_stretch_is_a_recording() -> None:
    part = full()[10:20]
    assert len(part) == 10
    np.testing.assert_array_equal(part.tau, series(1)[10:20])
    np.testing.assert_array_equal(part.extra["temperature"], series(4)[10:20, 0])
    with pytest.raises(diffnea.ShapeError, match="step"):
        full()[::2]
    with pytest.raises(diffnea.DataError, match="no rows"):
        full()[60:]


def test_pickle_keeps_everything() -> None:
    assert_same(pickle.loads(pickle.dumps(full())), full())


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_files_keep_everything(tmp_path: Path, suffix: str) -> None:
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    path = tmp_path / f"arm{suffix}"
    diffnea.write_recording(full(), path)
    assert_same(diffnea.read_recording(path), full())
    assert (
        sorted(p.name for p in tmp_path.iterdir())
        == [f"arm{suffix}", "arm.json"][:: 1 if suffix == ".csv" else -1]
    )


def test_several_runs_share_a_file(tmp_path: Path) -> None:
    path = tmp_path / "arm.csv"
    diffnea.write_recording([full(), full()[:20]], path)
    runs = diffnea.read_recordings(path)
    assert [len(run) for run in runs] == [N, 20]
    assert runs.report.rows == N + 20
    with pytest.raises(diffnea.DataError, match=r"arm.csv: holds 2 runs; read_recordings"):
        diffnea.read_recording(path)


def test_a_frame_is_read_as_a_file_is() -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(
        {
            "time [ms]": 1e3 * TIME,
            "q_elbow [deg]": np.rad2deg(series(0)[:, 1]),
            "tau_elbow": series(1)[:, 1],
            "mood": 1.0,
        }
    )
    frame.loc[4, "q_elbow [deg]"] = np.nan
    frame.loc[9, "tau_elbow"] = np.nan
    runs = diffnea.read_recordings(frame)
    assert runs.report.source == "data frame"
    assert runs.report.extra_channels == ["mood"]
    (run,) = runs
    np.testing.assert_allclose(run.time, TIME, atol=1e-15)
    np.testing.assert_allclose(run.q[:4, 0], series(0)[:4, 1], rtol=1e-15)
    assert np.isnan(run.q[4, 0])
    assert np.isnan(run.tau[9, 0])
    with pytest.raises(diffnea.DataError, match=r"data frame:.*tau_wrist"):
        diffnea.Recording.from_frame(frame.rename(columns={"tau_elbow": "tau_wrist"}))


def test_a_recording_survives_its_frame() -> None:
    pytest.importorskip("pandas")
    frame = full().to_frame()
    assert list(frame.columns[:5]) == [
        "time",
        "q_shoulder",
        "qd_shoulder",
        "qcmd_shoulder",
        "tau_shoulder",
    ]
    assert_same(diffnea.Recording.from_frame(frame, torque_side="link", period=10.0), full())


def test_npz_holds_columns_or_arrays(tmp_path: Path) -> None:
    np.savez(tmp_path / "arrays.npz", time=TIME, q=series(0), tau=series(1), joint_names=NAMES)
    columns = {
        f"{c}_{n}": series(k)[:, j] for k, c in enumerate(("q", "tau")) for j, n in enumerate(NAMES)
    }
    np.savez(tmp_path / "columns.npz", time=TIME, **columns)
    expected = diffnea.Recording(time=TIME, q=series(0), tau=series(1), joint_names=NAMES)
    for name in ("arrays", "columns"):
        assert_same(diffnea.read_recording(tmp_path / f"{name}.npz"), expected)
    np.savez(tmp_path / "short.npz", time=TIME, q_elbow=TIME[:3])
    with pytest.raises(diffnea.DataError, match=r"short\.npz: arrays of different lengths"):
        diffnea.read_recording(tmp_path / "short.npz")


def test_what_cannot_be_read_says_why(tmp_path: Path) -> None:
    with pytest.raises(diffnea.FileError, match=r"nowhere\.csv"):
        diffnea.read_recording(tmp_path / "nowhere.csv")
    with pytest.raises(diffnea.FileError, match=r"nowhere\.npz: there is no such file"):
        diffnea.read_recording(tmp_path / "nowhere.npz")
    with pytest.raises(diffnea.FileError, match=r"\.xlsx files are not read; choices: \.csv"):
        diffnea.read_recording(tmp_path / "arm.xlsx")
    with pytest.raises(TypeError, match="got dict, expected a path or a pandas data frame"):
        diffnea.read_recording({"time": TIME})  # type: ignore[arg-type]
    (tmp_path / "bad.csv").write_text("time,q_elbow,tau_elbow\n0,0,1\n0.1,zero,1\n")
    with pytest.raises(diffnea.DataError, match=r"bad\.csv:3:2"):
        diffnea.read_recording(tmp_path / "bad.csv")


def test_without_pandas_the_message_says_what_to_install(monkeypatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        ImportError, match=r"Recording.to_frame needs pandas.*pip install .*pandas>="
    ):
        full().to_frame()


def test_trajectories_go_through_files(tmp_path: Path, arm) -> None:
    motion = diffnea.excite(arm, duration=10, seed=1)
    motion.save(tmp_path / "motion.csv")
    for back in (
        diffnea.read_trajectory(tmp_path / "motion.csv"),
        pickle.loads(pickle.dumps(motion)),
    ):
        for name in ("time", "q", "qd", "qdd"):
            np.testing.assert_array_equal(getattr(back, name), getattr(motion, name))
        assert back.joint_names == motion.joint_names
    pytest.importorskip("pandas")
    assert "qddcmd_elbow" in motion.to_frame().columns
