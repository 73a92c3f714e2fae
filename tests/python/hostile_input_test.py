"""Files that were made to harm: every command says no, soon, in bounded memory, in one line.

What the formats' readers do with broken files in general is for tests/fuzz; here are the sizes
that a fuzzer does not reach, and the files that lie elsewhere.
"""

from __future__ import annotations

import resource
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from cli import BAD_INPUT, COMMAND, PENDULUM

MEMORY = 3 << 30  # address space, of which MuJoCo and threads reserve most without using it [bytes]
SECONDS = 60  # a reader needs one or two; sanitizers and a loaded machine need more


def refused(*arguments: object, cwd: Path) -> str:
    """Run the command in little memory; it must refuse its input in a short message."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    answer = subprocess.run(
        [COMMAND, *map(str, arguments)],
        capture_output=True,
        text=True,
        errors="replace",
        cwd=cwd,
        timeout=SECONDS,
        preexec_fn=limit,
    )
    assert answer.returncode == BAD_INPUT, (answer.returncode, answer.stderr[:2000])
    assert 0 < len(answer.stderr) < 2000
    return answer.stderr


# --- recordings and trajectories ---


def one_line(path: Path) -> None:
    with path.open("wb") as file:  # sparse: 4 GB that take no disk
        file.write(b"time,q_shoulder,q_elbow,qcmd_elbow,tau_elbow\n")
        file.truncate(4 << 30)


def one_header(path: Path) -> None:
    with path.open("wb") as file:
        file.write(b"time,")
        file.truncate(4 << 30)


def many_columns(path: Path) -> None:
    path.write_text("time," + ",".join(f"q{i}" for i in range(100_000)) + "\n0\n")


def dense_then_far(path: Path) -> None:
    """Rows 2 µs apart, with pauses of 19 ms: a grid of the period would have billions of rows."""
    rows = (f"{19e-3 * k + 2e-6 * i:.7f},{i},{k}" for k in range(20_000) for i in range(3))
    path.write_text("time,q_shoulder,q_elbow\n" + "\n".join(rows) + "\n")


def tiny_period(path: Path) -> None:
    rows = (f"{1e-300 * i:.3e},{i % 7},{i % 5},{i % 3}" for i in range(500))
    path.write_text("time,q_shoulder,q_elbow,tau_elbow\n" + "\n".join(rows) + "\n1,1,1,1\n")


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (one_line, "the line is longer than 1 MiB"),
        (one_header, "the line is longer than 1 MiB"),
        (many_columns, "columns; the limit is 5000"),
    ],
)
@pytest.mark.parametrize("command", ["identify", "audit", "trajectory"])
def test_a_recording_of_hostile_size(
    command: str, write: Callable[[Path], None], message: str, tmp_path: Path
) -> None:
    data = tmp_path / "data.csv"
    write(data)
    arguments = {
        "identify": ("identify", PENDULUM, data, "-o", "RUN"),
        "audit": ("audit", data),
        "trajectory": ("simulate", PENDULUM, "--trajectory", data, "-o", "out.csv"),
    }[command]
    assert message in refused(*arguments, cwd=tmp_path)


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (dense_then_far, "rows are too few for their usual period"),
        (tiny_period, "is the unit of `time` right?"),
    ],
)
def test_a_time_that_asks_for_a_huge_grid(
    write: Callable[[Path], None], message: str, tmp_path: Path
) -> None:
    data = tmp_path / "data.csv"
    write(data)
    assert message in refused("identify", PENDULUM, data, "-o", "RUN", cwd=tmp_path)


@pytest.mark.parametrize("last", ["1e9", "1e300"])
def test_a_trajectory_that_lasts_for_ever(last: str, tmp_path: Path) -> None:
    motion = tmp_path / "motion.csv"
    motion.write_text(f"time,qcmd_shoulder,qcmd_elbow\n0,0,0\n{last},1,1\n")
    refused("simulate", PENDULUM, "--trajectory", motion, "-o", "out.csv", cwd=tmp_path)
    refused("simulate", PENDULUM, "--trajectory", motion, "-o", "out.csv", "--world",
            "mujoco:wam4", cwd=tmp_path)  # fmt: skip


# --- JSON ---


def repeated(begin: str, text: str, count: int, end: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        path.write_text(begin + text * count + end)

    return write


JSON_CASES = [
    (repeated('{"schema": ', "[", 200_000, ""), "nested too deeply"),
    (repeated('{"schema": ', '{"a":', 200_000, "1"), "nested too deeply"),
    (repeated('{"schema": [', "0,", 30_000_000, "0]}"), "too many values"),
    (repeated('{"schema": [', "[],", 20_000_000, "0]}"), "too many values"),
    (
        lambda path: path.write_text(
            '{"schema": {' + ",".join(f'"k{i}":0' for i in range(1_000_000)) + "}}"
        ),
        "too many keys",
    ),
    (repeated("", "{", 65 << 20, ""), "larger than 64 MiB"),
]


@pytest.mark.parametrize(("write", "message"), JSON_CASES)
def test_json_of_hostile_size(write: Callable[[Path], None], message: str, tmp_path: Path) -> None:
    write(tmp_path / "model.json")
    assert message in refused("info", "model.json", cwd=tmp_path)
    run = tmp_path / "RUN"
    run.mkdir()
    (tmp_path / "model.json").rename(run / "result.json")
    assert message in refused("report", "RUN", cwd=tmp_path)


def test_a_network_whose_rows_differ_asks_for_no_matrix(tmp_path: Path) -> None:
    n = 300_000  # one row of so many numbers, and as many empty ones: 700 GB as a matrix
    zeros, empty = ",".join(["0"] * n), ",".join(["[]"] * (n - 1))
    (tmp_path / "network.json").write_text(
        '{"schema": "diffnea/ball-network/1", "kind": "ff", "step": 0.01, "warm_up": 0,'
        '"input": {"mean": [], "scale": []}, "output": {"mean": [], "scale": []},'
        f'"members": [{{"cells": [], "layers": [{{"bias": [{zeros}],'
        f'"weights": [[{zeros}],{empty}]}}]}}]}}'
    )
    text = refused("learn", "ball-in-cup", "wam4_ball_in_cup", "--ball-network", "network.json",
                   "-o", "RUN", cwd=tmp_path)  # fmt: skip
    assert "weights[1]: got 0 numbers, expected 300000" in text


# --- XML ---

W = '<worldbody><body name="b"><joint name="j"/><geom size="1"/></body></worldbody>'
CHAIN = "".join(
    f'<joint name="j{i}" type="fixed"><parent link="l{i}"/><child link="l{i + 1}"/></joint>'
    f'<link name="l{i + 1}"/>'
    for i in range(60_000)
)
LAUGHS = "".join(f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(12))

XML_CASES = {
    "links in a chain": (f'<robot name="r"><link name="l0"/>{CHAIN}</robot>', "the limit is 2000"),
    "nesting": ("<robot>" + "<a>" * 100_000, "XML_ELEMENT_DEPTH_EXCEEDED"),
    "elements": ("<robot>" + "<a/>" * 3_000_000 + "</robot>", "too many elements"),
    "attributes": (
        "<robot " + " ".join(f'a{i}=""' for i in range(300_000)) + "/>",
        "too many attributes",
    ),
    # No entity of the document's own is ever put in: the text stays as it is.
    "billion laughs": (
        f'<!DOCTYPE r [<!ENTITY a0 "ha">{LAUGHS}]><robot name="&a12;"/>',
        "",
    ),
    "external entity": (
        '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"/>',
        "",
    ),
    "xacro": (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r">'
        '<xacro:include filename="/etc/passwd"/></robot>',
        "",
    ),
    "not UTF-8": ('<robot name="\udcff"/>', "not UTF-8"),
    "user numbers": (f'<mujoco><size nuser_body="1000000000"/>{W}</mujoco>', "nuser_body"),
    "keys": (f'<mujoco><size nkey="1000000000"/>{W}</mujoco>', "nkey"),
    "constraints": (f'<mujoco><size njmax="1000000000"/>{W}</mujoco>', "njmax"),
    "composite": (
        '<mujoco><worldbody><body><composite type="grid" count="99 99 1" spacing="1">'
        '<geom size="1"/></composite></body></worldbody></mujoco>',
        "the limit is 1000",
    ),
    "sites": (
        "<mujoco><worldbody><body>" + "<site/>" * 60_000 + "</body></worldbody></mujoco>",
        "elements; the limit is 5000",
    ),
    "sensors": (
        f'<mujoco>{W}<sensor><user objtype="body" objname="b" dim="2000000000" needstage="vel" '
        'datatype="real"/></sensor></mujoco>',
        "dim = '2000000000'",
    ),
}


@pytest.mark.parametrize("case", XML_CASES)
def test_xml_of_hostile_content(case: str, tmp_path: Path) -> None:
    text, message = XML_CASES[case]
    (tmp_path / "model.xml").write_text(text, encoding="utf-8", errors="surrogateescape")
    answer = refused("info", "model.xml", cwd=tmp_path)
    assert message in answer
    assert "root:" not in answer  # of /etc/passwd


def test_an_actuator_is_not_simulated_for_ever_to_learn_its_length(tmp_path: Path) -> None:
    (tmp_path / "model.xml").write_text(
        '<mujoco><compiler><lengthrange mode="all" inttotal="1e300" inteval="1e299" '
        f'timestep="1e-9"/></compiler>{W}<actuator><general joint="j"/></actuator></mujoco>'
    )
    subprocess.run([COMMAND, "info", "model.xml"], cwd=tmp_path, check=True, timeout=SECONDS,
                   stdout=subprocess.DEVNULL)  # fmt: skip


# --- files that lie elsewhere ---

MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
USES_MESH = '<worldbody><body><joint/><geom type="mesh" mesh="m"/></body></worldbody>'


@pytest.mark.parametrize(
    "document",
    [
        '<mujoco><include file="{outside}"/></mujoco>',
        '<mujoco><include file="../outside/part.xml"/></mujoco>',
        '<mujoco><include file="link.xml"/></mujoco>',
        '<mujoco><include file="folder/part.xml"/></mujoco>',
        '<mujoco><include file="inside.xml"/></mujoco>',
        '<mujoco><asset><mesh name="m" file="{outside}"/></asset>' + USES_MESH + "</mujoco>",
        '<mujoco><compiler meshdir="../outside"/><asset><mesh name="m" file="mesh.obj"/></asset>'
        + USES_MESH + "</mujoco>",
        '<mujoco><compiler assetdir="/"/><asset><mesh name="m" file="etc/passwd"/></asset>'
        + USES_MESH + "</mujoco>",
    ],
)  # fmt: skip
def test_no_file_outside_the_models_folder_is_opened(document: str, tmp_path: Path) -> None:
    outside, folder = tmp_path / "outside", tmp_path / "robot"
    outside.mkdir()
    folder.mkdir()
    (outside / "part.xml").write_text(f"<mujoco>{W}</mujoco>")
    (outside / "mesh.obj").write_text(MESH)
    (folder / "link.xml").symlink_to(outside / "part.xml")
    (folder / "folder").symlink_to(outside)
    (folder / "inside.xml").write_text('<mujoco><include file="../outside/part.xml"/></mujoco>')
    (folder / "model.xml").write_text(document.format(outside=outside / "part.xml"))
    assert "outside the model's folder" in refused("info", "robot/model.xml", cwd=tmp_path)


def test_looks_are_never_opened(tmp_path: Path) -> None:
    """Textures, height fields and a URDF's meshes may lie anywhere: nobody looks."""
    pipe = tmp_path / "pipe"
    subprocess.run(["mkfifo", pipe], check=True)  # whoever opens it waits for ever
    (tmp_path / "looks.xml").write_text(
        f'<mujoco><asset><texture name="t" type="2d" file="{pipe}"/>'
        f'<material name="a" texture="t"/>'
        f'<hfield name="h" file="{pipe}" size="1 1 1 1"/><mesh name="m" file="{pipe}"/></asset>{W}'
        "</mujoco>"
    )
    (tmp_path / "looks.urdf").write_text(
        f'<robot name="r"><link name="a"><visual><geometry><mesh filename="{pipe}"/></geometry>'
        "</visual></link></robot>"
    )
    for name in ("looks.xml", "looks.urdf"):
        subprocess.run([COMMAND, "info", name], cwd=tmp_path, check=True, timeout=SECONDS,
                       stdout=subprocess.DEVNULL)  # fmt: skip
