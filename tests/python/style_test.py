"""Figures for a paper: their size, their fonts, their colours."""

import itertools
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import diffnea

matplotlib = pytest.importorskip("matplotlib")

#: Least distance of two colours in CIE Lab for any kind of colour vision: 17 here. That of the
#: first seven of matplotlib's own cycle is 5.
LEAST_DISTANCE = 15.0


@pytest.fixture(scope="module")
def result(arm, train, held_out) -> diffnea.IdentifyResult:
    return diffnea.identify(arm, train, test=held_out)


def test_a_plot_has_the_width_and_font_of_the_column(result, tmp_path: Path) -> None:
    before = result.plot().get_size_inches()
    with diffnea.style.paper("column", font_size=8):
        figure = result.plot()
        figure.savefig(tmp_path / "fit.pdf")
    assert figure.get_size_inches()[0] == 3.5
    labels = [axis.yaxis.label for axis in figure.axes]
    assert {label.get_fontsize() for label in labels} == {8}
    assert {label.get_fontfamily()[0] for label in labels} == {"serif"}
    assert figure.axes[0].lines[2].get_color() == "C0"
    pdf = (tmp_path / "fit.pdf").read_bytes()
    assert re.search(rb"/Subtype /TrueType|/CIDFontType2", pdf)
    assert b"/Type3" not in pdf
    np.testing.assert_array_equal(result.plot().get_size_inches(), before)


def test_a_page_is_wider_and_a_number_is_inches(result) -> None:
    for width, inches in (("page", 7.16), (5.0, 5.0)):
        with diffnea.style.paper(width):
            assert result.plot().get_size_inches()[0] == inches
    with (
        pytest.raises(diffnea.Error, match="width: got 'poster'; choices: column, page"),
        diffnea.style.paper("poster"),
    ):
        pass


def test_own_figures_have_the_colours_too() -> None:
    from matplotlib.figure import Figure

    with diffnea.style.paper():
        (line,) = Figure().subplots().plot([0, 1])
        cycle = matplotlib.rcParams["axes.prop_cycle"].by_key()["color"]
    assert line.get_color() == diffnea.style.BLUE
    assert cycle == list(diffnea.style.CYCLE)
    assert matplotlib.rcParams["pdf.fonttype"] == 3  # outside, nothing changed


#: Machado, Oliveira, Fernandes 2009, severity 1: what a colour is seen as, in linear RGB.
SEEN_AS = {
    "anyone": np.eye(3),
    "protanope": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranope": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
}


def lab(color: str, vision: np.ndarray) -> np.ndarray:
    srgb = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    linear = np.where(srgb > 0.04045, ((srgb + 0.055) / 1.055) ** 2.4, srgb / 12.92)
    xyz = np.array(
        [
            [0.4124564, 0.3575761, 0.1804375],
            [0.2126729, 0.7151522, 0.0721750],
            [0.0193339, 0.1191920, 0.9503041],
        ]
    ) @ np.clip(vision @ linear, 0, 1)
    f = np.cbrt(xyz / [0.95047, 1, 1.08883])
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("vision", SEEN_AS)
def test_the_colours_are_told_apart_by_everyone(vision: str) -> None:
    seen = [lab(color, SEEN_AS[vision]) for color in diffnea.style.CYCLE]
    apart = [np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2)]
    assert min(apart) > LEAST_DISTANCE


def test_without_matplotlib_the_message_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with (
        pytest.raises(
            ImportError, match=r"style.paper needs matplotlib.*pip install .*matplotlib>="
        ),
        diffnea.style.paper(),
    ):
        pass
