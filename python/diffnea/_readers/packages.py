"""Optional packages, or an error that says what needs them."""

from __future__ import annotations

import importlib
from typing import Any


def import_package(name: str, purpose: str, extra: str) -> Any:
    """Import a module of an optional package.

    Raises:
        ImportError: that says how to install it: as the extra ``extra`` of diffnea.

    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(
            f"{purpose} needs {name.partition('.')[0]}; "
            f"install it with: pip install 'diffnea[{extra}]'"
        ) from error
