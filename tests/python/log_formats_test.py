"""Logs as they come: LeRobot's data sets, BAM's JSON, bags with a topic of commands."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli import BAD_INPUT, done
from cli import diffnea as command
from readers_test import NAMES, START, TIME, Joints, N, series, storage_of, write_bag

import diffnea

ARM = ["shoulder_pan", "elbow_flex", "gripper"]
FPS = 30


def data_set(
    folder: Path, state: np.ndarray, action: np.ndarray, *, names: Any, robot: str, version: int
) -> Path:
    """Write a data set of two episodes as LeRobot does: version 2 a file each, 3 one of all."""
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    rows = len(state)
    episode = (np.arange(rows) >= rows // 2).astype(int)
    frame_index = np.where(episode == 0, np.arange(rows), np.arange(rows) - rows // 2)
    frame = pandas.DataFrame(
        {
            "action": list(action.astype(np.float32)),
            "observation.state": list(state.astype(np.float32)),
            "timestamp": (frame_index / FPS).astype(np.float32),
            "frame_index": frame_index,
            "episode_index": episode,
            "index": np.arange(rows),
            "task_index": 0,
        }
    )
    chunk = folder / "data" / "chunk-000"
    chunk.mkdir(parents=True)
    if version == 2:
        for k in (0, 1):
            frame[episode == k].to_parquet(chunk / f"episode_{k:06d}.parquet")
    else:
        frame.to_parquet(chunk / "file-000.parquet")
    feature = {"dtype": "float32", "shape": [len(ARM)], "names": names}
    info = {
        "codebase_version": f"v{version}.0",
        "robot_type": robot,
        "fps": FPS,
        "features": {"action": feature, "observation.state": feature},
    }
    (folder / "meta").mkdir()
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return folder


def motion() -> tuple[np.ndarray, np.ndarray]:
    """State and action in degrees, 80 frames."""
    phase = np.arange(80)[:, None] / 9.0 + np.array([0.0, 1.0, 2.0])
    return 40.0 * np.sin(phase - 0.3), 45.0 * np.sin(phase)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(
    "names", [[f"{x}.pos" for x in ARM], {"motors": [f"{x}.pos" for x in ARM]}]
)
def test_episodes_of_lerobot_are_runs(tmp_path: Path, version: int, names: Any) -> None:
    state, action = motion()
    folder = data_set(
        tmp_path / "ds", state, action, names=names, robot="so101_follower", version=version
    )
    runs = diffnea.read_recordings(folder)
    assert [len(run) for run in runs] == [40, 40]
    assert runs[0].joint_names == ARM[:2]  # the gripper's per cent is no angle
    np.testing.assert_allclose(runs[1].q, np.deg2rad(state[40:, :2]), atol=1e-6)
    np.testing.assert_allclose(runs[1].qcmd, np.deg2rad(action[40:, :2]), atol=1e-6)
    np.testing.assert_allclose(runs[0].time, np.arange(40) / FPS, atol=1e-12)
    notes = " ".join(runs.report.notes)
    assert "taken as degrees" in notes
    assert "number of the frame at 30 a second" in notes
    assert 'gripper.pos=q_gripper [0.0175*rad]" says what a per cent is' in notes


def test_one_file_of_a_data_set_finds_its_names(tmp_path: Path) -> None:
    state, action = motion()
    names = [f"{x}.pos" for x in ARM]
    folder = data_set(tmp_path / "ds", state, action, names=names, robot="so101", version=3)
    file = folder / "data" / "chunk-000" / "file-000.parquet"
    assert diffnea.read_recordings(file)[0].joint_names == ARM[:2]
    (folder / "meta" / "info.json").unlink()
    with pytest.raises(diffnea.DataError, match=r'--map "observation\.state\.0=q_shoulder_pan'):
        diffnea.read_recordings(file)
    names = {f"observation.state.{k}": f"q_{joint} [deg]" for k, joint in enumerate(ARM)}
    runs = diffnea.read_recordings(file, columns=names)
    np.testing.assert_allclose(runs[0].q, np.deg2rad(state[:40]), atol=1e-6)


def test_per_cent_of_a_calibrated_range_is_no_angle(tmp_path: Path) -> None:
    state, action = motion()
    action[7, 0] = 100.0  # where the range ends
    names = [f"{x}.pos" for x in ARM]
    folder = data_set(tmp_path / "ds", state, action, names=names, robot="so101", version=3)
    with pytest.raises(diffnea.DataError, match="per cent of each joint's calibrated range"):
        diffnea.read_recordings(folder)
    law = "observation.state.elbow_flex.pos=q_elbow_flex [0.02*rad+0.1]"
    (run, _) = diffnea.read_recordings(folder, columns=law)
    np.testing.assert_allclose(run.q[:, 0], 0.02 * state[:40, 1] + 0.1, atol=1e-6)


def test_a_file_without_names_whose_columns_end_at_100_is_not_called_degrees(
    tmp_path: Path,
) -> None:
    state, action = motion()
    action[7, 1] = 100.0
    folder = data_set(tmp_path / "ds", state, action, names=ARM, robot="so101", version=3)
    (folder / "meta" / "info.json").unlink()
    with pytest.raises(diffnea.DataError, match=r"rad\+0\.1\]\"; positions end at exactly 100"):
        diffnea.read_recordings(folder / "data" / "chunk-000" / "file-000.parquet")


def test_radians_stay_radians(tmp_path: Path) -> None:
    state, action = motion()
    names = ARM
    folder = data_set(
        tmp_path / "ds", state / 57.3, action / 57.3, names=names, robot="aloha", version=2
    )
    run = diffnea.read_recordings(folder)[0]
    assert run.joint_names == ARM
    np.testing.assert_allclose(run.q, state[:40] / 57.3, atol=1e-6)


def bam_log(path: Path) -> Path:
    entries = [
        {
            "position": 0.1 * k,
            "speed": 1.0,
            "load": 3,
            "input_volts": 7.3,
            "timestamp": 0.005 * k,
            "goal_position": 0.2 * k,
            "torque_enable": True,
        }
        for k in range(30)
    ]
    bench = {"mass": 0.49, "length": 0.1, "kp": 400, "vin": 7.4, "motor": "xl330"}
    path.write_text(json.dumps(bench | {"entries": entries}))
    return path


def test_a_log_of_bam_is_a_recording(tmp_path: Path) -> None:
    runs = diffnea.read_recordings(bam_log(tmp_path / "run.json"))
    assert runs[0].joint_names == ["servo"]
    np.testing.assert_allclose(runs[0].q[:, 0], 0.1 * np.arange(30))
    np.testing.assert_allclose(runs[0].qcmd[:, 0], 0.2 * np.arange(30))
    assert "mass 0.49, length 0.1, kp 400, vin 7.4, motor xl330" in runs.report.notes[0]
    assert "load_raw, voltage [V], torque_enable" in " ".join(runs.report.notes)
    (tmp_path / "other.json").write_text('{"entries": [{"speed": 1}]}')
    with pytest.raises(diffnea.DataError, match="entries have no timestamp, position"):
        diffnea.read_recordings(tmp_path / "other.json")


def test_commands_of_another_topic_are_held(tmp_path: Path) -> None:
    commands = Joints(["elbow"], columns=[1])
    commands.position = 10.0 + series(5)
    commands.rows = range(3, N, 4)
    topics: dict[str, Joints | list[Joints]] = {"/joint_states": Joints(), "/commands": commands}
    bag = write_bag(tmp_path / "mcap", topics)
    runs = diffnea.read_recordings(bag, command_topic="/commands")
    assert runs[0].joint_names == NAMES
    held = np.full(N, np.nan)
    for row in range(3, N):
        held[row] = commands.position[3 + 4 * ((row - 3) // 4), 1]
    np.testing.assert_array_equal(runs[0].qcmd[:, 1], held)
    assert np.isnan(runs[0].qcmd[:, 0]).all()
    assert "10 commands of topic /commands, each held until the next" in " ".join(runs.report.notes)
    assert "none is of shoulder" in " ".join(runs.report.notes)
    with pytest.raises(diffnea.DataError, match=r"several topics.*--command-topic"):
        diffnea.read_recordings(bag)
    with pytest.raises(diffnea.DataError, match=r"command_topic: got '/x'; topics of commands: /c"):
        diffnea.read_recordings(bag, command_topic="/x")


def write_trajectories(path: Path) -> Path:
    """Write a bag of joint states and of one trajectory of two points, 0.1 and 0.2 s ahead."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = {name: store.types[name] for name in (
        "std_msgs/msg/Header", "builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration",
        "sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory",
        "trajectory_msgs/msg/JointTrajectoryPoint",
    )}  # fmt: skip
    none = np.zeros(0)

    def header(row: int) -> Any:
        at = START + row * 10_000_000
        stamp = kinds["builtin_interfaces/msg/Time"](at // 10**9, at % 10**9)
        return kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="")

    def point(seconds: float, value: float) -> Any:
        return kinds["trajectory_msgs/msg/JointTrajectoryPoint"](
            positions=np.array([value]),
            velocities=np.array([10.0 * value]),
            accelerations=none,
            effort=np.array([-value]),
            time_from_start=kinds["builtin_interfaces/msg/Duration"](0, int(seconds * 1e9)),
        )

    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        state = writer.add_connection("/s", "sensor_msgs/msg/JointState", typestore=store)
        planned = writer.add_connection(
            "/plan", "trajectory_msgs/msg/JointTrajectory", typestore=store
        )
        plan = kinds["trajectory_msgs/msg/JointTrajectory"](
            header=header(0), joint_names=["a"], points=[point(0.1, 1.0), point(0.2, 2.0)]
        )
        raw = store.serialize_cdr(plan, "trajectory_msgs/msg/JointTrajectory")
        writer.write(planned, START, raw)
        for row in range(N):
            message = kinds["sensor_msgs/msg/JointState"](
                header(row), name=["a"], position=np.array([0.1 * row]), velocity=none, effort=none
            )
            raw = store.serialize_cdr(message, "sensor_msgs/msg/JointState")
            writer.write(state, START + row * 10_000_000, raw)
    return path


