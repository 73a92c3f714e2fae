"""Completion in bash, asked of bash itself."""

import re
import subprocess
from pathlib import Path

from cli import WRONG_USAGE, done
from cli import diffnea as command


def commands() -> list[str]:
    """Return the commands as the help lists them."""
    listed = (
        done("--help").partition("SUBCOMMANDS:")[2] or done("--help").partition("ubcommands:")[2]
    )
    return re.findall(r"^  ([a-z]+) ", listed, re.MULTILINE)


def in_bash(tmp_path: Path, *words: str) -> list[str]:
    """Return what bash offers for the last of the words."""
    (tmp_path / "diffnea.bash").write_text(done("completion", "bash"))
    script = """
source diffnea.bash
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1))
_diffnea
printf '%s\\n' "${COMPREPLY[@]}"
"""
    answer = subprocess.run(
        ["bash", "--norc", "-c", script, "-", "diffnea", *words],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=True,
    )
    return answer.stdout.split()


def test_bash_completes_commands_options_choices_and_files(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text("")
    (tmp_path / "arm.csv").write_text("")
    assert in_bash(tmp_path, "iden") == ["identify"]
    assert set(in_bash(tmp_path, "")) == set(commands())
    assert in_bash(tmp_path, "identify", "--los") == ["--loss"]
    assert in_bash(tmp_path, "identify", "--loss", "mot") == ["motion"]
    assert in_bash(tmp_path, "identify", "--loss", "=", "in") == ["inverse"]
    assert in_bash(tmp_path, "identify", "--loss", "=") == [
        "inverse",
        "forward",
        "motion",
        "constrained",
    ]
    assert in_bash(tmp_path, "identify", "a") == ["arm.csv", "arm.urdf"]
    assert in_bash(tmp_path, "identify", "--json", "arm.u") == ["arm.urdf"]
    assert in_bash(tmp_path, "identify", "arm.urdf", "arm.csv", "--test", "x", "arm.c") == [
        "arm.csv"
    ]
    assert in_bash(tmp_path, "identify", "-o", "arm.c") == ["arm.csv"]
    assert in_bash(tmp_path, "identify", "--seed", "") == []
    assert in_bash(tmp_path, "completion", "") == ["bash"]
    assert in_bash(tmp_path, "--ver") == ["--version"]


def test_every_option_of_every_command_is_completed(tmp_path: Path) -> None:
    names = commands()
    assert {"identify", "diagnose", "export", "completion"} <= set(names)
    for name in names:
        listed = re.findall(r"^\s+(?:-\w, ?)?(--[a-z-]+)", done(name, "--help"), re.MULTILINE)
        assert set(listed) <= set(in_bash(tmp_path, name, "--")), name
        assert listed


def test_another_shell_is_refused() -> None:
    answer = command("completion", "csh")
    assert answer.returncode == WRONG_USAGE
    assert "{bash}" in answer.stderr
