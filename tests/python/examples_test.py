"""The examples of docs/examples, run as their users would run them."""

import cmath
import json
import os
import re
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


# --- C++

EIGEN = Path(os.environ.get("EIGEN3_INCLUDE_DIR", "/usr/include/eigen3"))
# Libraries that a program of the headers alone may be linked with: the compiler's own.
RUNTIME = {
    "ld-linux-aarch64",
    "ld-linux-x86-64",
    "linux-vdso",
    "libc",
    "libgcc_s",
    "libm",
    "libstdc++",
}


def compile_with_headers(folder: Path, *files: Path) -> Path:
    """Compile and link with include/ and Eigen on the command line, and nothing else."""
    program = folder / files[0].stem
    run(
        *(os.environ.get("CXX", "g++"), "-std=c++20", "-MD", "-MF", folder / "included"),
        *("-I", ROOT / "include", "-I", EIGEN, "-o", program, *files),
        cwd=folder,
    )
    return program


def headers_alone() -> None:
    if shutil.which(os.environ.get("CXX", "g++")) is None or not (EIGEN / "Eigen").is_dir():
        pytest.skip("needs g++ (or CXX) and Eigen (in EIGEN3_INCLUDE_DIR)")


def numbers(text: str) -> list[float]:
    return [float(word) for word in text.split() if word[-1].isdigit()]


def double_pendulum(q1: complex, q2: complex) -> tuple[complex, complex]:
    """Lagrange's torques of the double pendulum of dynamics.cpp, at its velocities."""
    qd1, qd2, qdd1, qdd2 = 1.0, 2.0, 0.1, -0.2
    mass, length, gravity = 1.0, 0.5, 9.81
    a, b, ad, bd, add, bdd = q1, q1 + q2, qd1, qd1 + qd2, qdd1, qdd1 + qdd2
    cos, sin = cmath.cos(a - b), cmath.sin(a - b)
    weight = mass * gravity * length
    upper = mass * length**2 * (2 * add + bdd * cos + bd**2 * sin) + 2 * weight * cmath.sin(a)
    lower = mass * length**2 * (bdd + add * cos - ad**2 * sin) + weight * cmath.sin(b)
    return upper + lower, lower


def test_cpp_headers_alone(tmp_path: Path) -> None:
    headers_alone()
    program = compile_with_headers(tmp_path, EXAMPLES / "cpp" / "dynamics.cpp")
    expected = [torque.real for torque in double_pendulum(0.3, -0.5)]
    assert numbers(run(program, cwd=tmp_path)) == pytest.approx(expected, rel=1e-13)
    included = (tmp_path / "included").read_text(encoding="utf-8")
    assert "ceres/jet.h" in included
    assert re.findall(r"/(?:glog|gflags|mujoco|urdf\w*|nlohmann|version\.hpp)\b", included) == []
    if shutil.which("ldd"):
        libraries = re.findall(
            r"^\s*(?:/\S*/)?([\w+-]+)\.so", run("ldd", program, cwd=tmp_path), re.M
        )
        assert set(libraries) <= RUNTIME


def test_cpp_jets(tmp_path: Path) -> None:
    headers_alone()
    program = compile_with_headers(tmp_path, EXAMPLES / "cpp" / "dynamics_jets.cpp")
    step = 1e-30  # complex: a derivative without a difference
    columns = [double_pendulum(0.3 + 1j * step, -0.5), double_pendulum(0.3, -0.5 + 1j * step)]
    expected = [columns[k][i].imag / step for i in range(2) for k in range(2)]
    assert numbers(run(program, cwd=tmp_path)) == pytest.approx(expected, rel=1e-13)


def test_cpp_headers_in_two_files(tmp_path: Path) -> None:
    """Functions that are no templates are inline: two files with the same headers link."""
    headers_alone()
    effects = sorted((ROOT / "include" / "diffnea" / "effects").glob("*.hpp"))
    names = [f"effects/{path.name}" for path in effects]
    text = "".join(f"#include <diffnea/{name}>\n" for name in ["dynamics.hpp", *names])
    files = [tmp_path / "one.cpp", tmp_path / "two.cpp"]
    called = (
        *("aba_derivatives", "active_rows", "check_model", "log_cholesky_from_theta", "make_tree"),
        *("Residual::from", "derivative", "number_text", "shifted"),
    )
    pointers = ", ".join(f"reinterpret_cast<void*>(&{name})" for name in called)
    main = (
        "using namespace diffnea;\nusing diffnea::detail::number_text;\n"
        f"int main() {{ void* volatile kept[]{{{pointers}}}; return kept[0] == nullptr; }}\n"
    )
    files[0].write_text(text + main, encoding="utf-8")
    files[1].write_text(text, encoding="utf-8")
    run(compile_with_headers(tmp_path, *files), cwd=tmp_path)


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
    assert "after (held out)" in run("build/identify_in_code", cwd=tmp_path)


def test_cpp_component_without_what_it_does_not_need(tmp_path: Path) -> None:
    build = build_folder()
    if build is None or shutil.which("cmake") is None:
        pytest.skip("needs cmake and the library in build/release (or DIFFNEA_BUILD)")
    prefix = tmp_path / "prefix"
    run("cmake", "--install", build, "--prefix", prefix, cwd=tmp_path)
    source = tmp_path / "example"
    shutil.copytree(EXAMPLES / "cpp", source)
    absent = ("Ceres", "glog", "GIF", "mujoco", "nlohmann_json", "tinyxml2", "urdfdom")
    for component, hidden in (("dynamics", (*absent, "Threads")), ("identify", absent)):
        run(
            *("cmake", "-S", source, "-B", component, f"-DCOMPONENT={component}"),
            f"-DCMAKE_PREFIX_PATH={prefix}",
            *(f"-DCMAKE_DISABLE_FIND_PACKAGE_{name}=ON" for name in hidden),
            cwd=tmp_path,
        )
    run("cmake", "--build", "identify", "--target", "identify_in_code", cwd=tmp_path)
    assert "after (held out)" in run("identify/identify_in_code", cwd=tmp_path)
    assert not re.search(
        r"ceres|glog|mujoco|spqr|cholmod", run("ldd", "identify/identify_in_code", cwd=tmp_path)
    )
