"""Recordings in foreign formats, each written here by the library that others write it with."""

import pickle
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli import BAD_INPUT
from cli import diffnea as command

import diffnea
from diffnea import convert
from diffnea._readers.packages import install_command

N = 40
TIME = 0.01 * np.arange(N)
NAMES = ["shoulder", "elbow"]
START = 1_700_000_000_123_456_789  # [ns], what a clock of today says


def series(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(N, 2))


def full() -> diffnea.Recording:
    return diffnea.Recording(time=TIME, q=series(0), tau=series(1), qd=series(2), joint_names=NAMES)


def assert_same(a: diffnea.Recording, b: diffnea.Recording, *, time: float = 0.0) -> None:
    np.testing.assert_allclose(a.time, b.time, rtol=0, atol=time)
    assert a.joint_names == b.joint_names
    assert a.has_tau == b.has_tau
    for name in ("q", "qd", "tau"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


class Joints:
    """Messages of joint states, as a driver sends them."""

    def __init__(self, names: Sequence[str] = NAMES, *, columns: Sequence[int] = (0, 1)) -> None:
        self.names, self.columns = list(names), list(columns)
        self.position, self.velocity, self.effort = series(0), series(2), series(1)
        self.stamps = START + np.arange(N) * 10_000_000
        self.rows: Sequence[int] = range(N)

    def values(self, series: np.ndarray | None, row: int) -> np.ndarray:
        return np.zeros(0) if series is None else series[row, self.columns]


def write_bag(path: Path, topics: dict[str, Joints | list[Joints]]) -> Path:
    """Write a bag: ROS 1 if it is called .bag, else ROS 2; received 3 ms after the stamps."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    ros1 = path.suffix == ".bag"
    types = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    kind = "sensor_msgs/msg/JointState"
    header, stamp = types.types["std_msgs/msg/Header"], types.types["builtin_interfaces/msg/Time"]

    def message(sender: Joints, row: int) -> Any:
        at = stamp(int(sender.stamps[row] // 10**9), int(sender.stamps[row] % 10**9))
        return types.types[kind](
            header(*([row] if ros1 else []), stamp=at, frame_id=""),
            name=sender.names,
            position=sender.values(sender.position, row),
            velocity=sender.values(sender.velocity, row),
            effort=sender.values(sender.effort, row),
        )

    plugin = StoragePlugin.MCAP if path.name.startswith("mcap") else StoragePlugin.SQLITE3
    writer: Any = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=plugin)
    encode = types.serialize_ros1 if ros1 else types.serialize_cdr
    with writer:
        for number, (topic, given) in enumerate(topics.items()):
            senders = given if isinstance(given, list) else [given]
            # A ROS 2 bag does not tell publishers apart.
            connections = [
                writer.add_connection(
                    topic,
                    kind,
                    typestore=types,
                    **({"callerid": f"/driver{number}_{k}"} if ros1 else {}),
                )
                for k in range(len(senders) if ros1 else 1)
            ]
            for row, k in sorted((row, k) for k, x in enumerate(senders) for row in x.rows):
                received = START + row * 10_000_000 + 3_000_000
                raw = encode(message(senders[k], row), kind)
                writer.write(connections[k if ros1 else 0], received, raw)
    return path


def storage_of(bag: Path) -> Path:
    """Return the one file beside metadata.yaml."""
    (file,) = (x for x in bag.iterdir() if x.suffix in (".db3", ".mcap"))
    return file


@pytest.mark.parametrize("name", ["mcap", "db3", "one.bag"])
def test_joint_states_of_a_bag_are_a_recording(tmp_path: Path, name: str) -> None:
    bag = write_bag(tmp_path / name, {"/joint_states": Joints()})
    sources = [bag] if bag.is_file() else [bag, storage_of(bag)]
    for source in sources:
        runs = diffnea.read_recordings(source)
        assert_same(runs[0], full(), time=1e-9)
        assert runs[0].time[0] == 0.0
        assert "time 0 is 1700000000.123456789 s of the header's clock" in runs.report.notes[0]


def test_the_clock_may_be_that_of_the_recorder(tmp_path: Path) -> None:
    late = Joints()
    late.stamps = np.zeros(N, dtype=np.int64)
    bag = write_bag(tmp_path / "mcap", {"/joint_states": late})
    with pytest.raises(diffnea.DataError, match=r"elbow: every header stamp is 0; clock='receive'"):
        diffnea.read_recording(bag)
    assert_same(diffnea.read_recording(bag, clock="receive"), full(), time=1e-9)
    mixed = write_bag(tmp_path / "mixed", {"/joint_states": [late, Joints(["wheel", "arm"])]})
    with pytest.raises(diffnea.DataError, match=r"elbow: every header stamp is 0"):
        diffnea.read_recording(mixed, joints=["shoulder", "elbow"])
    with pytest.raises(diffnea.DataError, match=r"clock: got 'wall'; choices: header, receive"):
        diffnea.read_recording(bag, clock="wall")


def test_of_several_topics_one_is_chosen(tmp_path: Path) -> None:
    other = Joints(["wheel", "arm"])
    bag = write_bag(tmp_path / "mcap", {"/left/joint_states": Joints(), "/right": other})
    with pytest.raises(
        diffnea.DataError, match=r"/left/joint_states \(40 messages\), /right \(40 messages\)"
    ):
        diffnea.read_recording(bag)
    assert_same(diffnea.read_recording(bag, topic="/left/joint_states"), full(), time=1e-9)
    assert diffnea.read_recording(bag, topic="/right").joint_names == ["wheel", "arm"]
    with pytest.raises(diffnea.DataError, match=r"topic: got '/up'; topics of joint states: /left"):
        diffnea.read_recording(bag, topic="/up")


def test_joints_may_change_their_order_and_come_one_by_one(tmp_path: Path) -> None:
    shoulder, elbow = Joints(["shoulder"], columns=[0]), Joints(["elbow"], columns=[1])
    both = Joints(["elbow", "shoulder"], columns=[1, 0])
    shoulder.rows = elbow.rows = range(20)
    both.rows = range(20, N)
    for name in ("mcap", "two.bag"):  # ROS 1: three publishers, each with its own rows
        senders = [shoulder, elbow, both]
        if name == "two.bag":
            both.rows, shoulder.rows, elbow.rows = range(0), range(N), range(N)
            senders = [shoulder, elbow]
        bag = write_bag(tmp_path / name, {"/joint_states": senders})
        assert_same(diffnea.read_recording(bag), full(), time=1e-9)


def test_joints_that_never_meet_are_not_interpolated(tmp_path: Path) -> None:
    shoulder, elbow = Joints(["shoulder"], columns=[0]), Joints(["elbow"], columns=[1])
    elbow.stamps = elbow.stamps + 4_000_000
    bag = write_bag(tmp_path / "mcap", {"/joint_states": [shoulder, elbow]})
    with pytest.raises(
        diffnea.DataError, match=r"0 of 80 rows hold all joints.*shoulder \(40.*elbow \(40.*joints="
    ):
        diffnea.read_recording(bag)
    run = diffnea.read_recording(bag, joints=["elbow"])
    np.testing.assert_array_equal(run.q, series(0)[:, 1:])
    with pytest.raises(diffnea.DataError, match=r"joints: got hip; there are: shoulder, elbow"):
        diffnea.read_recording(bag, joints=["hip"])


def test_two_publishers_of_one_joint_are_refused(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "rivals.bag", {"/joint_states": [Joints(), Joints()]})
    with pytest.raises(
        diffnea.DataError, match=r"shoulder comes from several publishers: /driver0_0 \(40 mess"
    ):
        diffnea.read_recording(bag)


def test_what_is_not_measured_is_no_column(tmp_path: Path) -> None:
    driver = Joints()
    driver.velocity = None
    driver.effort[:, 1] = np.nan
    driver.effort[7, 0] = np.nan
    runs = diffnea.read_recordings(write_bag(tmp_path / "mcap", {"/joint_states": driver}))
    assert runs[0].qd is None
    assert runs[0].has_tau == [True, False]
    assert np.flatnonzero(np.isnan(runs[0].tau[:, 0])).tolist() == [7]
    assert "no effort is given of elbow: prescribed, with unknown torque" in runs.report.notes


def test_a_clock_that_is_set_back_is_refused_as_in_a_csv(tmp_path: Path) -> None:
    driver = Joints()
    driver.stamps[20:] = driver.stamps[:20]
    bag = write_bag(tmp_path / "mcap", {"/joint_states": driver})
    with pytest.raises(diffnea.DataError, match=r"mcap:22: the clock is set back, from 0.19 to 0 s"):
        diffnea.read_recording(bag)


def test_a_broken_bag_is_a_file_error(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "mcap", {"/joint_states": Joints()})
    file = tmp_path / "cut.mcap"
    file.write_bytes(storage_of(bag).read_bytes()[:200])
    for path in (file, *(tmp_path / f"junk{s}" for s in (".mcap", ".db3", ".bag", ".mat", ".npz"))):
        if path is not file:
            path.write_bytes(b"no such thing" * 20)
        with pytest.raises(diffnea.FileError, match=rf"{path.name}: cannot be read as"):
            diffnea.read_recording(path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(diffnea.FileError, match=r"empty: cannot be read as a ROS bag"):
        diffnea.read_recording(tmp_path / "empty")


def matlab_variables() -> dict[str, Any]:
    names = np.array(NAMES, dtype=object)
    return {
        "time": TIME[:, None],
        "q": series(0),
        "qd": series(2),
        "tau": series(1),
        "joint_names": names,
    }


@pytest.mark.parametrize("form", ["variables", "struct", "columns", "v4"])
def test_matlab_files_hold_variables_a_struct_or_columns(tmp_path: Path, form: str) -> None:
    io = pytest.importorskip("scipy.io")
    variables = matlab_variables()
    if form == "struct":
        variables = {"log": variables, "comment": "made in the lab"}
    if form in ("columns", "v4"):
        variables = {"time": TIME} | {
            f"{key}_{name}": series(k)[:, j]
            for key, k in (("q", 0), ("qd", 2), ("tau", 1))
            for j, name in enumerate(NAMES)
        }
    path = tmp_path / "log.mat"
    io.savemat(path, variables, format="4" if form == "v4" else "5", do_compression=form != "v4")
    runs = diffnea.read_recordings(path)
    assert_same(runs[0], full())
    (tmp_path / "log.json").write_text('{"torque_side": "link"}')
    assert diffnea.read_recording(path).torque_side == "link"


def write_mat73(path: Path, variables: dict[str, Any]) -> Path:
    """Write HDF5 as MATLAB does: columns first, cells as references, a text of 512 bytes ahead."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        references = file.create_group("#refs#")

        def put(group: Any, key: str, value: Any) -> None:
            if isinstance(value, dict):
                item = group.create_group(key)
                for field, x in value.items():
                    put(item, field, x)
                kind = b"struct"
            elif np.asarray(value).dtype == object:
                cells = []
                for text in value:
                    cell = references.create_dataset(
                        f"c{len(references)}", data=np.array([[ord(c)] for c in text], np.uint16)
                    )
                    cell.attrs["MATLAB_class"] = np.bytes_("char")
                    cells.append(cell.ref)
                item = group.create_dataset(key, data=np.array([cells]).T, dtype=h5py.ref_dtype)
                kind = b"cell"
            else:
                item, kind = group.create_dataset(key, data=np.asarray(value).T), b"double"
            item.attrs["MATLAB_class"] = np.bytes_(kind)

        for key, value in variables.items():
            put(file, key, value)
    with path.open("r+b") as stream:
        stream.write(
            b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM"
        )
    return path


@pytest.mark.parametrize("form", ["variables", "struct"])
def test_matlab_files_of_version_7_3_are_hdf5(tmp_path: Path, form: str) -> None:
    variables = matlab_variables()
    variables = {"log": variables} if form == "struct" else variables
    assert_same(diffnea.read_recording(write_mat73(tmp_path / "log.mat", variables)), full())


def test_a_link_in_a_matlab_file_leads_nowhere(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = write_mat73(tmp_path / "log.mat", matlab_variables())
    write_mat73(tmp_path / "secret.mat", {"tau": series(1)})
    with h5py.File(path, "r+") as file:
        del file["tau"]
        file["tau"] = h5py.ExternalLink("secret.mat", "/tau")
    with pytest.raises(diffnea.DataError, match=r"tau: is a link, which is not followed"):
        diffnea.read_recording(path)


def test_what_a_matlab_file_lacks_is_said(tmp_path: Path) -> None:
    io = pytest.importorskip("scipy.io")
    path = tmp_path / "log.mat"

    def message(variables: dict[str, Any]) -> str:
        io.savemat(path, variables)
        with pytest.raises(diffnea.DataError) as caught:
            diffnea.read_recording(path)
        return str(caught.value)

    whole = matlab_variables()
    assert "holds no time; expected arrays" in message({"q": whole["q"]})
    del whole["joint_names"]
    assert "whose columns they are is not said; add joint_names" in message(whole)
    whole = matlab_variables()
    assert "q has shape (2, 40)" in message(whole | {"q": whole["q"].T})
    assert "several recordings: one, two" in message({"one": whole, "two": whole})


def test_matlab_objects_are_refused(tmp_path: Path) -> None:
    """A function handle, as MATLAB 5 files mark what only MATLAB understands: class 16."""
    io = pytest.importorskip("scipy.io")
    path = tmp_path / "log.mat"
    io.savemat(path, {"f": np.zeros((1, 1))}, do_compression=False)
    raw = bytearray(path.read_bytes())
    assert raw[128 + 16] == 6  # double
    raw[128 + 16] = 16
    path.write_bytes(raw)
    with pytest.raises(diffnea.DataError, match=r"f: objects of MATLAB.*are not read; save arrays"):
        diffnea.read_recording(path)


def test_npz_with_objects_is_refused(tmp_path: Path) -> None:
    class Bomb:
        def __reduce__(self) -> tuple[Any, tuple[Path]]:
            return Path.touch, (tmp_path / "ran",)

    np.savez(tmp_path / "log.npz", time=TIME, q=np.array([Bomb()], dtype=object))
    with pytest.raises(diffnea.FileError, match=r"log\.npz: cannot be read as NPZ.*pickle"):
        diffnea.read_recording(tmp_path / "log.npz")
    (tmp_path / "log.npz").write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(diffnea.FileError, match=r"log\.npz: cannot be read as NPZ"):
        diffnea.read_recording(tmp_path / "log.npz")
    assert not (tmp_path / "ran").exists()


def test_only_bags_have_topics(tmp_path: Path) -> None:
    diffnea.write_recording(full(), tmp_path / "log.csv")
    with pytest.raises(diffnea.DataError, match=r"topic, joints: only ROS bags have them.*CSV"):
        diffnea.read_recording(tmp_path / "log.csv", topic="/x", joints=["elbow"])


def test_a_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    for suffix, package, extra in (
        (".mcap", "rosbags", "ros"),
        (".mat", "scipy", "matlab"),
        (".parquet", "pandas", "parquet"),
    ):
        path = tmp_path / f"log{suffix}"
        path.write_bytes(b"x")
        for name in [name for name in sys.modules if name.partition(".")[0] == package]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setitem(sys.modules, package, None)
        with pytest.raises(
            ImportError, match=rf"needs {package}.*{re.escape(install_command(extra))}"
        ):
            diffnea.read_recording(path)


def test_whatever_takes_data_takes_a_bag(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "mcap", {"/joint_states": Joints()})
    report = diffnea.audit(storage_of(bag))
    assert report.rows == N


def test_convert_writes_what_the_command_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = write_bag(tmp_path / "mcap", {"/a": Joints(), "/b": Joints()})
    file, out = storage_of(bag), tmp_path / "log.csv"
    assert convert.main([str(file), "--list"]) == 0
    assert capsys.readouterr().out == "/a  40 messages\n/b  40 messages\n"
    assert convert.main([str(file), "-o", str(out)]) == 1
    assert "choose with topic=" in capsys.readouterr().err
    assert not out.exists()
    arguments = [str(file), "--topic", "/a", "--torque-side", "link", "-o", str(out)]
    assert convert.main(arguments) == 0
    assert "log.csv: 40 rows, 1 run(s); joints shoulder, elbow" in capsys.readouterr().err
    assert_same(diffnea.read_recording(out), full(), time=1e-9)
    assert diffnea.read_recording(out).torque_side == "link"
    assert command("audit", out).returncode == 0
    assert convert.main(arguments) == 1
    assert "log.csv: is there already; --force" in capsys.readouterr().err
    assert convert.main([*arguments, "--force"]) == 0


def test_convert_keeps_the_file_that_describes_the_recording(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", time=TIME, q=series(0), tau=series(1), joint_names=NAMES)
    text = '{"torque_side": "link", "period": 2.5}'
    (tmp_path / "log.json").write_text(text)
    assert convert.main([str(tmp_path / "log.npz"), "-o", str(tmp_path / "log.csv")]) == 0
    assert (tmp_path / "log.json").read_text() == text
    assert diffnea.read_recording(tmp_path / "log.csv").period == 2.5


@pytest.mark.parametrize("name", ["log.mcap", "log.db3", "log.bag", "my log.mat", "log.npz"])
def test_the_command_refuses_a_broken_file_in_the_words_of_its_reader(
    tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    path.write_bytes(b"x")
    with pytest.raises(diffnea.FileError) as refusal:
        diffnea.read_recordings(path)
    answer = command("audit", path)
    assert answer.returncode == BAD_INPUT
    assert answer.stderr == f"{refusal.value}\n"
