"""Write the stub of the compiled module from what the module says of itself.

python make_stub.py FOLDER_OF_THE_MODULE STUB

Signatures and the types of properties come from pybind11's docstrings; fields of value types from
``__annotations__`` (python/value_type.hpp). Arguments that C++ takes as any object are arrays. The
tables below hold what C++ cannot say: what a dict or a tuple holds, and texts of few choices.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

HEAD = '''"""Compiled part of diffnea. Written by python/make_stub.py."""

import os
import pathlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypeAlias, TypedDict

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from ._results import Parameters

Array: TypeAlias = NDArray[np.float64]
StrPath: TypeAlias = str | os.PathLike[str]

__version__: str
'''

# Types as pybind11 writes them, and as a stub does.
SPELLING = [
    (r"typing\.SupportsFloat \| typing\.SupportsIndex", "float"),
    (r"typing\.SupportsInt \| typing\.SupportsIndex", "int"),
    (r"\btyping\.SupportsFloat\b", "float"),
    (r"\btyping\.SupportsInt\b", "int"),
    (r"os\.PathLike \| str \| bytes|os\.PathLike", "StrPath"),
    (r"typing\.Annotated\[(.*?), ['\"]FixedSize\(\d+\)['\"]\]", r"\1"),
    (r"numpy\.typing\.NDArray\[numpy\.float64\]|numpy\.ndarray(\[numpy\.float64\])?", "Array"),
    (r"collections\.abc\.", ""),
    (r"pathlib\.Path", "pathlib.Path"),
    (r"diffnea::LearnedPolicy", "Policy"),  # a class that is defined after the method
    (r"\b(?:diffnea\._core|diffnea|_core)\.", ""),
    (r"\bdict\b(?!\[)", "dict[str, Any]"),
    (r"\blist\b(?!\[)", "list[Any]"),
    (r"\btuple\b(?!\[)", "tuple[Any, ...]"),
]

# Arguments that are no arrays though C++ takes any object.
ARGUMENTS = {
    "progress": "Callable[..., object] | None",
    "simulator": "object",
    "task": "object",
    "ended": "object",
    "seeds": "Sequence[int] | None",
    "arg0": "object",
    "bodies": "int | Sequence[int | None] | None",
    "frame": "pd.DataFrame",
    "theta": "ArrayLike | None",
    "hidden": "ArrayLike | None",
}
DATA = "Sequence[Recording | os.PathLike[str]]"
OPTIONS = "list[tuple[str, str, object, str]]"
PLOTS = {"plot", "plot_ball"}
TRACE = "tuple[Array, tuple[str, ...], Array, Array, float, bool, str]"

# Types of single arguments and of what comes back.
REFINED: dict[str, dict[str, str]] = {
    "Constraint.__init__": {
        "kind": "str | Callable[..., object]",
        "relation": 'Literal["equal", "at_most"]',
        "kwargs": "ArrayLike",
    },
    "Constraint.bodies": {"return": "tuple[int | None, ...]"},
    "Effect.parameters": {"return": "dict[str, float]"},
    "Effect.table": {"return": "dict[str, Any] | None"},
    "Effect.units": {"return": "dict[str, str]"},
    "Ereps.history": {"return": "dict[str, Array]"},
    "Ereps.tell": {"rewards": "ArrayLike"},
    "IdentifyResult.plot": {"of": 'Literal["auto", "test", "train"]'},
    "Policy.ball_network": {"return": "dict[str, str] | None"},
    "Policy.caught_share": {"return": "float | None"},
    "Policy.curve": {"return": "dict[str, Array]"},
    "Policy.motion": {"return": "tuple[Array, Array]"},
    "Policy.reward": {"return": "dict[str, float]"},
    "Recording.__init__": {
        "torque_side": 'Literal["motor", "link"]',
        "torque_sampling": 'Literal["hold", "instant"] | None',
        "extra": "Mapping[str, ArrayLike]",
        "payload": "dict[str, Any] | None",
    },
    "Recording.extra": {"return": "dict[str, Array]"},
    "Recording.payload": {"return": "dict[str, Any] | None"},
    "Recording.period": {"return": "float | None"},
    "Model.from_dict": {"data": "Mapping[str, Any]"},
    "Model.with_inertial_parameters": {"pi": "ArrayLike"},
    "Promp.motion": {"theta": "ArrayLike"},
    "_BallInCup.__init__": {"ball_network": "_BallNetwork | None"},
    "_BallNetwork.evaluate": {"return": "tuple[Array, Array]"},
    "_Rollouts.record": {
        "theta": "ArrayLike",
        "return": "tuple[Array, NDArray[np.bool_] | None, list[str], NDArray[np.int_], "
        "NDArray[np.int_], Array]",
    },
    "_Rollouts.run": {
        "theta": "ArrayLike",
        "return": "tuple[Array, NDArray[np.bool_] | None, list[str]]",
    },
    "_Rollouts.trace": {"theta": "ArrayLike", "return": TRACE},
    "_World.execute": {"return": f"tuple[int, str, str, float, float, str, {TRACE}]"},
    "_audit_files": {"model": "Model | None"},
    "_audit_recordings": {"model": "Model | None"},
    "_diagnose": {"train": DATA, "test": DATA},
    "_diagnose_options": {"return": OPTIONS},
    "_identify": {"data": DATA, "test": DATA},
    "_identify_options": {"return": OPTIONS},
    "_identify_robot": {"return": "tuple[IdentifyResult, IdentifyResult, Model]"},
    "_json_schema": {"return": "dict[str, Any]"},
    "_read_recordings": {"return": "tuple[list[Recording], ReadReport]"},
    "_robot_motions": {"return": "tuple[Excitation, Excitation]"},
    "_worlds": {"return": "dict[str, Any]"},
    "after_impact": {"bodies": "Sequence[FreeBody]", "twist": "ArrayLike | None"},
    "constrained_acceleration": {"bodies": "Sequence[FreeBody]"},
    "fit_constrained": {"bodies": "Sequence[FreeBody]"},
    "effects": {"return": "list[dict[str, Any]]"},
    "rnea_derivatives": {"return": "tuple[Array, Array, Array]"},
}
OPTIONAL_ARRAYS = {"Recording.qd", "Recording.qdd", "Recording.qcmd", "Recording.ball"}
OPTIONAL_ARRAYS |= {"Recording.spin"}

SKIPPED = {"__doc__", "__module__", "__annotations__", "__repr__", "__str__", "__new__"}


def spelled(text: str) -> str:
    """Return a type as the stub writes it."""
    for pattern, replacement in SPELLING:
        text = re.sub(pattern, replacement, text)
    return text


def argument_type(function: str, name: str, given: str | None, default: str | None) -> str:
    """Return the type of an argument."""
    refined = REFINED.get(function, {}).get(name)
    if refined:
        return refined
    if given is None:
        return "Any"
    text = spelled(given)
    if text == "object":
        text = ARGUMENTS.get(name, "ArrayLike")
        optional = function.startswith(("_simulate", "_world_simulator", "_BallInCup"))
        if optional and text == "ArrayLike":
            text += " | None"
    if default == "None" and "None" not in text:
        text += " | None"
    return text


def return_type(name: str, given: str) -> str:
    """Return what comes back."""
    member = name.rpartition(".")[2]
    if refined := REFINED.get(name, {}).get("return"):
        return refined
    if member == "to_frame":
        return "pd.DataFrame"
    if member in PLOTS:
        return "Figure"
    if member == "to_dict":
        return "dict[str, Any]"
    if member == "_repr_html_":
        return "str"
    if name in OPTIONAL_ARRAYS:
        return "Array | None"
    return spelled(given)


def parsed(line: str) -> ast.FunctionDef | None:
    """Return pybind11's first line of a docstring as a function's head."""
    line = line.replace("diffnea::LearnedPolicy", "diffnea.Policy")
    # A default that is no literal has a repr of its own.
    line = re.sub(r"= <[^>]*>", "= ...", line)
    try:
        (node,) = ast.parse(f"def {line}: ...").body
    except SyntaxError:
        return None
    assert isinstance(node, ast.FunctionDef)
    return node


def head(name: str, line: str, indent: str) -> str:
    """Return `def name(…) -> …: ...` from pybind11's line."""
    node = parsed(line)
    if node is None:
        raise ValueError(f"{name}: cannot read {line!r}")
    arguments = node.args

    def written(argument: ast.arg, default: ast.expr | None) -> str:
        if argument.arg == "self":
            return "self"
        value = None if default is None else ast.unparse(default)
        given = None if argument.annotation is None else ast.unparse(argument.annotation)
        text = f"{argument.arg}: {argument_type(name, argument.arg, given, value)}"
        if value is None:
            return text
        return f"{text} = {value if not value.startswith(('{', '[', '(')) else '...'}"

    parts: list[str] = []
    positional = [*arguments.posonlyargs, *arguments.args]
    defaults: list[ast.expr | None] = [None] * (len(positional) - len(arguments.defaults))
    defaults += arguments.defaults
    hidden = [argument.arg.startswith("arg") for argument in positional]
    for k, (argument, default) in enumerate(zip(positional, defaults, strict=True)):
        parts.append(written(argument, default))
        if hidden[k] and (k + 1 == len(positional) or not hidden[k + 1]):
            parts.append("/")
    if arguments.kwonlyargs:
        parts.append("*")
    for argument, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True):
        parts.append(written(argument, default))
    if arguments.kwarg:
        parts.append(f"**{arguments.kwarg.arg}: {argument_type(name, 'kwargs', None, None)}")
    returns = "None" if node.returns is None else ast.unparse(node.returns)
    short = name.rpartition(".")[2]
    return f"{indent}def {short}({', '.join(parts)}) -> {return_type(name, returns)}: ..."


