"""Recorded series as tensors for PyTorch, and which rows are for what."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .._core import Error
from .data import Series, Window, blocks, to_link, windows
from .options import FIRST_HORIZON, TrainOptions

if TYPE_CHECKING:
    from .data import Array


class TrainingData:
    """Series as tensors, one after the other, and which rows are for what."""

    def __init__(self, torch: Any, series: list[Series], kind: str, options: TrainOptions) -> None:
        self.series = series
        self.warm = round(options.warm_up / options.step) if kind == "lstm" else 0
        self.train, self.held_out = blocks(series, options.block)
        longest = max(FIRST_HORIZON, *options.horizons, options.check_horizon)
        longest += self.warm * options.step
        for what, within in (("train on", self.train), ("hold out", self.held_out)):
            rows = round(longest / options.step)
            if not windows(within, rows, rows):
                raise Error(
                    f"train: the recordings hold no block of {longest:.3g} s of arm and ball to"
                    f" {what}; every fifth of {options.block:.3g} s is held out: record longer"
                )
        most = max(w.end - w.begin for w in self.held_out) * options.step
        self.told_seconds = min(1.6, most - self.warm * options.step)
        self.offset = np.cumsum([0] + [len(x) for x in series])

        def column(name: str) -> Array:
            return np.concatenate([getattr(x, name) for x in series])

        link = np.concatenate([x.link_inputs() for x in series])
        rotation = column("rotation")
        relative = [
            to_link(rotation, column("ball") - column("position")),
            to_link(rotation, column("ball_velocity") - column("velocity")),
        ]
        inputs = np.concatenate([*relative, link], axis=1)
        outputs = to_link(rotation, column("ball_acceleration"))
        own = np.concatenate([self._rows(w) for w in self.train])
        self.input_mean = inputs[own].mean(axis=0)
        # What hardly varies in the recordings would be blown up elsewhere.
        self.input_scale = np.maximum(inputs[own].std(axis=0), 1e-3)
        self.output_mean = outputs[own].mean(axis=0)
        self.output_scale = np.maximum(outputs[own].std(axis=0), 1e-3)
        for what, within in (("train on", self.train), ("hold out", self.held_out)):
            if not any(np.isfinite(series[w.series].seen[w.begin : w.end]).any() for w in within):
                raise Error(
                    f"train: to {what}, no row of the camera is on the grid of"
                    f" {1e3 * options.step:g} ms from the recording's first row, where positions"
                    " are compared: choose another step, or resample"
                )
        arrays = {
            "link": link,
            "rotation": rotation,
            "inputs": inputs,
            "outputs": (outputs - self.output_mean) / self.output_scale,
        }
        for name in ("position", "velocity", "ball", "ball_velocity", "seen"):
            arrays[name] = column(name)
        self.tensors = {k: torch.tensor(x, dtype=torch.float32) for k, x in arrays.items()}

    def _rows(self, window: Window) -> Any:
        return self.offset[window.series] + np.arange(window.begin, window.end)

    def batch(self, torch: Any, chosen: Sequence[Window]) -> Any:
        """Rows of windows, (windows, rows)."""
        return torch.as_tensor(np.stack([self._rows(w) for w in chosen]))
