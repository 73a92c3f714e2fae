"""A ball's path as results give it to Python, and its pictures."""

import pickle

import numpy as np
import pytest

import diffnea
from diffnea import _core

ROWS, LENGTH = 600, 0.4


def made(*, string: bool = True) -> diffnea.BallSeries:
    """Return a ball that swings in a cone; two windows in each of two recordings."""
    window = np.arange(ROWS) // (ROWS // 4)
    run = window // 2
    time = 0.01 * (np.arange(ROWS) - run * ROWS // 2)
    phase = 0.05 * np.arange(ROWS)
    tilt = 0.5 + 0.2 * np.sin(0.3 * phase)
    u = np.stack([np.sin(tilt) * np.cos(phase), np.sin(tilt) * np.sin(phase), -np.cos(tilt)], 1)
    anchor = np.stack([0.1 * np.sin(time), np.zeros(ROWS), np.ones(ROWS)], 1)
    taut = np.arange(ROWS) % 100 < 80
    extended = anchor + LENGTH * u
    base = anchor + (LENGTH - 0.01) * u
    measured = extended + 1e-3 * np.random.default_rng(1).normal(size=(ROWS, 3))
    measured[5] = np.nan
    flags = [pickle_flag(0, 0.5, "ball", "0.3 m off")]
    state = (
        *(True, string, run.tolist(), window.tolist(), time),
        *(measured, base, extended, anchor, taut.tolist()),
        *(LENGTH, 1e-3, 5.8e-3, 1e-3, flags),
    )
    series = _core.BallSeries.__new__(_core.BallSeries)
    series.__setstate__(state)
    return series


def pickle_flag(*state) -> diffnea.BallFlag:
    flag = _core.BallFlag.__new__(_core.BallFlag)
    flag.__setstate__(state)
    return flag


def test_the_series_is_arrays() -> None:
    ball = made()
    assert len(ball) == ROWS
    assert ball.measured.shape == ball.base.shape == ball.anchor.shape == (ROWS, 3)
    assert ball.run.dtype.kind == "i"
    assert ball.taut.dtype == bool
    assert np.isnan(ball.measured[5]).all()
    assert ball.flagged[0].reason == "0.3 m off"
    assert "measured=array(600, 3)" in repr(ball)
    assert repr(ball.flagged[0]).startswith("BallFlag(run=0, time=0.5")


def test_the_series_survives_pickling() -> None:
    ball = made()
    again = pickle.loads(pickle.dumps(ball))
    one, two = ball.to_dict(), again.to_dict()
    assert one.keys() == two.keys()
    for name, value in one.items():
        np.testing.assert_equal(two[name], value)
    assert one["flagged"] == [{"run": 0, "time": 0.5, "channel": "ball", "reason": "0.3 m off"}]


@pytest.mark.parametrize("string", [True, False])
def test_the_pictures_are_drawn(string, tmp_path) -> None:
    pytest.importorskip("matplotlib")
    figure = made(string=string).plot()
    labels = {panel.get_ylabel() for panel in figure.axes}
    assert "x error [mm]" in labels
    assert ("distance from\nthe anchor [m]" in labels) == string
    assert "before 5.8 mm, after 1 mm" in figure.get_suptitle()
    assert "noise σ 1 mm" in figure.get_suptitle()
    figure.savefig(tmp_path / "ball.png")
    assert (tmp_path / "ball.png").stat().st_size > 10_000


def test_nan_columns_are_left_out() -> None:
    pytest.importorskip("matplotlib")
    ball = made()
    state = list(ball.__getstate__())
    state[6] = np.full((ROWS, 3), np.nan)
    without = _core.BallSeries.__new__(_core.BallSeries)
    without.__setstate__(tuple(state))
    figure = without.plot()
    assert "before" not in figure.get_suptitle()


def test_a_result_without_a_ball_says_so(arm, train) -> None:
    fit = diffnea.identify(arm, train)
    assert fit.ball is None
    with pytest.raises(ValueError, match="plot_ball: no ball was fitted"):
        fit.plot_ball()
