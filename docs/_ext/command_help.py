"""The directive `command-help`: what a command says of itself, asked as the site is built.

    ```{command-help}
    diffnea
    ```

gives a section for the command and for each of its subcommands with the text of `--help`; every
line is a command. With the option `:plain:` it is run as it stands, and what it prints is shown.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

WIDTH = 100  # of the lines that a page shows without a scroll bar


def executable(name: str) -> list[str]:
    """How to start it: $DIFFNEA_COMMAND, beside this interpreter, on the PATH."""
    if name == "python":
        return [sys.executable]
    chosen = os.environ.get("DIFFNEA_COMMAND") if name == "diffnea" else None
    beside = Path(sys.executable).parent / name
    found = chosen or (str(beside) if beside.is_file() else shutil.which(name))
    if not found:
        raise FileNotFoundError(f"no command {name} beside {sys.executable} nor on the PATH")
    return [found]


def output(command: list[str]) -> str:
    """Run it, which must succeed, and return what it prints, without this machine's folders."""
    answer = subprocess.run(
        executable(command[0]) + command[1:],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=os.environ | {"COLUMNS": str(WIDTH)},
    )
    if answer.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: exit status {answer.returncode}: {answer.stderr}")
    return answer.stdout.replace(str(Path(executable(command[0])[0]).parents[1]), "…")


def wrapped(text: str) -> str:
    """Break long lines below the column in which their text begins."""
    lines = []
    for line in text.rstrip().splitlines():
        rest, indent = line, " " * hanging_indent(line)
        while len(rest) > WIDTH:
            cut = rest.rfind(" ", len(indent) + 1, WIDTH + 1)
            if cut < 0:
                break
            lines.append(rest[:cut])
            rest = indent + rest[cut + 1 :]
        lines.append(rest)
    return "\n".join(lines)


def hanging_indent(line: str) -> int:
    """Return the column of the description of an option, or the line's own indent."""
    described = re.match(r"\s+\S.*?\s{2,}(?=\S)", line)
    return len(described[0]) if described else len(line) - len(line.lstrip())


def subcommands(text: str) -> list[str]:
    """Names below `Subcommands:`; none of a command that has none (or is not by CLI11)."""
    listed = re.search(r"^Subcommands:\n((?: .*\n?)+)", text, re.MULTILINE)
    return re.findall(r"^ {2}(\S+)", listed[1], re.MULTILINE) if listed else []


class CommandHelp(SphinxDirective):
    """See above."""

    has_content = True
    option_spec = {"plain": directives.flag}  # noqa: RUF012 (docutils' way)

    def run(self) -> list[nodes.Node]:
        """Sections, or the text alone."""
        made: list[nodes.Node] = []
        for line in self.content:
            if "plain" in self.options:
                made.append(nodes.literal_block("", wrapped(output(line.split())), language="none"))
            else:
                made += self.sections(line.split())
        return made

    def sections(self, command: list[str]) -> list[nodes.Node]:
        """Of the command and, one below the other, of its subcommands."""
        text = output([*command, "--help"])
        name = " ".join(command)
        section = nodes.section(ids=[nodes.make_id(name)], names=[nodes.fully_normalize_name(name)])
        section += nodes.title("", "", nodes.literal("", name))
        section += nodes.literal_block("", wrapped(text), language="none")
        made: list[nodes.Node] = [section]
        for each in subcommands(text):
            made += self.sections([*command, each])
        return made


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True}
