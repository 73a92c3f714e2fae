"""Drawings of the report's page (src/report/*.js): whole, and true to the numbers."""

import json
import math
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli import ROOT, done
from drawings import Places, classes, draw, evaluate


def numbers(x: Any) -> list[float]:
    return [float(v) for v in x]


def swinging(windows: int = 6, rows: int = 200, dt: float = 0.005) -> dict[str, Any]:
    """A ball on a taut string of 0.41 m, and a model whose string is 10 mm shorter.

    The camera has 1 mm of noise along each axis; each window is a recording of its own.
    """
    rng = np.random.default_rng(5)
    t = np.tile(np.arange(rows) * dt, windows)
    window = np.repeat(np.arange(windows), rows)
    phase, tilt = 5.0 * t + window, 0.6 * (0.6 + 0.4 * np.sin(3.0 * t + window))
    u = np.array([np.sin(tilt) * np.cos(phase), np.sin(tilt) * np.sin(phase), -np.cos(tilt)])
    hand = np.array([0.1 * np.sin(0.7 * t), 0.05 * np.cos(0.9 * t), np.ones_like(t)])

    def path(points: np.ndarray) -> dict[str, list[float]]:
        return dict(zip("xyz", (numbers(p) for p in points), strict=True))

    ball = {
        **{"run": window.tolist(), "window": window.tolist(), "time": numbers(t)},
        **{"taut": [True] * t.size, "anchor": path(hand)},
        **{"extended": path(hand + 0.41 * u), "base": path(hand + 0.40 * u)},
        "measured": path(hand + 0.41 * u + 1e-3 * rng.standard_normal(u.shape)),
    }
    summary = {"length": 0.41, "sigma": 1e-3, "flagged": [{"run": 1, "time": 0.5}]}
    return {"result": {"ball": summary}, "series": {"ball": ball}}


NAMES = {"before": "base", "after": "extended"}


def moving(rows: int = 101) -> dict[str, Any]:
    """A movement: the hand is still, the ball swings, flies over the rim and falls in."""
    s = np.linspace(0.0, 1.0, rows)
    angle = np.minimum(2.5 * s, 1.0)
    swing = 0.4 * np.array([np.sin(angle), -np.cos(angle)])
    flies = [0.4, 0.7, 0.85]
    across, up = (
        np.interp(s, flies, [swing[0, -1], 0.0, 0.0]),
        np.interp(s, flies, [swing[1, -1], 0.3, 0.02]),
    )
    ball = np.where(s < 0.4, swing, [across, up])
    figure = {
        name: {"across": [x] * rows, "up": [y] * rows}
        for name, (x, y) in {
            **{"arm_0": (-0.5, 0.0), "arm_1": (-0.2, 0.3), "arm_2": (0.0, 0.0)},
            **{"knot": (0.0, 0.0), "rim_left": (-0.05, 0.06), "floor_left": (-0.04, 0.0)},
            **{"floor_right": (0.04, 0.0), "rim_right": (0.05, 0.06)},
        }.items()
    }
    figure["ball"] = {"across": numbers(ball[0]), "up": numbers(ball[1])}
    channels = {"ball_x": numbers(ball[0]), "ball_y": [0.0] * rows, "ball_z": numbers(ball[1])}
    channels |= {f"cup_{axis}": [0.0] * rows for axis in "xyz"}
    return {"time": numbers(s), "figure": figure, "channels": channels}


def test_every_place_of_a_fits_page_is_drawn(run: Path) -> None:
    places = Places((run / "report.html").read_text(encoding="utf-8"))
    drawn = places.drawn()
    # Two joints, held out and training: torque and error over time, error over velocity.
    counts = Counter(kind for kind, _ in drawn)
    assert (counts["time"], counts["velocity"]) == (8, 4)
    assert counts["estimate"] >= 4
    for kind, drawing in drawn:
        if kind == "velocity":
            assert len(classes(drawing, "circle")) > 10
    lines = [sorted(classes(drawing, "path")) for kind, drawing in drawn if kind == "time"]
    assert lines.count(["fitted", "measured", "nominal"]) == 4
    assert lines.count(["fitted"]) == 4


