"""What the paper's table says, row by row, to be printed beside ours."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PaperRow:
    """Of the ten best policies; shares in percent, None where the paper has none."""

    reward: float
    spread: float
    transfer: int
    repeatability: int | None


SIMULATION = {
    ("lstm", 40): PaperRow(0.92, 0.37, 0, None),
    ("ff-nn", 40): PaperRow(0.86, 0.35, 0, None),
    ("nominal", 40): PaperRow(2.45, 1.15, 64, None),
    ("diffnea", 40): PaperRow(2.73, 1.64, 52, None),
}
ROBOT = {
    ("lstm", 40): PaperRow(0.91, 0.56, 0, 0),
    ("ff-nn", 40): PaperRow(1.46, 0.78, 0, 0),
    ("nominal", 40): PaperRow(1.41, 0.45, 0, 0),
    ("diffnea", 40): PaperRow(1.77, 0.74, 60, 90),
    ("diffnea", 35): PaperRow(1.58, 0.15, 30, 70),
    ("diffnea", 45): PaperRow(1.74, 0.71, 60, 100),
}


def paper_row(simulated: bool, kind: str, length: float) -> PaperRow | None:
    """Return what the paper has for a model and a string [m]: of its robot, if not simulated."""
    return (SIMULATION if simulated else ROBOT).get((kind, round(100 * length)))
