"""The C++ reference: Doxygen's pages in html/cpp, its warnings errors, and the role `cpp-file`.

Doxygen's own pages, because what Sphinx's C++ domain makes of them takes minutes and does not know
constrained templates. `` {cpp-file}`dynamics/rnea.hpp` `` links to the page of a header.
"""

import shutil
import subprocess
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging
from sphinx.util.docutils import SphinxRole

LOG = logging.getLogger(__name__)
FOLDER = "cpp"


def run_doxygen(app: Sphinx, error: Exception | None) -> None:
    """Write html/cpp; a warning is an error and ends the build."""
    if error is not None or app.builder.format != "html":
        return
    if shutil.which("doxygen") is None:
        raise ExtensionError("no doxygen on the PATH: apt install doxygen, or .ci/setup --docs")
    doxyfile = Path(app.config.doxygen_file)
    settings = (
        f"@INCLUDE = {doxyfile}\n"
        f"OUTPUT_DIRECTORY = {app.outdir}\n"
        f"HTML_OUTPUT = {FOLDER}\n"
        f"PROJECT_NUMBER = {app.config.release}\n"
    )
    LOG.info("running doxygen")
    answer = subprocess.run(
        ["doxygen", "-"],
        input=settings,
        capture_output=True,
        text=True,
        check=False,
        cwd=doxyfile.parent.parent,
        timeout=600,
    )
    warnings = answer.stderr.strip()
    if answer.returncode != 0 or warnings:
        raise ExtensionError(f"doxygen: {len(warnings.splitlines())} lines of warnings\n{warnings}")


def page_of(root: Path, header: Path) -> str:
    """Return `cpp/rnea_8hpp.html`, by Doxygen's rule of names (CASE_SENSE_NAMES)."""
    include = root / "include" / "diffnea"
    alike = [one for one in include.rglob(header.name) if "detail" not in one.parts]
    name = header.name if len(alike) == 1 else header.relative_to(include).as_posix()
    escaped = name.replace("_", "__").replace("/", "_2").replace(".", "_8")
    return f"{FOLDER}/{escaped}.html"


class CppFile(SphinxRole):
    """A header of include/diffnea, linked to its page."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """Link, or an error that says which header there is not."""
        root = Path(self.env.srcdir).parent
        header = root / "include" / "diffnea" / self.text
        if not header.is_file():
            raise ExtensionError(f"{self.env.docname}: there is no include/diffnea/{self.text}")
        up = "../" * self.env.docname.count("/")
        link = nodes.reference("", "", internal=False, refuri=up + page_of(root, header))
        link += nodes.literal("", f"diffnea/{self.text}")
        return [link], []


def setup(app: Sphinx) -> dict[str, bool]:
    """Run Doxygen after the pages."""
    app.add_config_value("doxygen_file", "", "html", str)
    app.add_role("cpp-file", CppFile())
    app.connect("build-finished", run_doxygen)
    return {"parallel_read_safe": True}