def test_every_place_of_a_diagnosis_page_is_drawn(tmp_path: Path) -> None:
    """An old one, with a ball and what a later one learned without a name."""
    run = tmp_path / "run"
    shutil.copytree(ROOT / "tests/data/old/diagnose", run)
    ball = swinging()
    box = {"where": "hinge", "variables": ["q_hinge"]}
    curve = {"model": "base", "mean": [1.0, 2.0], "low": [0.0, 1.0], "high": [2.0, 3.0]}
    plot = {"kind": "velocity", "joint": "hinge", "effect": None, "mark": None, "x": [0.0, 1.0]}
    plot |= {"x_name": "velocity", "x_unit": "rad/s", "y_name": "error", "y_unit": "N*m"}
    motion = {"joint": "hinge", "unit": "rad"}
    of_motion = {"noise": 1e-4, "tolerance": 0.07, "rmse_base": 0.1, "rmse_extended": 0.05}
    of_motion |= {"follows": {"base": 0.1, "extended": 0.2}}
    horizons = [
        {"horizon": t, "windows": 1, "apart": {"base": 0, "extended": 0}}
        | {"base": t / 0.14, "extended": t / 0.28}
        | {"base_rmse": [0.5 * t], "extended_rmse": [0.25 * t]}
        for t in (0.1, 0.2)
    ]
    rows = {"time": [0.0, 0.1, 0.2], "measured": [0.0, 1.0, 2.0], "base": [0.0, 1.0, None]}
    flag = {"run": 1, "time": 0.5, "channel": "ball", "reason": "off"}
    extra: dict[str, dict[str, Any]] = {
        "result.json": {
            "ball": ball["result"]["ball"]
            | {"held_out": True, "has_string": True, "base_rms": 0.006, "extended_rms": 0.001}
            | {"flagged": [flag]},
            "grey_box": [
                {**box, "unit": "N*m", "bumps": 9, "effective_parameters": 5.0, "bound": 1.0}
                | {"torque_rms": 0.5, "before": 1.0, "after": 0.5}
            ],
            "simulated": {"follows": {"base": 0.1, "extended": 0.2}, "window": 0.2, "reason": None}
            | {"apart": [], "horizons": horizons, "joints": [motion | of_motion]},
        },
        "series.json": {
            "ball": ball["series"]["ball"],
            "grey_box": [
                {**box, "units": ["rad"], "at": [[0.0, 1.0]], "torque": [1.0, 2.0]}
                | {"std": [0.1, 0.1]}
            ],
            "simulated": [{**motion, **rows, "extended": [0.0, 1.0, None]}],
            "plots": [{**plot, "curves": [curve]}],
        },
    }
    for name, keys in extra.items():
        file = run / name
        file.write_text(json.dumps(json.loads(file.read_text()) | keys))
    done("report", run)
    drawn = Places((run / "report.html").read_text(encoding="utf-8")).drawn()
    # The joint's torque and motion, the string's length with its error, errors along x, y, z.
    assert Counter(kind for kind, _ in drawn) == {
        **{"time": 2 + 2 + 2 + 3, "space": 1, "sphere": 1, "evidence": 1, "greyBox": 1},
        **{"bars": 2, "follows": 1},
    }
    said = {kind: [text.text or "" for text in drawing.iter("text")] for kind, drawing in drawn}
    assert "learned [N·m]" in said["greyBox"]
    assert "noise floor" in said["bars"]
    assert {"horizon [s]", "error [mrad]"} <= set(said["follows"])


def test_recordings_follow_each_other_with_gaps() -> None:
    time = [0.0, 0.1, 0.2, 0.5, 0.6, 0.0, 0.1]  # two rows are missing, then a second recording
    s = {"joint": "a", "unit": "N*m", "time": time, "measured": [1.0] * 7, "fitted": [3.0] * 7}
    page = {"result": {}, "series": {"test": [{**s, "nominal": [0.0] * 7}]}}
    place = {"set": "test", "joint": 0, "part": "error", **NAMES}
    chart = evaluate(f"Draw.timeChart({place}, {page})")
    assert chart["lines"] == [
        {"css": "fitted", "name": "extended", "y": [2, 2, 2, None, 2, 2, None, 2, 2]}
    ]
    assert all(a < b for a, b in zip(chart["time"], chart["time"][1:], strict=False))
    both = evaluate(f"Draw.timeChart({ {**place, 'both': ''} }, {page})")
    assert [line["y"][0] for line in both["lines"]] == [1, -2]


def test_a_zoom_ends_on_its_borders() -> None:
    chart = {"time": [0, 1, 2, 3], "lines": [{"css": "fitted", "y": [0, 1, 2, 3]}], "unit": "m"}
    text = evaluate(f"Draw.overTime({chart}, [160, 132], [0.5, 2.5])")
    # 100 pixels of x and of y; y has a margin of 5 % of what is seen to either side.
    low, high = 0.5 - 0.1, 2.5 + 0.1
    ends = [108 - 100 * (y - low) / (high - low) for y in (0.5, 2.5)]
    first, last = f"M52.0 {ends[0]:.1f}", f"L152.0 {ends[1]:.1f}"
    assert first in text
    assert last in text