def test_points_of_a_trajectory_are_commands_at_their_times(tmp_path: Path) -> None:
    run = diffnea.read_recording(write_trajectories(tmp_path / "mcap"), command_topic="/plan")
    expected = np.where(TIME < 0.1 - 1e-9, np.nan, np.where(TIME < 0.2 - 1e-9, 1.0, 2.0))
    np.testing.assert_array_equal(run.qcmd[:, 0], expected)
    np.testing.assert_array_equal(run.qdcmd[:, 0], 10.0 * expected)
    np.testing.assert_array_equal(run.taucmd[:, 0], -expected)


def test_the_command_reads_what_python_reads(tmp_path: Path) -> None:
    state, action = motion()
    names = [f"{x}.pos" for x in ARM]
    folder = data_set(tmp_path / "ds", state, action, names=names, robot="so101", version=3)
    topics: dict[str, Joints | list[Joints]] = {"/joint_states": Joints(), "/c": Joints()}
    bag = write_bag(tmp_path / "mcap", topics)
    np.savez(tmp_path / "log.npz", time=TIME, q=series(0), tau=series(1), joint_names=NAMES)
    for log, *options in (
        [folder],
        [bam_log(tmp_path / "run.json")],
        [bag, "--command-topic", "/c"],
        [storage_of(bag), "--topic", "/c", "--clock", "receive"],
        [tmp_path / "log.npz"],
    ):
        answer = json.loads(done("audit", log, *options, "--json"))
        assert answer["rows"] == sum(
            map(
                len,
                diffnea.read_recordings(
                    log,
                    command_topic="/c" if "--command-topic" in options else None,
                    topic="/c" if "--topic" in options else None,
                ),
            )
        )
        assert answer["data"] == [str(log)]


