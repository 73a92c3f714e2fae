"""Rules of prose that `.ci/prose` checks: what they catch, what they leave alone."""

import os
import subprocess
import sys
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = ROOT / ".ci" / "prose"


def program() -> Any:
    """Return the program as a module."""
    loader = SourceFileLoader("prose_program", str(PROGRAM))
    spec = spec_from_loader("prose_program", loader)
    assert spec
    module = module_from_spec(spec)
    sys.modules["prose_program"] = module  # dataclasses look there
    loader.exec_module(module)
    return module


PROSE = program()
LONG = "The estimate " + "of one more segment " * 6 + "is long."
SHORT = "The estimate has one segment."


def judged(path: str, source: str, before: str = "") -> list[str]:
    return PROSE.faults({path: before}, {path: source})


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("a.cpp", "// Of a joint, its friction.\n"),
        ("a.cpp", "int x = 0;  ///< that passed\n"),
        ("a.hpp", "/* What is left. */\n"),
        ("a.hpp", "/// Those of the drive,\n/// one by one.\n"),
        ("a.py", '"""As the others."""\n'),
        ("a.py", "x = 1  # whether it moved\n"),
        ("a.py", '@dataclass\nclass A:\n    x: int\n    """Of the arm."""\n'),
        ("CMakeLists.txt", "# What the tests need.\n"),
        ("a/run", "#!/bin/sh\n# Of all.\n"),
        ("a.md", LONG),
        ("a.md", f"- {LONG}\n"),
        ("a.md", f"{SHORT}\n" * 20),
        ("a.md", "Run at 1b2ca8a.\n"),
        ("a.md", "Given by `1b2ca8a`, as before.\n"),
        ("a.md", "| 1b2ca8a | 3 |\n"),
        ("a.md", "The mast of seeds 101–112 has none.\n"),
        ("a.md", "Measured on 2026-11-25.\n"),
        ("a.md", "# Provenance\n\n| 1b2ca8a |\n\n# Later\n\nSince 1b2ca8a.\n"),
    ],
)
def test_what_is_caught(path: str, source: str) -> None:
    assert len(judged(path, source)) == 1
    assert not judged(path, source, source)


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("a.cpp", "// Friction of a joint.\nint x;  ///< wall time [s]\n"),
        ("a.cpp", 'auto x = "// Of a text";\nauto y = R"(// What)";\nauto z = 1\'000;\n'),
        ("a.cpp", '// "Of a joint": what it says.\n// @param x  of a joint\n'),
        ("a.cpp", "// Holds the torque\n// of the drive.\n"),
        ("a.cpp", "int x;  ///< torque\n        ///< of the drive\n"),
        ("a.py", 'x = "# Of a text"\n'),
        ("a.sh", 'echo "# Of a text"\n'),
        ("a.md", f"{SHORT}\n\n" * 20),
        ("a.md", f"- {SHORT}\n" * 20),
        ("a.md", f"```\n{LONG}\n# 1b2ca8a\n```\n"),
        ("a.md", f"Thus:\n\n    {LONG}\n"),
        ("a.md", f"$$\n{LONG}\n$$\n"),
        ("a.md", f"| {LONG} |\n|---|\n"),
        ("a.md", f"<!-- {LONG} -->\n"),
        ("a.md", f"# {LONG}\n"),
        ("a.md", "Choices are " + ", ".join(f"`word{k}`" for k in range(30)) + ".\n"),
        (
            "a.md",
            "It is the friction " + "(Armstrong, Dupont and others 1994, page 3) " * 6 + ".\n",
        ),
        ("a.md", "See [here](https://a.org/blob/1b2ca8a/b) and https://a.org/1b2ca8a now.\n"),
        ("a.md", "Its seed is 0; `--seed 101`, decade, 1234567 and 1e-10.\n"),
        (
            "a.md",
            "# Provenance\n\n| figure | commit | seeds |\n|---|---|---|\n| 3 | 1b2ca8a | 10–19 |\n",
        ),
        ("tests/data/old/a.md", LONG),
        ("a.json", "// Of nothing that is read\n"),
    ],
)
def test_what_is_left_alone(path: str, source: str) -> None:
    assert judged(path, source) == []


def test_what_moves_or_shrinks_is_not_new() -> None:
    comment = "// Of a joint, its friction.\n"
    assert not PROSE.faults({"a.cpp": comment}, {"a.cpp": "", "b.cpp": f"int x;\n{comment}"})
    assert PROSE.faults({"a.cpp": comment}, {"a.cpp": comment, "b.cpp": comment})
    wrapped = LONG.replace("segment of", "segment\nof")
    assert not judged("a.md", wrapped, LONG)
    assert not judged("a.md", LONG.replace("one more ", "", 1), LONG)
    assert judged("a.md", LONG.replace("long", "long and much longer"), LONG)
    assert judged("a.md", LONG, "Another sentence with other words, that are not long at all.")


