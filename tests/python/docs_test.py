"""What the pages show runs: fenced ```python, ```sh, ```bash and ```json blocks of docs/**/*.md.

- The blocks of one page run in order, in one folder, which `prepared` fills: Python in one
  namespace, shell in one session, with the command on the PATH. JSON must be JSON.
- A block that cannot run says so and why, on the line before its fence: `<!-- not run: reason -->`.
  The reason is a person's, not "slow"; `test_what_is_not_run` lists all of them.
- Pages may take for granted what `scene` and `names_of_a_page` make: models/, arm.urdf, train.csv,
  test.csv, arm.csv; in Python `diffnea`, `np`, `model` and the arrays of arm.csv.
- Other fences (none, text, cpp, xml, cmake) are no snippets.
"""

import contextlib
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from cli import COMMAND, MODELS, ROOT

import diffnea

LANGUAGES = ("python", "sh", "bash", "json")
FENCE = re.compile(
    r"(?:<!-- not run: (?P<reason>[^>]+) -->\n)?^```(?P<language>\w+)\n", re.MULTILINE
)
SECONDS = 300  # of one block, on a machine that does other things


@dataclass(frozen=True)
class Snippet:
    page: str
    line: int
    language: str
    code: str
    reason: str = ""

    @property
    def name(self) -> str:
        return f"{self.page}:{self.line}"


def snippets(page: str, text: str) -> Iterator[Snippet]:
    """Blocks of a page in the languages that run."""
    for match in FENCE.finditer(text):
        if match["language"] not in LANGUAGES:
            continue
        end = text.index("\n```", match.end() - 1) + 1
        line = text.count("\n", 0, match.end())
        code = text[match.end() : end]
        yield Snippet(page, line, match["language"], code, (match["reason"] or "").strip())


def pages() -> dict[str, list[Snippet]]:
    """Pages with snippets."""
    found = {}
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        name = path.relative_to(ROOT).as_posix()
        if all_of_it := list(snippets(name, path.read_text(encoding="utf-8"))):
            found[name] = all_of_it
    return found


PAGES = pages()


@pytest.fixture(scope="session")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What pages take for granted: models/, docs/examples/, arm.urdf and recordings of it.

    arm.urdf is the double pendulum with other names; the recorded one rubs at its elbow.
    """
    folder = tmp_path_factory.mktemp("scene")
    text = (MODELS / "double_pendulum.urdf").read_text(encoding="utf-8")
    text = text.replace('"lower"', '"forearm"')
    (folder / "arm.urdf").write_text(text, encoding="utf-8")
    model = diffnea.load_model(folder / "arm.urdf")
    rubbing = model.with_effects(
        [diffnea.Effect("coulomb_friction", "elbow", {"coulomb": 0.4, "smoothing": 0.01})]
    )
    for seed, name in enumerate(("train", "test", "arm"), start=1):
        motion = diffnea.excite(model, duration=10, seed=seed)
        recording = diffnea.simulate(rubbing, motion, noise=0.2, seed=seed).recording
        diffnea.write_recording(recording, folder / f"{name}.csv")
    return folder


@pytest.fixture
def prepared(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The scene's own copy, which is the current folder, and no window opens."""
    shutil.copytree(scene, tmp_path, dirs_exist_ok=True)
    (tmp_path / "models").symlink_to(MODELS)
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    return tmp_path


class Shell:
    """One session of bash, which ends at the first command that fails."""

    def __init__(self, folder: Path) -> None:
        # `python` and `diffnea` are those that are tested, wherever they lie.
        tools = folder / ".tools"
        tools.mkdir()
        for name, target in {"python": sys.executable, "diffnea": COMMAND}.items():
            script = tools / name
            script.write_text(f'#!/bin/sh\nexec "{target}" "$@"\n', encoding="utf-8")
            script.chmod(0o755)
        self.folder = folder
        self.state = folder / ".tools" / "state.sh"
        self.state.write_text(f'PATH="{tools}:$PATH"\n', encoding="utf-8")

    def run(self, code: str) -> None:
        """Run a block with the variables of those before; fail with what it printed."""
        block = self.folder / ".tools" / "block.sh"
        block.write_text(code, encoding="utf-8")
        script = (
            f'. "{self.state}"; set -euo pipefail; . "{block}"; declare -p > "{self.state}" 2>&1'
        )
        with subprocess.Popen(
            ["bash", "-c", script],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=self.folder,
            start_new_session=True,
        ) as process:
            try:
                printed, _ = process.communicate(timeout=SECONDS)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                raise
        # Read-only variables of bash cannot be set again.
        lines = [
            line for line in self.state.read_text().splitlines() if line.startswith("declare -- ")
        ]
        tools = self.state.parent
        self.state.write_text("\n".join([*lines, f'PATH="{tools}:$PATH"', ""]), encoding="utf-8")
        assert process.returncode == 0, printed