def test_windows_stand_side_by_side() -> None:
    none = float("nan")
    s = {"joint": "a", "unit": "rad", "time": [5.0, 5.1, 5.2, 9.0, 9.1, 9.2], "measured": [1] * 6}
    s |= {"base": [1, 1, none, 1, 1, none], "extended": [1, 1, none, 1, 1, none]}
    text = str({"result": {"simulated": {"window": 0.2}}, "series": {"simulated": [s]}})
    place = {"set": "simulated", "joint": 0, "part": "value", **NAMES}
    time = evaluate(f"Draw.timeChart({place}, {text.replace('nan', 'null')})")["time"]
    # A gap of 5 % of a window and a step.
    assert time == pytest.approx([0.0, 0.1, 0.2, 0.255, 0.31, 0.41, 0.51])


def test_means_in_bins_are_numpys() -> None:
    rng = np.random.default_rng(3)
    velocity, error = np.sin(np.arange(2400) * 0.05) + 1e-3 * rng.random(2400), rng.random(2400)
    s = {"unit": "N*m", "velocity": numbers(velocity), "fitted": numbers(error)}
    page = {"result": {}, "series": {"test": [{**s, "measured": [0.0] * 2400}]}}
    drawing = draw("velocity", {"set": "test", "joint": 0}, page)
    edges = np.sort(velocity)[99::100]
    bins = np.searchsorted(edges, velocity)
    means = [error[bins == b].mean() for b in range(24)]
    drawn = [float(c.get("cy", "nan")) for c in drawing.iter("circle")]
    # A straight line from values to pixels, which are rounded to a tenth.
    slope, offset = np.polyfit(means, drawn, 1)
    assert slope < 0
    assert np.abs(np.polyval([slope, offset], means) - drawn).max() < 0.2
    assert len(classes(drawing, "line")) > 24 + 1  # intervals, the model, the grid


def test_a_ball_has_all_its_pictures() -> None:
    page = swinging()
    space = draw("space", {"windows": "4"}, page)
    assert classes(space, "path") == ["anchor", "measured", "nominal", "fitted"] * 3  # views
    one = draw("space", {"windows": "4", "one": ""}, page)
    assert classes(one, "path") == ["anchor", "measured", "fitted"] * 3
    length = draw("time", {"set": "ball", "joint": "length", "part": "value", **NAMES}, page)
    assert set(classes(length, "rect")) == {"span"}
    assert classes(length, "line").count("level") == classes(length, "line").count("flag") == 1
    for axis in ("length", "x", "y", "z"):
        error = draw("time", {"set": "ball", "joint": axis, "part": "error", **NAMES}, page)
        assert classes(error, "rect") == ["noise"]
        assert classes(error, "path") == ["nominal", "fitted"]


def test_a_ball_of_which_little_is_known() -> None:
    page = swinging(windows=1, rows=1)
    nothing = {axis: [None] for axis in "xyz"}
    nowhere = dict.fromkeys(("measured", "base", "extended", "anchor"), nothing)
    unknown = {"length": None, "sigma": None, "flagged": []}
    for ball in (page["series"]["ball"], page["series"]["ball"] | nowhere):
        few = {"result": {"ball": unknown}, "series": {"ball": ball}}
        assert len(classes(draw("space", {"windows": "4"}, few), "path")) == 4 * 3
        for axis, part in (("length", "value"), ("length", "error"), ("x", "error")):
            place = {"set": "ball", "joint": axis, "part": part, **NAMES}
            chart = draw("time", place, few)
            assert "noise" not in classes(chart, "rect")
            assert "level" not in classes(chart, "line")


def test_the_sphere_shows_a_string_that_is_too_short_as_an_error_along_it() -> None:
    drawing = draw("sphere", NAMES, swinging())
    said = [text.text or "" for text in drawing.iter("text")]
    # 10 mm along the string, noise of 1 mm along it and of √2 mm across it.
    base, extended = (words for words in said if words.startswith("rms along the string"))
    assert "string 10" in base or "string 9.9" in base
    along, across = (float(extended.split(of)[1].split()[0]) for of in ("string ", "across it "))
    assert along == pytest.approx(1.0, rel=0.1)
    assert across == pytest.approx(math.sqrt(2.0), rel=0.1)


