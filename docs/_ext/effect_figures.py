"""The pictures of the effects, drawn into docs/_generated before pages are read.

They are not drawn again while they are younger than the scripts that draw them and the module.
"""

import subprocess
import sys
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging

import diffnea

LOG = logging.getLogger(__name__)


def draw(app: Sphinx) -> None:
    """Run figures/effect_signatures.py where it is there and its pictures are not, or are old."""
    source = Path(app.srcdir)
    script = source / "figures" / "effect_signatures.py"
    if not script.is_file():
        return
    folder = source / "_generated" / "effects"
    causes = [*script.parent.glob("*.py"), *Path(diffnea.__file__).parent.glob("_core*.so")]
    stamp = folder / "drawn"
    if stamp.is_file() and stamp.stat().st_mtime > max(one.stat().st_mtime for one in causes):
        return
    LOG.info("drawing the pictures of the effects")
    folder.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, str(script), str(folder)]
    answer = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    if answer.returncode != 0:
        raise ExtensionError(f"{' '.join(command)}:\n{answer.stdout}{answer.stderr}")
    stamp.touch()


def setup(app: Sphinx) -> dict[str, bool]:
    """Draw before pages are read."""
    app.connect("builder-inited", draw)
    return {"parallel_read_safe": True}
