"""Files as earlier revisions wrote them are read; those of a later one are refused with what to do.

``tests/data/old``: of each format a file without the keys that came later. Documents of runs are
valid by the schema of the revision that first published one: identify e96019a, diagnose 0bd4ebd,
learn, transfer and policies fab0e44; the others follow the first description of their format.
"""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from cli import BAD_INPUT, DONE, MODELS, ROOT, diffnea, done

import diffnea as python
from diffnea.blackbox import BallNetwork

OLD = ROOT / "tests" / "data" / "old"
RUNS = ("identify", "diagnose", "learn", "transfer")


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """A copy that may be written to; runs of policies with their robot, which is stored once."""
    folder = tmp_path / "old"
    shutil.copytree(OLD, folder)
    for run in ("learn", "transfer"):
        for name in ("model.json", "controller.json"):
            shutil.copy(folder / "robot_with_ball.json", folder / run / name)
    return folder


@pytest.mark.parametrize("run", RUNS)
def test_the_page_of_an_old_run(run: str, old: Path) -> None:
    answer = diffnea("report", old / run)
    assert answer.returncode == DONE, answer.stderr
    page = (old / run / "report.html").read_text(encoding="utf-8")
    assert page.rstrip().endswith("</html>")
    said = {
        "identify": "rod",
        "diagnose": "viscous friction",
        "learn": "learned in wam4_ball",
        "transfer": "from wam4_ball to another world",
    }
    assert said[run] in page


def test_an_old_fit_is_compared(old: Path) -> None:
    comparison = json.loads(done("compare", old / "identify", old / "identify", "--json"))
    assert comparison["changed"] is False
    names = [item["name"] for item in comparison["parameters"]]
    assert "hinge.viscous_friction.viscous" in names


def test_old_policies_are_executed(old: Path, tmp_path: Path) -> None:
    """Their reward did not know of slack, whose weight was 0 then."""
    out = tmp_path / "out"
    words = ("--rope", "none", "--repetitions", 0, "--quiet", "-o", out)
    answer = diffnea("transfer", old / "learn", *words)
    assert answer.returncode == DONE, answer.stderr
    policy = json.loads((out / "policy_0.json").read_text(encoding="utf-8"))
    before = json.loads((OLD / "learn" / "policy_0.json").read_text(encoding="utf-8"))
    assert policy["mean"] == before["mean"]
    assert policy["reward"]["lambda_slack"] == 0
    assert python.read_policy(old / "learn" / "policy_0.json").seed == 0


def test_an_old_search_of_another_task_is_kept(old: Path) -> None:
    """What a checkpoint depends on has grown: it is refused, and not overwritten."""
    checkpoint = old / "learn" / "checkpoints" / "seed_0.json"
    before = checkpoint.read_bytes()
    answer = diffnea("learn", "ball-in-cup", MODELS / "wam4_ball.xml", "-o", old / "learn")
    assert answer.returncode == BAD_INPUT
    assert "--fresh" in answer.stderr
    assert checkpoint.read_bytes() == before


def test_an_old_model_and_its_posterior(old: Path) -> None:
    model = python.load_model(old / "model.json")
    assert model.joint_names == ["shoulder", "elbow"]
    again = model.to_dict()
    assert again["effects"][0]["parameters"][0]["value"] == 1.2
    assert again["posterior"]["information"] == [400.0]
    assert json.loads(done("info", old / "model.json", "--json"))["schema"] == "diffnea/info/1"


def test_an_old_recording_with_its_sidecar(old: Path) -> None:
    recording = python.read_recording(old / "arm.csv")
    assert recording.period == 0.5
    assert recording.torque_side == "motor"
    assert recording.tau[5, 0] == pytest.approx(0.1 * 0.119)  # from ampere


def test_an_old_surrogate_and_network(old: Path, tmp_path: Path) -> None:
    motion = tmp_path / "motion.csv"
    wam = MODELS / "wam4.xml"
    few = ("--iterations", 0, "--harmonics", 3, "--duration", 2, "--quiet")
    done("excite", wam, *few, "-o", motion)
    world = f"mujoco:wam4,perturb={old / 'surrogate.json'}"
    out = tmp_path / "out.csv"
    done("simulate", wam, "--trajectory", motion, "--world", world, "--quiet", "-o", out)
    assert out.is_file()
    network = BallNetwork.load(old / "ball_network.json")
    assert network.to_dict()["kind"] == "ff"


# --- of a later revision


def newer(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    path.write_text(re.sub(r'("diffnea/[a-z-]+/)1"', r'\g<1>2"', text, count=1), encoding="utf-8")


REFUSED: dict[str, tuple[str, Callable[[Path], tuple[object, ...]]]] = {
    "identify": ("identify/result.json", lambda old: ("report", old / "identify")),
    "diagnose": ("diagnose/result.json", lambda old: ("report", old / "diagnose")),
    "diagnose-series": ("diagnose/series.json", lambda old: ("report", old / "diagnose")),
    "learn": ("learn/result.json", lambda old: ("report", old / "learn")),
    "transfer": ("transfer/result.json", lambda old: ("report", old / "transfer")),
    "policy": ("learn/policy_0.json", lambda old: ("report", old / "learn")),
    "model": ("model.json", lambda old: ("info", old / "model.json")),
    "recording": ("arm.json", lambda old: ("audit", old / "arm.csv")),
    "checkpoint": (
        "learn/checkpoints/seed_0.json",
        lambda old: ("learn", "ball-in-cup", MODELS / "wam4_ball.xml", "-o", old / "learn"),
    ),
    "ball-network": (
        "ball_network.json",
        lambda old: (
            *("learn", "ball-in-cup", MODELS / "wam4_ball.xml", "-o", old / "out"),
            *("--ball-network", old / "ball_network.json"),
        ),
    ),
    "surrogate": (
        "surrogate.json",
        lambda old: (
            *("transfer", old / "learn", "-o", old / "out"),
            *("--world", f"mujoco:wam4_ball_in_cup,perturb={old / 'surrogate.json'}"),
        ),
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_of_a_newer_version_is_refused_with_what_to_do(name: str, old: Path) -> None:
    file, words = REFUSED[name]
    newer(old / file)
    before = (old / file).read_bytes()
    answer = diffnea(*words(old))
    assert answer.returncode == BAD_INPUT, answer.stderr
    assert f"diffnea/{name}/2" in answer.stderr
    assert f"expected diffnea/{name}/1" in answer.stderr
    assert "newer diffnea" in answer.stderr
    assert "update" in answer.stderr
    assert Path(file).name in answer.stderr
    assert (old / file).read_bytes() == before
