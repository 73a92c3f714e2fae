"""Signatures of the compiled module as its stub file has them: with types that mean something.

pybind11 writes `q: object`; the stub, which python/make_stub.py writes and mypy and stubtest check,
says `ArrayLike`.
"""

import ast
import inspect
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

import diffnea

Signature = tuple[str, str]


def text_of(function: ast.FunctionDef, *, bound: bool) -> Signature:
    """Return `(q: Array, …)` and what it returns, as text."""
    arguments = function.args
    if bound:  # self or cls says nothing
        first = arguments.posonlyargs or arguments.args
        del first[:1]
    returns = ast.unparse(function.returns) if function.returns else ""
    return f"({ast.unparse(arguments)})", returns


def read_stub(path: Path) -> dict[str, Signature]:
    """Signatures by name: `rnea`, `Model.save`, and `Model` for its constructor."""
    found: dict[str, Signature] = {}
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            found[node.name] = text_of(node, bound=False)
        elif isinstance(node, ast.ClassDef):
            for member in node.body:
                if not isinstance(member, ast.FunctionDef):
                    continue
                decorators = {ast.unparse(each) for each in member.decorator_list}
                signature = text_of(member, bound="staticmethod" not in decorators)
                if "property" in decorators:
                    found[f"{node.name}.{member.name}"] = ("", signature[1])
                elif member.name == "__init__":
                    found[node.name] = (signature[0], "")
                else:
                    found[f"{node.name}.{member.name}"] = signature
    return found


STUB = read_stub(Path(diffnea.__file__).with_name("_core.pyi"))


def from_stub(
    _app: Sphinx, what: str, name: str, _thing: Any, _options: Any, *_: Any
) -> Signature | None:
    """For autodoc: the stub's signature of what is compiled."""
    if what in ("class", "function", "method"):
        return STUB.get(name.removeprefix("diffnea."))
    return None


def setup(app: Sphinx) -> dict[str, bool]:
    """Listen to autodoc, which must see that a class has a constructor before it asks for more."""
    for name in STUB:
        thing = getattr(diffnea, name, None)
        if inspect.isclass(thing):
            thing.__signature__ = inspect.Signature()
    app.connect("autodoc-process-signature", from_stub)
    return {"parallel_read_safe": True}
