"""How figures look, and how they look in a paper.

    >>> with diffnea.style.paper("column"):
    ...     result.plot().savefig("fit.pdf")

Save inside the ``with``: what fonts a PDF embeds is settled there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

from ._core import Error
from ._readers.packages import import_package

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, PURPLE = "#0072b2", "#e69f00", "#009e73", "#cc79a7"
SKY, VERMILION, GREY = "#56b4e9", "#d55e00", "#555555"

#: Told apart with any kind of colour vision, and in print (Okabe and Ito 2008).
CYCLE = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION, GREY)

#: Widths [inch] of one column and of a page of two, as IEEE and most others set them.
WIDTHS: Mapping[str, float] = {"column": 3.5, "page": 7.16}

#: Text stays text, and the same figure is the same file.
SVG: Mapping[str, Any] = {"svg.fonttype": "none", "svg.hashsalt": "diffnea"}

#: Labels keep their size when a figure is made narrow, so its rows cannot shrink as much.
_LEAST_ROW = 0.55

_asked_width: ContextVar[float | None] = ContextVar("asked_width", default=None)


@contextmanager
def paper(width: str | float = "column", *, font_size: float = 8.0) -> Iterator[None]:
    """Draw figures for print, in the size in which they are printed.

    Every ``plot()`` called inside has the width asked for, a serif font of ``font_size`` points,
    thin lines, colours of :data:`CYCLE`; PDF and PostScript embed TrueType fonts (type 42), which
    publishers ask for. It holds for figures of one's own, too: it sets matplotlib's parameters.

    Args:
        width: ``column`` (3.5 inches), ``page`` (7.16 inches), or a width in inches.
        font_size: of all text [pt]; ticks and legends are a point smaller.

    Raises:
        Error: if there is no such width.
        ImportError: without matplotlib.

    """
    inches = WIDTHS.get(width) if isinstance(width, str) else float(width)
    if inches is None or not 0.5 <= inches <= 50:
        choices = ", ".join(WIDTHS)
        raise Error(f"paper: width: got {width!r}; choices: {choices}, or inches from 0.5 to 50")
    matplotlib = import_package("matplotlib", "style.paper", "plots")
    small = font_size - 1
    parameters = {
        "axes.prop_cycle": matplotlib.cycler(color=CYCLE),
        "axes.labelsize": font_size,
        "axes.titlesize": font_size,
        "axes.linewidth": 0.6,
        "figure.titlesize": font_size,
        "figure.figsize": (inches, inches / 1.5),
        "font.family": "serif",
        "font.serif": ["STIXGeneral", "DejaVu Serif"],
        "font.size": font_size,
        "legend.fontsize": small,
        "legend.frameon": False,
        "lines.linewidth": 1.0,
        "mathtext.fontset": "stix",
        "pdf.fonttype": 42,
        "ps.fonttype": 42,
        "savefig.dpi": 600,
        "xtick.labelsize": small,
        "ytick.labelsize": small,
        "xtick.major.width": 0.6,
        "ytick.major.width": 0.6,
    }
    token = _asked_width.set(inches)
    try:
        with matplotlib.rc_context({**parameters, **SVG}):
            yield
    finally:
        _asked_width.reset(token)


def new_figure(purpose: str, width: float, height: float) -> Figure:
    """Make an empty figure of a size [inch], or of the width that :func:`paper` asks for.

    Raises:
        ImportError: without matplotlib; ``purpose`` is what needs it.

    """
    figure_type = import_package("matplotlib.figure", purpose, "plots").Figure
    asked = _asked_width.get()
    if asked is not None:
        height *= max(asked / width, _LEAST_ROW)
        width = asked
    figure: Figure = figure_type(figsize=(width, height), layout="constrained")
    return figure
