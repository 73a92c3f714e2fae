"""The directive `fields`: the keys of a result file, from the field lists of the C++ types.

    ```{fields} diagnose
    ```

gives a table of the file `diffnea/diagnose/1`, and below it one for each type that it holds.
"""

import re
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from diffnea import _core

Schema = dict[str, Any]


def type_text(schema: Schema) -> str:
    """Return what a value is, in words."""
    if "anyOf" in schema:
        return " or ".join(type_text(each) for each in schema["anyOf"])
    if "$ref" in schema:
        return f"*{schema['$ref'].rpartition('/')[2]}*"
    if "const" in schema:
        return f"`{schema['const']}`"
    if "enum" in schema:
        return ", ".join(f"`{each}`" if each else "empty" for each in schema["enum"])
    if "prefixItems" in schema:
        return "two numbers"
    if schema.get("type") == "array":
        return f"list of {type_text(schema['items'])}"
    kinds = schema.get("type", "value")
    return " or ".join(kinds) if isinstance(kinds, list) else kinds


def meaning(schema: Schema) -> str:
    """Return the description with its unit."""
    parts = schema.get("prefixItems", [schema])
    text = " ".join(
        part.get("description", "") + (f" [{part['unit']}]" if "unit" in part else "")
        for part in parts
    )
    # No formula is meant by a bar.
    return re.sub(r"(?<!\\)\|", r"\\|", " ".join(text.split()))


def rows(schema: Schema, outer: str = "") -> list[str]:
    """Lines of a table; described objects within are flattened."""
    out = []
    for key, value in schema["properties"].items():
        inner = value.get("properties", {})
        if any("description" in each for each in inner.values()) and "$ref" not in value:
            out += rows(value, f"{outer}{key}.")
        else:
            out.append(f"| `{outer}{key}` | {type_text(value)} | {meaning(value)} |")
    return out


def table(schema: Schema) -> str:
    """Return a Markdown table."""
    return "\n".join(["| key | type | meaning |", "|---|---|---|", *rows(schema)])


def text_of(schema: Schema) -> str:
    """Return the tables of a file, as Markdown."""
    parts = [table(schema)]
    for name, each in schema.get("$defs", {}).items():
        parts += [f"*{name}*: {meaning(each)}", table(each)]
    return "\n\n".join(parts)


class Fields(SphinxDirective):
    """See above."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Tables."""
        return self.parse_text_to_nodes(text_of(_core._json_schema(self.arguments[0])))


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("fields", Fields)
    return {"parallel_read_safe": True}