@pytest.mark.parametrize(
    "subject",
    [
        "ball_fit: never restart a window whose cost is at noise level",
        "CI, docs: check prose",
        "apps/policies: seed every search",
        ".ci/setup: install matplotlib",
        'Revert "A subject of before"',
        "Merge branch 'effects' into main",
    ],
)
def test_subjects_that_pass(subject: str) -> None:
    assert PROSE.subject_fault(subject) == ""


@pytest.mark.parametrize(
    "subject",
    [
        "A ball's windows: none is astray",
        "Fix the fit",
        "fit: Fixed it",
        "fit: fixed it",
        "fit: mending windows",
        "fit: mend windows.",
        "fit: " + "mend " * 20,
    ],
)
def test_subjects_that_do_not(subject: str) -> None:
    assert PROSE.subject_fault(subject)


class Repository:
    """A small history with the program in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        self.git("init", "--quiet", "--initial-branch=main")

    def git(self, *words: str) -> str:
        own = {
            f"GIT_{who}_{what}": "a@b.c"
            for who in ("AUTHOR", "COMMITTER")
            for what in ("NAME", "EMAIL")
        }
        answer = subprocess.run(
            ["git", *words],
            cwd=self.folder,
            env={**os.environ, **own, "GIT_CONFIG_GLOBAL": os.devnull},
            capture_output=True,
            text=True,
            check=True,
        )
        return answer.stdout

    def commit(self, subject: str, **files: str) -> None:
        for name, text in files.items():
            (self.folder / f"{name}.md").write_text(text, encoding="utf-8")
        self.git("add", "--all")
        self.git("commit", "--quiet", "--allow-empty", "-m", subject)

    def add_program(self) -> None:
        (self.folder / ".ci").mkdir()
        (self.folder / ".ci" / "prose").write_bytes(PROGRAM.read_bytes())
        self.commit("ci: check prose")

    def check(self, *words: str) -> tuple[int, str]:
        answer = subprocess.run(
            [sys.executable, ".ci/prose", *words],
            cwd=self.folder,
            capture_output=True,
            text=True,
            check=False,
        )
        return answer.returncode, answer.stdout


@pytest.fixture
def history(tmp_path: Path) -> Repository:
    out = Repository(tmp_path / "origin")
    out.commit("Whatever was written before", old=LONG)
    out.add_program()
    return out


def test_judged_is_what_came_with_the_program_and_after(history: Repository) -> None:
    assert history.check() == (0, "prose: 1 commits, 1 files: 0 faults\n")
    history.commit("docs: say more", new=SHORT)
    assert history.check()[0] == 0
    (history.folder / "new.md").write_text(LONG, encoding="utf-8")  # not committed
    assert history.check()[0] == 1
    history.commit("Said more", new=LONG)
    code, text = history.check()
    assert code == 1
    assert "new.md:1: a sentence of 28 words" in text
    assert "a subject is `area: imperative`: Said more" in text
    assert "old.md" not in text


def test_a_branch_is_judged_by_what_it_adds_to_main(history: Repository) -> None:
    history.commit("docs: say too much", main=LONG)
    history.git("checkout", "--quiet", "-b", "topic")
    history.commit("docs: say more", new=SHORT)
    assert history.check("main")[0] == 0
    clone = Repository.__new__(Repository)
    clone.folder = history.folder.parent / "clone"
    history.git("clone", "--quiet", ".", str(clone.folder))
    assert clone.check()[0] == 0  # origin/main is behind
    clone.git("checkout", "--quiet", "main")
    assert clone.check()[0] == 1  # main itself


def test_subjects_of_a_branch_that_did_not_have_the_program_are_not_judged(
    history: Repository,
) -> None:
    history.git("checkout", "--quiet", "-b", "earlier", "HEAD~1")
    history.commit("Said more", new=SHORT)
    history.git("checkout", "--quiet", "main")
    history.git("merge", "--quiet", "--no-edit", "earlier")
    assert history.check() == (0, "prose: 1 commits, 2 files: 0 faults\n")
    history.git("checkout", "--quiet", "earlier")
    history.git("merge", "--quiet", "--no-edit", "main")
    history.commit("Said still more")
    assert history.check()[0] == 1


def test_a_history_without_what_came_before_is_not_judged(history: Repository) -> None:
    history.commit("Said more", new=LONG)
    shallow = Repository.__new__(Repository)
    shallow.folder = history.folder.parent / "shallow"
    history.git("clone", "--quiet", "--depth=1", f"file://{history.folder}", str(shallow.folder))
    code, text = shallow.check()
    assert code == 0
    assert text.startswith("prose: nothing checked: ")


def test_this_change_passes() -> None:
    answer = subprocess.run([PROGRAM], cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stdout
