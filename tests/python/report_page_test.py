"""The page in a browser: it draws its charts, complains of nothing, loads nothing."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from cli import SECONDS

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no chromium on PATH")

# Standard error of the browser has lines of its own about the machine; these are the page's.
COMPLAINT = re.compile(r"CONSOLE|Refused|net::ERR", re.IGNORECASE)


def rendered(page: Path, profile: Path) -> tuple[str, list[str]]:
    """Return the document after its scripts have run, and what the browser complained of."""
    assert BROWSER
    answer = subprocess.run(
        [
            *(BROWSER, "--headless", "--no-sandbox", "--disable-gpu"),
            *("--enable-logging=stderr", f"--user-data-dir={profile}", "--dump-dom", page.as_uri()),
        ],
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=True,
    )
    return answer.stdout, [x for x in answer.stderr.splitlines() if COMPLAINT.search(x)]


def test_the_page_is_one_small_file(run: Path) -> None:
    page = (run / "report.html").read_text(encoding="utf-8")
    assert len(page) < 5_000_000
    markup = page[: page.index("id='data'")]
    assert not re.search(r"src=|href=|url\(|://", markup)
    # Words and tables are there without scripts; drawings are the script's.
    assert "<noscript>" in markup
    assert markup.count("<table>") >= 3
    assert "<svg" not in markup


@needs_browser
def test_the_drawings_appear_without_complaint(run: Path, tmp_path: Path) -> None:
    document, complaints = rendered(run / "report.html", tmp_path)
    assert complaints == []
    # Two joints, held out and training: torque and error over time, error over velocity.
    assert document.count('<svg class="time"') == 8
    assert document.count('<svg class="binned"') == 4
    assert document.count('<svg class="bar"') >= 4


@needs_browser
def test_a_script_that_fails_would_be_noticed(run: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.html"
    text = (run / "report.html").read_text(encoding="utf-8")
    broken.write_text(text.replace("JSON.parse(", "nothing.parse(", 1), encoding="utf-8")
    assert rendered(broken, tmp_path / "profile")[1]
