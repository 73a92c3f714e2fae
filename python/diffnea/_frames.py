"""Data frames with the columns of the files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._files import import_pandas
from ._readers.table import OF_AXES

if TYPE_CHECKING:
    import pandas as pd

    from ._core import Recording, Trajectory


def recording_frame(recording: Recording) -> pd.DataFrame:
    """Implement :meth:`Recording.to_frame`."""
    pandas = import_pandas("Recording.to_frame")
    columns: dict[str, Any] = {"time": recording.time}
    q, tau = recording.q, recording.tau
    series = {key: getattr(recording, key) for key in ("qd", "qdd", "qcmd", "qdcmd", "taucmd")}
    for j, joint in enumerate(recording.joint_names):
        columns[f"q_{joint}"] = q[:, j]
        for name, values in series.items():
            if values is not None:
                columns[f"{name}_{joint}"] = values[:, j]
        if recording.has_tau[j]:
            columns[f"tau_{joint}"] = tau[:, j]
    for name, (prefix, axes) in OF_AXES.items():
        values = getattr(recording, name)
        if values is not None:
            columns |= {f"{prefix}_{axis}": values[:, k] for k, axis in enumerate(axes)}
    columns |= recording.extra
    frame: pd.DataFrame = pandas.DataFrame(columns)
    return frame


def trajectory_frame(trajectory: Trajectory) -> pd.DataFrame:
    """Implement :meth:`Trajectory.to_frame`."""
    pandas = import_pandas("Trajectory.to_frame")
    columns: dict[str, Any] = {"time": trajectory.time}
    series = {"qcmd": trajectory.q, "qdcmd": trajectory.qd, "qddcmd": trajectory.qdd}
    for name, values in series.items():
        columns |= {
            f"{name}_{joint}": values[:, j] for j, joint in enumerate(trajectory.joint_names)
        }
    frame: pd.DataFrame = pandas.DataFrame(columns)
    return frame
