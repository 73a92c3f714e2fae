"""Identify the dynamics of a robot from recordings, and name the effect that its model lacks."""

from ._core import __version__

__all__ = ["__version__"]