def names_of_a_page(folder: Path) -> dict[str, object]:
    """Return what Python blocks may take for granted: the arm, its arrays, a hand and a ball."""
    model = diffnea.load_model(folder / "arm.urdf")
    recording = diffnea.read_recording(folder / "arm.csv")
    apart = np.stack([np.eye(4), np.eye(4)])
    apart[1, 2, 3] = -0.4
    return {
        "__name__": "page",
        "diffnea": diffnea,
        "np": np,
        "model": model,
        "t": recording.time,
        "q": recording.q,
        "tau": recording.tau,
        "frame": recording.to_frame(),
        "X": apart,
        "V": np.zeros((2, 6)),
        "Vd": np.zeros((2, 6)),
    }


@pytest.mark.parametrize("page", PAGES)
def test_page(page: str, prepared: Path) -> None:
    """Every block of the page runs."""
    pytest.importorskip("pandas")
    pytest.importorskip("matplotlib")
    shell = Shell(prepared)
    names = names_of_a_page(prepared)
    for snippet in PAGES[page]:
        if snippet.reason:
            continue
        if snippet.language == "json":
            json.loads(snippet.code)
        elif snippet.language == "python":
            # Lines as in the page, so that a traceback names them.
            code = compile("\n" * snippet.line + snippet.code, str(ROOT / page), "exec")
            with contextlib.redirect_stdout(io.StringIO()):
                exec(code, names)
        else:
            try:
                shell.run(snippet.code)
            except AssertionError as error:
                raise AssertionError(f"{snippet.name}:\n{snippet.code}\n{error}") from None


# Blocks that do not run, by page. Who adds one changes this, and has said why in the page.
NOT_RUN = {
    "docs/diagnosis.md": 1,
    "docs/guide/quadruped.md": 1,
    "docs/guide/servo_arm.md": 2,
    "docs/guide/start.md": 1,
    "docs/identification.md": 1,
    "docs/models.md": 5,
    "docs/policy.md": 2,
    "docs/python.md": 2,
    "docs/recordings.md": 3,
    "docs/reproduce.md": 2,
    "docs/systems.md": 1,
}


def test_what_is_not_run() -> None:
    """Skipping is seen: so many blocks, each with a reason."""
    skipped = {
        page: sum(bool(each.reason) for each in found)
        for page, found in PAGES.items()
        if any(each.reason for each in found)
    }
    assert skipped == NOT_RUN


def test_a_marker_stands_before_a_fence() -> None:
    """A marker that belongs to no block would look like one that does."""
    for path in (ROOT / "docs").rglob("*.md"):
        text = path.read_text(encoding="utf-8")
        markers = len(re.findall(r"^<!-- not run", text, re.MULTILINE))
        followed = len(re.findall(r"^<!-- not run: [^>]{5,} -->\n```\w+\n", text, re.MULTILINE))
        assert markers == followed, path


def test_snippets_are_found() -> None:
    """The reader of fences itself: languages, lines, reasons."""
    text = "# A\n\n```python\nx = 1\n```\n<!-- not run: because -->\n```sh\nls\n```\n"
    text += "```xml\n<a/>\n```\n"
    one, two = snippets("p.md", text)
    assert (one.language, one.line, one.code, one.reason) == ("python", 3, "x = 1\n", "")
    assert (two.language, two.line, two.code, two.reason) == ("sh", 7, "ls\n", "because")
