"""Headers as Doxygen reads them (INPUT_FILTER of docs/Doxyfile).

First doxygen.sed; then each member that a field list (diffnea/core/fields.hpp) names gets the text
that stands there as its comment, with the unit. Lines stay what they are, so that warnings name the
right ones.
"""

import re
import subprocess
import sys
from pathlib import Path

ENTRY = re.compile(
    r"list\.(?:field|columns|in_memory)\(\s*\"\w+\",\s*&(\w+)::(\w+),\s*((?:\"(?:[^\"\\]|\\.)*\"\s*)+)([^;]*)\);"
)
UNIT = re.compile(r"\.unit = \"([^\"]*)\"")
STRUCT = re.compile(r"^struct (\w+) ")
LIST = "  template <class List>"
ABOUT_LIST = (
    "  /** Names, units and meanings of the members, for visitors (diffnea/core/fields.hpp). */"
)


def texts(source: str) -> dict[tuple[str, str], str]:
    """Comments by struct and member."""
    found = {}
    for struct, member, quoted, traits in ENTRY.findall(source):
        text = "".join(re.findall(r"\"((?:[^\"\\]|\\.)*)\"", quoted))
        text = re.sub(r":class:`(\w+)`", r"\1", text).replace("``", "`").replace("\\n", " ")
        unit = UNIT.search(traits)
        found[struct, member] = text + (f" [{unit[1]}]" if unit else "")
    return found


def commented(source: str) -> str:
    """Return the header with the comments."""
    comments = texts(source)
    struct = ""
    lines = source.split("\n")
    for k, line in enumerate(lines):
        if start := STRUCT.match(line):
            struct = start[1]
        member = re.match(r"  [\w:<>, ]+ (\w+)(?: = [^;]*|\{\})?;$", line)
        if member and (struct, member[1]) in comments:
            lines[k] = f"{line}  ///< {comments[struct, member[1]]}"
        elif line == LIST and " fields(" in lines[k + 1]:
            lines[k] = f"{ABOUT_LIST} {line.lstrip()}"
    return "\n".join(lines)


def main() -> None:
    """Print the header that is named."""
    rules = Path(__file__).with_name("doxygen.sed")
    answer = subprocess.run(
        ["sed", "-f", str(rules), sys.argv[1]], capture_output=True, text=True, check=True
    )
    sys.stdout.write(commented(answer.stdout))


if __name__ == "__main__":
    main()
