"""The examples of docs/examples, run as their users would run them."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from cli import COMMAND, MODELS, ROOT, SECONDS, done

EXAMPLES = ROOT / "docs" / "examples"


def run(*command: object, cwd: Path, **environment: str) -> str:
    answer = subprocess.run(
        [str(part) for part in command],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=os.environ | environment,
        check=False,
        timeout=5 * SECONDS,
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
    return answer.stdout


def run_script(name: str, folder: Path) -> str:
    """Run it in the folder, into `here`, with the command on the PATH."""
    path = f"{Path(COMMAND).parent}{os.pathsep}{os.environ['PATH']}"
    return run("sh", EXAMPLES / name, "here", cwd=folder, PATH=path)


def test_python(tmp_path: Path) -> None:
    text = run(sys.executable, EXAMPLES / "identify.py", cwd=tmp_path)
    assert "worst joint, held out" in text
    assert (tmp_path / "run" / "report.html").is_file()


def test_policy(tmp_path: Path) -> None:
    text = run(sys.executable, EXAMPLES / "policy.py", cwd=tmp_path)
    assert "mm from the goal" in text
    assert "2 of 2 policies solved in the model" in text


def test_shell(tmp_path: Path) -> None:
    text = run_script("identify.sh", tmp_path)
    assert "run/report.html" in text
    assert (tmp_path / "here" / "run" / "report.html").is_file()


def test_ball(tmp_path: Path) -> None:
    text = run_script("ball.sh", tmp_path)
    assert "string.length" in text
    assert "lacks string mass" in text  # 2.25 g of rope at a ball of 24 g
    assert (tmp_path / "here" / "why" / "report.html").is_file()


def test_ball_in_cup(tmp_path: Path) -> None:
    text = run_script("ball_in_cup.sh", tmp_path)
    assert "2 of 2 policies catch the ball in the model" in text
    transfer = tmp_path / "here" / "loop" / "transfer"
    assert (transfer / "report.html").is_file()
    seen = json.loads((transfer / "result.json").read_text(encoding="utf-8"))
    assert len(seen["policies"]) == 2
    # Without a rope's mass the model is right: what it learned works there.
    tendon = json.loads((tmp_path / "here" / "tendon" / "result.json").read_text(encoding="utf-8"))
    assert any(policy["success"] for policy in tendon["policies"])


def test_cart_pole(tmp_path: Path) -> None:
    text = run_script("cart_pole.sh", tmp_path)
    assert "lacks cogging at cart" in text
    assert (tmp_path / "here" / "run" / "report.html").is_file()


def test_furuta(tmp_path: Path) -> None:
    text = run_script("furuta.sh", tmp_path)
    assert "joint spring at arm" in text
    assert (tmp_path / "here" / "why" / "report.html").is_file()


def test_swing_up(tmp_path: Path) -> None:
    text = run(sys.executable, EXAMPLES / "cart_pole_swing_up.py", cwd=tmp_path)
    assert "the pole stands" in text


def build_folder() -> Path | None:
    """A build of the library that can be installed."""
    chosen = os.environ.get("DIFFNEA_BUILD")
    folders = [Path(chosen)] if chosen else [ROOT / "build" / "release"]
    return next((folder for folder in folders if (folder / "src" / "libdiffnea.a").is_file()), None)


def test_cpp_against_an_installation(tmp_path: Path) -> None:
    build = build_folder()
    if build is None or shutil.which("cmake") is None:
        pytest.skip("needs cmake and the library in build/release (or DIFFNEA_BUILD)")
    prefix = tmp_path / "prefix"
    run("cmake", "--install", build, "--prefix", prefix, cwd=tmp_path)
    # The installation alone: no source tree, no build folder.
    source = tmp_path / "example"
    shutil.copytree(EXAMPLES / "cpp", source)
    run("cmake", "-S", source, "-B", "build", f"-DCMAKE_PREFIX_PATH={prefix}", cwd=tmp_path)
    run("cmake", "--build", "build", cwd=tmp_path)

    model = MODELS / "double_pendulum.urdf"
    for seed, name in enumerate(("train", "test"), start=1):
        motion, out = tmp_path / "motion.csv", tmp_path / f"{name}.csv"
        common = ("--seed", seed, "--quiet")
        done("excite", model, "--duration", 10, "-o", motion, *common)
        done("simulate", model, "--trajectory", motion, "--noise", 1, "-o", out, *common)
    text = run("build/identify", model, "train.csv", "test.csv", cwd=tmp_path)
    assert "at rest:" in text
    assert "(held out)" in text
    assert "lost 0.0" in run("build/own_task", MODELS / "wam4_ball.xml", cwd=tmp_path)
    # These judge themselves: what is not as expected is a status other than 0.
    assert "after 5 s" in run("build/own_constraint", cwd=tmp_path)
    assert "derivatives are wrong" in run("build/own_effect", cwd=tmp_path)
    assert "the cart arrives" in run("build/own_simulator", cwd=tmp_path)
    planted = run("build/own_candidate", model, "train.csv", "test.csv", cwd=tmp_path)
    assert "rubber stop at" in planted
