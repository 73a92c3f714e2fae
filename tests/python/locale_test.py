"""A program whose numbers have a comma, as a toolkit of windows may set it: files do not mind.

Also the texts of a result, which may be read again, have a point.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
import whole_files
from cli import MODELS, SECONDS

SCRIPT = """
import locale, sys
from pathlib import Path
import diffnea

out, models, name = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
if name:
    locale.setlocale(locale.LC_NUMERIC, name)
    assert locale.localeconv()["decimal_point"] == ","

arm = diffnea.load_model(models / "double_pendulum.urdf")
train, test = (
    diffnea.simulate(arm, diffnea.excite(arm, duration=5, seed=k), noise=0.2, seed=k).recording
    for k in (1, 2)
)
diffnea.write_recording(train, out / "train.csv")
lines = (out / "train.csv").read_text().splitlines()
beyond = lines[10].split(",")
beyond[2] = "1.5e400"  # no number: a row that cannot be true
(out / "beyond.csv").write_text("\\n".join([*lines[:10], ",".join(beyond), *lines[11:]]) + "\\n")
print(diffnea.read_recordings(out / "beyond.csv").report.quarantined)
fitted = diffnea.identify(arm, train, test=test)
fitted.save(out / "identify")
found = diffnea.diagnose(arm, train, test=test)
found.save(out / "diagnose")
print(fitted, found, diffnea.compare(fitted, diffnea.identify(arm, test)), sep="\\n")

for robot in ("panda.urdf", "wam4_ball_in_cup.xml"):
    model = diffnea.load_model(models / robot)
    for suffix in (".json", ".urdf", ".xml"):
        path = out / Path(robot).with_suffix(suffix).name
        print(diffnea.Model.from_dict(model.to_dict()).save(path))
        print(diffnea.load_model(path).to_dict())
ball = diffnea.load_model(models / "wam4_ball_in_cup.xml")
learned = diffnea.learn(ball, samples=16, iterations=3)
learned.save(out / "learn")
world = "mujoco:wam4_ball_in_cup,perturb=none,rope=light"
print(diffnea.transfer(learned, world=world, repetitions=1, threads=1).outcomes)
"""


@pytest.fixture
def with_comma(tmp_path: Path) -> dict[str, str]:
    """The environment of a locale whose numbers have a comma, which is made for it."""
    tool = shutil.which("localedef")
    made = [str(tool), "-i", "de_DE", "-f", "UTF-8", str(tmp_path / "de_DE.UTF-8")]
    if tool is None or subprocess.run(made, capture_output=True, check=False).returncode:
        pytest.skip("no locale can be made: install the package locales")
    return os.environ | {"LOCPATH": str(tmp_path)}


def drawings(page: Path) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return [x for x in text.splitlines() if "data-draw=" in x or "id='data'" in x]


def test_a_comma_in_the_programs_numbers_changes_no_file(
    with_comma: dict[str, str], tmp_path: Path
) -> None:
    def run(folder: Path, name: str, environment: Mapping[str, str]) -> str:
        folder.mkdir()
        words = [sys.executable, "-c", SCRIPT, str(folder), str(MODELS), name]
        answer = subprocess.run(
            words, capture_output=True, text=True, env=environment, timeout=SECONDS, check=False
        )
        assert answer.returncode == 0, answer.stderr
        return re.sub(r"\S+ s\n", "", answer.stdout)  # how long it took

    point, comma = tmp_path / "point", tmp_path / "comma"
    assert run(point, "", os.environ) == run(comma, "de_DE.UTF-8", with_comma)
    assert whole_files.results(point) == whole_files.results(comma)
    pages = list(point.rglob("report.html"))
    assert len(pages) == 3
    for page in pages:
        assert drawings(page)
        assert drawings(page) == drawings(comma / page.relative_to(point)), page
