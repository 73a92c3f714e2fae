"""The robot descriptions that come with diffnea."""

from __future__ import annotations

import importlib.metadata
import os
from pathlib import Path

from ._core import _find_model_file

__all__ = ["names", "path"]

_EXTENSIONS = [".xml", ".urdf", ".json"]


def _folders() -> list[Path]:
    """Where to look: $DIFFNEA_MODELS, then wherever this installation put its files."""
    folders = []
    if chosen := os.environ.get("DIFFNEA_MODELS"):
        folders.append(Path(chosen))
    try:
        files = importlib.metadata.files("diffnea") or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    for file in files:
        if file.match("share/diffnea/models/*"):
            folders.append(Path(str(file.locate())).resolve().parent)
            break
    return folders


def _known() -> dict[str, Path]:
    """Models by name; the first folder that has a name wins."""
    known: dict[str, Path] = {}
    for folder in _folders():
        for extension in _EXTENSIONS:
            for file in sorted(folder.glob(f"*{extension}")):
                if not file.stem.startswith("surrogate_"):  # ranges of a world, no robot
                    known.setdefault(file.stem, file)
    return known


def names() -> list[str]:
    """Names of the models that come with diffnea."""
    return sorted(_known())


def path(name: str) -> Path:
    """Path of a model that comes with diffnea: ``wam4.xml``, or ``wam4``.

    Raises :class:`diffnea.FileError`, which lists the models there are.
    """
    known = _known()
    stem, extension = Path(name).stem, Path(name).suffix
    found = known.get(stem)
    if found is not None and extension in ("", found.suffix):
        return found
    return Path(_find_model_file(stem, [extension] if extension else _EXTENSIONS))
