"""Options that the compiled part describes, in a function's signature and docstring."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


def with_options(options: Sequence[tuple[str, str, object, str]]) -> Callable[[F], F]:
    """Put options in place of ``**options``: name, type, default and text of each."""

    def described(function: F) -> F:
        signature = inspect.signature(function)
        *others, _ = signature.parameters.values()
        added = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=now, annotation=kind)
            for name, kind, now, _ in options
        ]
        vars(function)["__signature__"] = signature.replace(parameters=[*others, *added])
        lines = (function.__doc__ or "").splitlines(keepends=True)
        for k, line in enumerate(lines):
            if line.strip().startswith("**options:"):
                lines[k] = "".join(_entry(name, text) for name, _, _, text in options)
        function.__doc__ = "".join(lines)
        return function

    return described


def _entry(name: str, text: str) -> str:
    """Return an option's lines of ``Args:``."""
    text = re.sub(r"\S*@[\w:=,]*\w", r"``\g<0>``", text)  # no addresses of mail
    lines = textwrap.fill(
        f"{name}: {text}.", 100, initial_indent=" " * 8, subsequent_indent=" " * 12
    )
    return lines + "\n"
