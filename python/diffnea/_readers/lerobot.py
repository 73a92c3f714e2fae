"""Data sets of LeRobot, version 2 and 3: Parquet files of episodes, and ``meta/info.json``.

``observation.state`` is q and ``action`` is qcmd, joint by joint as ``meta/info.json`` names them;
``episode_index`` is the run and ``timestamp`` the time. LeRobot computes that time from the number
of the frame, so that jitter and late transfers do not show in it. Its arms of hobby servos write
degrees, or per cent of each joint's calibrated range, and the file does not say which.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._core import DataError, FileError
from .packages import import_package
from .table import Selection, Table

if TYPE_CHECKING:
    import pandas as pd

EPISODE = "episode_index"
_VECTORS = {"observation.state": "q", "action": "qcmd"}
_BOOKKEEPING = ("frame_index", "index", "task_index", "next.done", "next.reward", "next.success")
#: Arms whose drivers write degrees, or per cent of the calibrated range.
_IN_DEGREES = ("so100", "so101", "so_follower", "koch", "moss", "omx", "lekiwi")


def is_data_set(path: Path) -> bool:
    """Tell whether a folder is a data set."""
    return (path / "meta" / "info.json").is_file()


def read(path: Path, selection: Selection) -> Table:
    """Read all episodes of a folder."""
    from .parquet import read_frame

    del selection
    files = sorted((path / "data").rglob("*.parquet"))
    if not files:
        raise DataError(f"{path}: is a LeRobot data set without a Parquet file in {path / 'data'}")
    pandas = import_package("pandas", f"{path}: reading a LeRobot data set", "parquet")
    frames = [read_frame(file) for file in files]
    return table_of_episodes(path, pandas.concat(frames, ignore_index=True), _load_info(path))


def find_info(path: Path) -> dict[str, Any]:
    """Return what ``meta/info.json`` above a file of a data set says; nothing without one."""
    for folder in path.resolve().parents[:3]:
        if is_data_set(folder):
            return _load_info(folder)
    return {}


def table_of_episodes(where: Path, frame: pd.DataFrame, info: dict[str, Any]) -> Table:
    """Make a table with a run for every episode."""
    pandas = import_package("pandas", f"{where}: reading a LeRobot data set", "parquet")
    if "timestamp" not in frame.columns:
        raise DataError(
            f"{where}: has {EPISODE} and no timestamp; columns: {', '.join(frame.columns)}"
        )
    order = [EPISODE] + [name for name in ("frame_index",) if name in frame.columns]
    frame = frame.sort_values(order, kind="stable")
    columns: dict[str, Any] = {
        "time": frame["timestamp"].to_numpy().astype(np.float64),
        "run": frame[EPISODE].to_numpy(),
    }
    notes = [
        f"{where}: LeRobot computes its time from the number of the frame"
        + (f" at {info['fps']} a second" if "fps" in info else "")
        + "; jitter does not show in it, nor that joints are read one after the other"
    ]
    vectors = {}
    for name in frame.columns:
        if name in (EPISODE, "timestamp", *_BOOKKEEPING):
            continue
        first = frame[name].iloc[0]
        if isinstance(first, np.ndarray | list):
            vectors[name] = np.stack(frame[name].to_numpy()).astype(np.float64)
        elif not isinstance(first, str):
            columns[name] = frame[name].to_numpy()
    if "frame_index" in frame.columns and len(frame) > 1:
        columns["time"] = _exact_time(columns["time"], frame["frame_index"].to_numpy(), info)
    names = {name: _names(info, name, values.shape[1]) for name, values in vectors.items()}
    unit, why = _unit(info, vectors, names)
    notes += why
    for name, values in vectors.items():
        for k in range(values.shape[1]):
            label = names[name][k]
            key = f"{name}.{label}"
            joint = label.removesuffix(".pos")
            if name in _VECTORS and unit is not None and not label.isdigit():
                if label.endswith((".vel", ".effort")) or _is_gripper(label, unit):
                    notes += _set_aside(key, label)
                else:
                    key = f"{_VECTORS[name]}_{joint}{unit}"
            columns[key] = values[:, k]
    table = pandas.DataFrame(columns)
    return Table(lambda path: table.to_csv(path, index=False), notes)


def _load_info(folder: Path) -> dict[str, Any]:
    path = folder / "meta" / "info.json"
    try:
        info = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read ({error})") from error
    if not isinstance(info, dict):
        raise FileError(f"{path}: expected an object")
    return info


def _exact_time(time: Any, frame: Any, info: dict[str, Any]) -> Any:
    """Undo the rounding of single precision where the time is frame over rate."""
    rate = info.get("fps")
    if not isinstance(rate, int | float) or rate <= 0:
        middle = float(np.median(np.diff(time)[np.diff(frame) == 1])) if len(time) > 2 else 0.0
        rate = round(1.0 / middle) if middle > 0 else 0
    exact = frame / rate if rate else time
    return exact if np.allclose(exact, time, rtol=1e-6, atol=1e-4) else time


def _names(info: dict[str, Any], vector: str, size: int) -> list[str]:
    """Names of a vector's entries; their numbers where the data set has none."""

    def flat(names: Any) -> Iterable[str]:
        if isinstance(names, str):
            yield names
        elif isinstance(names, dict):
            for value in names.values():
                yield from flat(value)
        elif isinstance(names, list):
            for value in names:
                yield from flat(value)

    features = info.get("features")
    feature = features.get(vector, {}) if isinstance(features, dict) else {}
    names = list(flat(feature.get("names"))) if isinstance(feature, dict) else []
    return names if len(names) == size else [str(k) for k in range(size)]