def first_line(thing: Any) -> str:
    """Return the line of the signature."""
    return (thing.__doc__ or "").split("\n")[0]


def members(name: str, cls: type) -> Iterator[str]:
    """Lines of a class."""
    fields = inspect.get_annotations(cls)
    for member, thing in cls.__dict__.items():
        if member in SKIPPED or member.startswith("_pybind11"):
            continue
        full = f"{name}.{member}"
        if isinstance(thing, property):
            given = fields.get(member)
            if given is None:
                given = return_type(full, first_line(thing.fget).rpartition("-> ")[2])
            yield f"    @property\n    def {member}(self) -> {given}: ..."
        elif member == "__hash__" and thing is None:
            yield "    __hash__: None  # type: ignore[assignment]"
        elif member == "__getstate__":
            yield "    def __getstate__(self) -> tuple[Any, ...]: ..."
        elif member == "__setstate__":
            yield "    def __setstate__(self, arg0: tuple[Any, ...], /) -> None: ..."
        elif isinstance(thing, staticmethod):
            yield "    @staticmethod\n" + head(full, first_line(thing.__func__), "    ")
        elif callable(thing) and first_line(thing).startswith(f"{member}("):
            yield head(full, first_line(thing), "    ")


def typed_options(name: str, options: list[tuple[str, str, object, str]]) -> str:
    """Return the dict that types a function's ``**options``."""
    words = "".join(word.capitalize() for word in name.split("_"))
    lines = [f"    {option}: {kind}" for option, kind, _, _ in options]
    return "\n".join([f"class _{words}(TypedDict, total=False):", *lines])


def stub(module: ModuleType) -> str:
    """Return the text of the stub."""
    out = [HEAD]
    for name, thing in vars(module).items():
        if inspect.isclass(thing):
            bases = [base for base in thing.__bases__ if base.__name__ != "pybind11_object"]
            inherits = f"({bases[0].__name__})" if bases and bases[0] is not object else ""
            lines = [] if issubclass(thing, Exception) else list(members(name, thing))
            out.append("\n".join([f"class {name}{inherits}:" + ("" if lines else " ..."), *lines]))
        elif inspect.isroutine(thing):
            out.append(head(name, first_line(thing), ""))
            if name.endswith("_options"):
                out.append(typed_options(name, thing()))
        elif isinstance(thing, str) and not name.startswith("__"):
            out.append(f"{name}: str")
    return "\n\n".join(out) + "\n"


def main() -> None:
    """Write the stub of the module in a folder."""
    folder, target = sys.argv[1:]
    sys.path.insert(0, folder)
    import _core

    Path(target).write_text(stub(_core), encoding="utf-8")


if __name__ == "__main__":
    main()
