"""Optional packages, or an error that says what needs them."""

from __future__ import annotations

import importlib
import re
import shlex
import sys
from importlib import metadata
from typing import Any


def requirements(extra: str) -> list[str]:
    """Return what an extra of diffnea asks for, e.g. ``["matplotlib>=3.7"]``.

    Raises:
        PackageNotFoundError: the module runs from a source tree that was not installed.

    """
    marker = re.compile(rf"(.+?)\s*;\s*extra\s*==\s*['\"]{re.escape(extra)}['\"]")
    found = map(marker.fullmatch, metadata.requires("diffnea") or [])
    return [match[1] for match in found if match]


def install_command(extra: str) -> str:
    """Return a command that installs what an extra needs into this environment.

    It names the packages themselves and works beside a checkout as beside a wheel; diffnea's own
    name would not, being on no package index.
    """
    try:
        packages = requirements(extra)
    except metadata.PackageNotFoundError:
        packages = [f".[{extra}]"]
    return shlex.join([sys.executable or "python", "-m", "pip", "install", *packages])


def import_package(name: str, purpose: str, extra: str) -> Any:
    """Import a module of an optional package.

    Raises:
        ImportError: that says how to install what the extra ``extra`` of diffnea asks for.

    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(
            f"{purpose} needs {name.partition('.')[0]}; install it with: {install_command(extra)}"
        ) from error