def test_many_short_flights_stand_side_by_side() -> None:
    place = {"set": "ball", "joint": "x", "part": "error", **NAMES}
    chart = evaluate(f"Draw.timeChart({place}, {json.dumps(swinging(windows=100, rows=60))})")
    # 0.295 s of each, and 0.2 s between any two.
    assert chart["time"][-1] == pytest.approx(100 * 0.295 + 99 * 0.2)


def test_movements_are_told_from_start_to_end() -> None:
    page = {"result": {}, "series": {"imagined": [moving()], "obtained": [moving()]}}
    place = {"movement": "obtained", "index": "0", "string": "0.4", "ghost": ""}
    strip = draw("strip", place, page)
    assert classes(strip, "rect") == ["frame"] * 8
    assert classes(strip, "circle") == ["ghost", "ball"] * 8
    said = [text.text or "" for text in strip.iter("text")]
    times = [float(words.split()[0]) for words in said]
    assert times == sorted(set(times))
    assert said[0] == "0.00 s · start"
    assert said[-1] == "1.00 s · end"
    assert any("over the rim" in words for words in said)
    assert any("string slack" in words for words in said)
    player = draw("player", place, page)
    assert classes(player, "path") == ["imagined", "obtained", "arm", "cup", "string"]
    assert classes(draw("distance", {"index": "0"}, page), "path") == ["imagined", "fitted"]


def test_searches_and_executions() -> None:
    curves = [{"reward_mean": [1.0, 2.0, 4.0]}, {"reward_mean": [0.0, 3.0]}]
    page: dict[str, Any] = {"result": {"policies": [{"curve": c} for c in curves]}, "series": {}}
    place = {"key": "reward_mean", "unit": "reward", "best": "1", "bound": "0.5"}
    assert classes(draw("curve", place, page), "path") == ["seed", "fitted", "bound"]
    reward = [(1.0, 2.0, True), (2.0, 0.5, False), (None, None, False)]
    executed = [{"expected": e, "reward": r, "success": s} for e, r, s in reward]
    drawing = draw("scatter", {}, {"result": {"policies": executed}, "series": {}})
    assert classes(drawing, "circle") == ["caught", "lost"]


def test_evidence_and_what_is_learned_without_a_name() -> None:
    curve = {"mean": [1.0, 2.0, 3.0], "low": [0.0, 1.0, None], "high": [2.0, 3.0, None]}
    plot = {"x": [0.0, 1.0, 2.0], "x_name": "velocity", "x_unit": "rad/s", "y_name": "error"}
    plot |= {"y_unit": "N*m", "mark": 0.5}
    curves = [{"model": m, **curve} for m in ("base", "extended")]
    box: dict[str, Any] = {"variables": ["q_a"], "units": ["rad"], "at": [[0.0, 1.0]]}
    box |= {"torque": [1.0, -2.0], "std": [0.1, 0.1]}
    map_ = {**box, "variables": ["q_a", "q_b"], "units": ["rad", "rad"], "at": [[0.0, 1.0]] * 2}
    map_ |= {"torque": [1.0, -2.0, 0.0, 0.5], "std": [0.1] * 4}
    series = {"plots": [{**plot, "curves": curves}], "grey_box": [box, map_]}
    page = {"result": {"grey_box": [{"unit": "N*m"}] * 2}, "series": series}
    evidence = draw("evidence", {"index": "0"}, page)
    for tag in ("polygon", "path"):
        assert classes(evidence, tag) == ["nominal", "fitted"]
    assert classes(evidence, "line").count("mark") == 1
    assert "velocity [rad/s]" in [text.text for text in evidence.iter("text")]
    line, surface = (draw("greyBox", {"index": index}, page) for index in "01")
    assert classes(line, "polygon") == ["fitted"]
    assert "learned [N·m]" in [text.text for text in line.iter("text")]
    assert "N·m" in [text.text for text in surface.iter("text")]
    cells = surface.findall("rect")
    assert len(cells) == 4 + 21  # and the scale
    assert cells[1].get("style") == "fill:rgb(0,114,178)"  # the most negative one


def test_bars_have_a_scale_and_escaped_words() -> None:
    row = {"css": "cause", "label": "a<b", "text": "12"}
    rows = [{**row, "from": 0.0, "to": 100.0}, {**row, "from": 0.0, "to": 1000.0}]
    for knee, ratio in (("", 0.1), ("10", math.asinh(10.0) / math.asinh(100.0))):
        drawing = draw("bars", {"knee": knee, "rows": rows}, {})
        widths = [float(bar.get("width", "nan")) for bar in drawing.iter("rect")]
        assert widths[0] / widths[1] == pytest.approx(ratio, rel=1e-2)
        assert [text.text for text in drawing.iter("text")].count("a<b") == 2