def test_the_command_says_in_the_readers_words_what_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "log.npz").write_bytes(b"nothing")
    answer = command("audit", tmp_path / "log.npz")
    assert answer.returncode == BAD_INPUT
    assert answer.stderr.startswith(f"{tmp_path / 'log.npz'}: cannot be read as NPZ")
    assert answer.stderr.count("\n") == 1
    answer = command("audit", tmp_path / "log.parquet")
    assert answer.stderr == f"{tmp_path / 'log.parquet'}: there is no such file\n"
    (tmp_path / "log.parquet").write_bytes(b"nothing")
    monkeypatch.setenv("DIFFNEA_PYTHON", "/bin/false")
    answer = command("audit", tmp_path / "log.parquet")
    assert answer.returncode == BAD_INPUT
    assert "is a Parquet file, which diffnea's package for Python reads" in answer.stderr
    assert "pip install '.[parquet]'" in answer.stderr


def test_what_drives_are_told_beside_positions(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    head = "time,q_a,qcmd_a,qdcmd_a [deg/s],taucmd_a [mNm]\n"
    log.write_text(head + "".join(f"{0.01 * k},0,0,{90 * k},{500 * k}\n" for k in range(9)))
    run = diffnea.read_recording(log)
    np.testing.assert_allclose(run.qdcmd[:, 0], 0.5 * np.pi * np.arange(9))
    np.testing.assert_allclose(run.taucmd[:, 0], 0.5 * np.arange(9))
    diffnea.write_recording(run, tmp_path / "again.csv")
    again = diffnea.read_recording(tmp_path / "again.csv")
    np.testing.assert_array_equal(again.taucmd, run.taucmd)
    columns = {"time": run.time, "q": run.q, "joint_names": ["a"]}
    arrays = diffnea.Recording(**columns, qdcmd=run.qdcmd, taucmd=run.taucmd)
    np.testing.assert_array_equal(arrays.qdcmd, run.qdcmd)
    assert "qdcmd, taucmd" in repr(arrays)
