"""Small pictures for the pages of the effects."""

from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl

mpl.use("svg")

import matplotlib.pyplot as plt
import numpy as np

MOST_POINTS = 600  # of a curve: pages stay small
STYLE = {
    "font.size": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "diffnea",  # the same file from the same numbers
}


@dataclass(frozen=True)
class Panel:
    """One curve, or several: y is (n,) or a name for each of some."""

    x: np.ndarray
    y: np.ndarray | dict[str, np.ndarray]
    x_label: str
    y_label: str
    dots: bool = False
    grey: np.ndarray | None = None  # drawn behind, to its own scale


def thinned(x: np.ndarray) -> np.ndarray:
    """Return no more points than a page needs."""
    return x[:: max(1, len(x) // MOST_POINTS)]


def save(path: Path, panels: list[Panel]) -> None:
    """Draw panels side by side into one file."""
    with mpl.rc_context(STYLE):
        figure, axes = plt.subplots(
            1, len(panels), figsize=(3.2 * len(panels), 1.9), squeeze=False, layout="constrained"
        )
        for axis, panel in zip(axes[0], panels, strict=True):
            if panel.grey is not None:
                behind = axis.twinx()
                behind.plot(thinned(panel.x), thinned(panel.grey), color="0.8", linewidth=0.8)
                behind.set_axis_off()
                axis.set_zorder(behind.get_zorder() + 1)
                axis.patch.set_visible(False)
            curves = panel.y if isinstance(panel.y, dict) else {"": panel.y}
            for label, y in curves.items():
                style = {"linestyle": "", "marker": ".", "markersize": 1.5} if panel.dots else {}
                axis.plot(thinned(panel.x), thinned(y), linewidth=1.0, label=label, **style)
            if len(curves) > 1:
                axis.legend(frameon=False, fontsize=7)
            axis.axhline(0.0, color="0.6", linewidth=0.5)
            axis.set_xlabel(panel.x_label)
            axis.set_ylabel(panel.y_label)
        figure.savefig(path, metadata={"Date": None})
        plt.close(figure)