def _unit(
    info: dict[str, Any], vectors: dict[str, Any], names: dict[str, list[str]]
) -> tuple[str | None, list[str]]:
    """Return the unit of positions as a header has it; None if it, or whose they are, is open."""
    there = [name for name in _VECTORS if name in vectors]
    if not there:
        return None, []
    example = f"{there[0]}.{names[there[0]][0]}"
    if all(label.isdigit() for name in there for label in names[name]):
        # The last column is where a gripper stands, which is in per cent beside degrees, too.
        arm = [vectors[name][:, k] for name in there for k in range(len(names[name]) - 1)]
        full = any(abs(float(np.nanmax(np.abs(x))) - 100.0) < 1e-6 for x in arm)
        unit = "0.0175*rad+0.1" if full else "deg"
        note = (
            "whose columns they are is not said (there is no meta/info.json with names): "
            f'name them, e.g. --map "{example}=q_shoulder_pan [{unit}]"'
        )
        if full:
            note += (
                "; positions end at exactly 100: per cent of each joint's calibrated range, where "
                "a per cent is so many rad (here 0.0175) and 0 is at an angle (here 0.1 rad)"
            )
        return None, [note]
    arm = [
        vectors[name][:, k]
        for name in there
        for k, label in enumerate(names[name])
        if not _is_gripper(label, " [deg]")
    ]
    largest = max((float(np.nanmax(np.abs(x))) for x in arm), default=0.0)
    robot = str(info.get("robot_type", ""))
    hobby = any(word in robot.lower() for word in _IN_DEGREES)
    if largest <= 2 * np.pi and not hobby:
        return "", []
    if abs(largest - 100.0) < 1e-6:
        return None, [
            "positions end at exactly 100: per cent of each joint's calibrated range, of which the "
            'file does not say the angle; state it joint by joint, e.g. --map "'
            f'{example}=q_{names[there[0]][0].removesuffix(".pos")} [0.0175*rad+0.1]" where a per '
            "cent is 0.0175 rad and 0 is at 0.1 rad (range_min and range_max of the calibration, "
            "4096 counts a turn)"
        ]
    return " [deg]", [
        f"positions are taken as degrees (they reach {largest:.4g}"
        + (f", robot_type {robot}" if robot else "")
        + "); were they recorded in per cent of the calibrated range, name their law with --map"
    ]


def _is_gripper(label: str, unit: str) -> bool:
    """Per cent of its travel, where the arm is in degrees."""
    return unit == " [deg]" and "gripper" in label.lower()


def _set_aside(key: str, label: str) -> list[str]:
    if "gripper" not in label.lower() or not key.startswith("observation"):
        return []
    joint = label.removesuffix(".pos")
    return [
        f"{key} is in per cent of its travel, no angle, and is kept beside the joints; "
        f'--map "{key}=q_{joint} [0.0175*rad]" says what a per cent is'
    ]
