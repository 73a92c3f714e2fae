import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from cli import PENDULUM, ROOT, done
from planar_arm import arm, formulas, held_out, rubbing_arm, states, train

import diffnea

__all__ = ["arm", "formulas", "held_out", "rubbing_arm", "states", "train"]


@pytest.fixture(scope="session", autouse=True)
def installed_is_what_is_here() -> None:
    """The Python files that are tested are this tree's, not installed from it earlier."""
    ours = ROOT / "python" / "diffnea"
    installed = Path(diffnea.__file__).resolve().parent
    old = [
        path.relative_to(ours).as_posix()
        for path in sorted([*ours.rglob("*.py"), *ours.rglob("*.pyi")])
        if not (installed / path.relative_to(ours)).is_file()
        or (installed / path.relative_to(ours)).read_bytes() != path.read_bytes()
    ]
    if old:
        pytest.exit(f"{installed} is not what this tree has ({', '.join(old)}): .ci/setup --tests")


@pytest.fixture(autouse=True)
def ctrl_c_interrupts() -> Iterator[None]:
    """A shell lets what it starts in the background ignore Ctrl-C; tests that press it need it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def ctrl_c_soon() -> Iterator[None]:
    """Ctrl-C, pressed 0.2 s from now."""
    press = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    press.start()
    yield
    press.join()


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings of the double pendulum with sensor noise: train.csv, test.csv."""
    folder = tmp_path_factory.mktemp("recordings")
    for seed, name in enumerate(("train", "test"), start=1):
        motion = folder / f"{name}_motion.csv"
        common = ("--seed", seed, "--quiet")
        done("excite", PENDULUM, "--duration", 10, "-o", motion, *common)
        out = folder / f"{name}.csv"
        done("simulate", PENDULUM, "--trajectory", motion, "--noise", 1, "-o", out, *common)
        motion.unlink()
    return folder


@pytest.fixture(scope="session")
def run(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """RUN/ of the double pendulum, fitted to train.csv and judged on test.csv."""
    folder = tmp_path_factory.mktemp("runs") / "RUN"
    train, test = recordings / "train.csv", recordings / "test.csv"
    done("identify", PENDULUM, train, "--test", test, "-o", folder)
    return folder


@pytest.fixture(scope="session")
def rubbing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings of a double pendulum with Coulomb friction in its elbow: train.csv, test.csv."""
    folder = tmp_path_factory.mktemp("rubbing")
    joint = '<joint name="elbow" type="continuous">'
    text = PENDULUM.read_text()
    assert text.count(joint) == 1
    rubs = text.replace(joint, joint + '\n    <dynamics friction="0.05"/>')
    (folder / "truth.urdf").write_text(rubs)
    for seed, name in enumerate(("train", "test"), start=1):
        motion = folder / "motion.csv"
        common = ("--seed", seed, "--quiet")
        done("excite", PENDULUM, "--duration", 20, "-o", motion, *common)
        out = folder / f"{name}.csv"
        truth = folder / "truth.urdf"
        done("simulate", truth, "--trajectory", motion, "--noise", 1, "-o", out, *common)
    return folder
