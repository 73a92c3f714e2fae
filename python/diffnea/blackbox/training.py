"""Training with PyTorch: first to accelerations, then through rollouts in the simulator's steps."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from .._core import Error, IdentifyResult, Model
from .._files import StrPath
from .data import (
    INPUTS,
    Series,
    Window,
    blocks,
    model_of,
    recordings_of,
    series_of,
    to_link,
    windows,
)
from .network import BallNetwork, FreeRun, names_of, run_windows

if TYPE_CHECKING:
    from torch import Tensor

    from .data import Array, Recordings

Progress: TypeAlias = Callable[[str, int, float], object]

# Scales that make a centimetre and a decimetre a second weigh the same in the loss.
_POSITION, _VELOCITY = 0.01, 0.1
# Of the windows of the first stage, which end where rollouts begin to be asked for [s].
_FIRST_HORIZON = 0.1
# Of the errors on what was held out that the file tells [s].
_TOLD = (0.1, 0.25, 0.5, 1.0, 1.5)


@dataclass(frozen=True)
class TrainOptions:
    """Hyper-parameters; the network's file states them."""

    hidden: tuple[int, ...] = ()
    """Units of each layer; empty: (64, 64) for ``ff``, (32,) for ``lstm``, whose last layer is
    linear."""
    step: float = 0.002
    """Of time, that of the simulated arm [s]."""
    warm_up: float = 0.1
    """For which an LSTM sees the true ball first [s]."""
    first_iterations: int = 800
    """On accelerations of the smoothed ball."""
    horizons: tuple[float, ...] = (0.1, 0.2, 0.4)
    """Of the rollouts, one stage each [s]."""
    iterations: int = 250
    """A stage, at most."""
    batch: int = 64
    """Windows an iteration."""
    learning_rate: float = 3e-3
    """Of Adam at first; it falls to a hundredth over a stage as a cosine, and a rollout's stage
    begins at a third."""
    weight_decay: float = 1e-6
    gradient_norm: float = 1.0
    """At which gradients are cut."""
    block: float = 4.0
    """Of time; every fifth is held out [s]."""
    check_every: int = 25
    """Iterations between two looks at what was held out."""
    patience: int = 10
    """Looks without a smaller error, after which a stage ends."""
    check_horizon: float = 0.5
    """Of the free runs that are looked at [s]."""


def train(
    kind: str,
    recordings: Recordings,
    model: Model | IdentifyResult | StrPath,
    *,
    ensemble: int = 1,
    seed: int = 0,
    options: TrainOptions | None = None,
    threads: int = 1,
    progress: bool | Progress = True,
) -> BallNetwork:
    """Train a network to move the ball as it was recorded.

    The network is fitted to accelerations of the smoothed ball first. That alone would do badly: a
    second derivative of camera data is noise and bias, and what is small in one step grows over
    many. So it is then trained through rollouts: from a smoothed state the ball runs free, in the
    steps that the simulator takes, and is held against the positions that the camera saw and
    smoothed velocities. Every fifth block of time is held out; the network that runs free best
    there is kept.

    Args:
        kind: ``ff``, layers with tanh, or ``lstm``.
        recordings: with arm and ball, or their files; those without a ball are passed over.
        model: whose kinematics tell where the link of the string is; nothing else of it is used,
            but for the figures of the string's length.
        ensemble: networks that differ in their first weights and batches; their mean is the answer.
        seed: of the first network; the others' follow.
        options: hyper-parameters.
        threads: of PyTorch.
        progress: ``True`` for a bar if tqdm is installed, or a function (stage, iteration, error
            on what is held out [m]); if it returns ``False``, the networks that are finished are
            returned, or of the first one what is best so far.

    Raises:
        Error: PyTorch is not installed, the recordings hold too little of a ball, an option is not
            possible, or no free run was ever finite.

    """
    torch = _import_torch()
    options = options or TrainOptions()
    if kind not in ("ff", "lstm"):
        raise Error(f"train: kind: got {kind!r}; choices: ff, lstm")
    if ensemble < 1:
        raise Error(f"train: ensemble: got {ensemble}, expected 1 or more")
    begin = time.monotonic()
    given = recordings_of(recordings)
    data = _Data(torch, series_of(given, model_of(model), options.step), kind, options)
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        fits = []
        with _bar(progress, ensemble * _iterations(options)) as report:
            for k in range(ensemble):
                fits.append(_Fit(torch, data, kind, options, seed + k, report))
                fits[-1].run()
                if fits[-1].stopped:
                    fits = fits[:-1] or fits  # half a network would spoil the mean of whole ones
                    break
    finally:
        torch.set_num_threads(before)
    document = {
        "schema": "diffnea/ball-network/1",
        "kind": kind,
        "step": options.step,
        "warm_up": data.warm * options.step,
        "input": {"mean": data.input_mean.tolist(), "scale": data.input_scale.tolist()},
        "output": {"mean": data.output_mean.tolist(), "scale": data.output_scale.tolist()},
        "members": [fit.net.document() for fit in fits],
    }
    run = run_windows(
        BallNetwork(document), data.series, data.held_out, data.told_seconds, every=0.5
    )
    document["training"] = {
        "options": asdict(options) | {"hidden": list(_hidden(kind, options))},
        "seed": seed,
        "recordings": names_of(given),
        "rows": sum(w.end - w.begin for w in data.train),
        "held_out_rows": sum(w.end - w.begin for w in data.held_out),
        "stages": [fit.stages for fit in fits],
        "held_out": _told(run),
        "torch": str(torch.__version__),
        "seconds": round(time.monotonic() - begin, 1),
    }
    return BallNetwork(document)


def _told(run: FreeRun) -> list[dict[str, float]]:
    return [run.at(t) for t in _TOLD if t <= run.time[-1] + 1e-9]


def _import_torch() -> Any:
    try:
        import torch
    except ImportError as error:
        raise Error(
            "blackbox.train needs PyTorch: pip install 'diffnea[blackbox]' (a network that was"
            " trained elsewhere needs nothing)"
        ) from error
    return torch


def _hidden(kind: str, options: TrainOptions) -> tuple[int, ...]:
    return tuple(options.hidden) or ((64, 64) if kind == "ff" else (32,))


def _iterations(options: TrainOptions) -> int:
    return options.first_iterations + len(options.horizons) * options.iterations


class _Data:
    """Series as tensors, one after the other, and which rows are for what."""

    def __init__(self, torch: Any, series: list[Series], kind: str, options: TrainOptions) -> None:
        self.series = series
        self.warm = round(options.warm_up / options.step) if kind == "lstm" else 0
        self.train, self.held_out = blocks(series, options.block)
        longest = max(_FIRST_HORIZON, *options.horizons, options.check_horizon)
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


def _module(torch: Any, data: _Data, kind: str, hidden: tuple[int, ...]) -> Any:
    """Return a network in PyTorch whose document C++ reads."""
    nn = torch.nn

    class Net(nn.Module):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            super().__init__()
            widths = [INPUTS, *hidden]
            self.cell: Any = None
            if kind == "lstm":
                if len(set(hidden)) != 1:
                    raise Error(f"train: hidden: got {hidden}, expected cells of one size")
                self.cell = nn.LSTM(INPUTS, hidden[0], len(hidden), batch_first=True)
                widths = [hidden[0]]
            self.layers = nn.ModuleList(
                nn.Linear(a, b) for a, b in zip(widths, [*widths[1:], 3], strict=True)
            )
            for name in ("input_mean", "input_scale", "output_mean", "output_scale"):
                value = torch.tensor(getattr(data, name), dtype=torch.float32)
                self.register_buffer(name, value)

        def sequence(self, inputs: Tensor) -> tuple[Tensor, Any]:
            """(B, T, 18) → standardised accelerations (B, T, 3), what the cells remember."""
            x, state = (inputs - self.input_mean) / self.input_scale, None
            if self.cell is not None:
                x, state = self.cell(x)
            return self.head(x), state

        def step(self, inputs: Tensor, state: Any) -> tuple[Tensor, Any]:
            """(B, 18) → accelerations in L (B, 3) [m/s²]."""
            x = (inputs - self.input_mean) / self.input_scale
            if self.cell is not None:
                out, state = self.cell(x[:, None], state)
                x = out[:, 0]
            return self.head(x) * self.output_scale + self.output_mean, state

        def head(self, x: Tensor) -> Tensor:
            for layer in self.layers[:-1]:
                x = torch.tanh(layer(x))
            return self.layers[-1](x)

        def document(self) -> dict[str, Any]:
            cells = []
            for k in range(self.cell.num_layers if self.cell is not None else 0):
                of = {n: getattr(self.cell, f"{n}_l{k}") for n in _LSTM_NAMES}
                cells.append(
                    _layer(
                        torch.cat([of["weight_ih"], of["weight_hh"]], dim=1),
                        of["bias_ih"].double() + of["bias_hh"].double(),
                    )
                )
            return {"cells": cells, "layers": [_layer(x.weight, x.bias) for x in self.layers]}

    return Net()


_LSTM_NAMES = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")


def _layer(weights: Tensor, bias: Tensor) -> dict[str, Any]:
    return {"weights": weights.detach().tolist(), "bias": bias.detach().tolist()}


class _Fit:
    """One network of the ensemble."""

    def __init__(
        self,
        torch: Any,
        data: _Data,
        kind: str,
        options: TrainOptions,
        seed: int,
        report: Progress,
    ) -> None:
        self.torch, self.data, self.options, self.report = torch, data, options, report
        self.rng = np.random.default_rng(seed)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.net = _module(torch, data, kind, _hidden(kind, options))
        rows = round(options.check_horizon / options.step)
        every = windows(data.held_out, data.warm + rows, rows // 4)
        picked = self.rng.permutation(len(every))[:64]
        self.check = data.batch(torch, [every[k] for k in picked])
        self.best: dict[str, Tensor] | None = None
        self.best_error = math.inf
        self.stages: list[dict[str, Any]] = []
        self.stopped = False

    def run(self) -> None:
        o = self.options
        rows = self.data.warm + round(_FIRST_HORIZON / o.step)
        self._stage("accelerations", o.first_iterations, o.learning_rate, rows, self._imitate)
        for horizon in o.horizons:
            rows = self.data.warm + round(horizon / o.step)
            name = f"rollouts of {horizon:g} s"
            self._stage(name, o.iterations, o.learning_rate / 3, rows, self._roll)
        if self.best is None:
            raise Error(
                "train: the network's ball was never finite on what was held out; try a smaller"
                f" learning_rate than {o.learning_rate:g}, or more first_iterations than"
                f" {o.first_iterations}"
            )
        self.net.load_state_dict(self.best)

    def _stage(
        self, name: str, most: int, rate: float, rows: int, loss: Callable[[Any], Any]
    ) -> None:
        if self.stopped:
            return
        torch, o = self.torch, self.options
        choice = windows(self.data.train, rows, max(1, rows // 10))
        adam = torch.optim.AdamW(self.net.parameters(), lr=rate, weight_decay=o.weight_decay)
        falling = torch.optim.lr_scheduler.CosineAnnealingLR(adam, most, rate / 100)
        if self.best is not None:
            self.net.load_state_dict(self.best)
        patience, smallest, k = 0, math.inf, 0
        for k in range(1, most + 1):
            picked = self.rng.integers(len(choice), size=o.batch)
            adam.zero_grad()
            now = loss(self.data.batch(torch, [choice[i] for i in picked]))
            now.backward()
            torch.nn.utils.clip_grad_norm_(self.net.parameters(), o.gradient_norm)
            adam.step()
            falling.step()
            if k % o.check_every and k < most:
                continue
            error = self._error()
            if error < self.best_error:
                self.best_error = error
                self.best = {n: x.clone() for n, x in self.net.state_dict().items()}
            patience = 0 if error < smallest else patience + 1
            smallest = min(smallest, error)
            if self.report(name, k, error) is False:
                self.stopped = True
            if self.stopped or patience >= o.patience:
                break
        # The file is JSON, which has no infinity: of a stage that was never finite there is none.
        told = smallest if math.isfinite(smallest) else None
        self.stages.append({"stage": name, "iterations": k, "held_out_error": told})

    def _imitate(self, rows: Tensor) -> Tensor:
        """Accelerations, with the true ball before the network at every step."""
        of = self.data.tensors
        out, _ = self.net.sequence(of["inputs"][rows])
        off = out - of["outputs"][rows]
        return (off[:, self.data.warm :] ** 2).mean()

    def _roll(self, rows: Tensor) -> Tensor:
        """Positions that the camera saw and smoothed velocities, the ball running free."""
        torch, of = self.torch, self.data.tensors
        x, v = self._free(rows)
        then = rows[:, self.data.warm :]
        off = (x - of["seen"][then]) / _POSITION
        seen = torch.isfinite(off)
        position = torch.where(seen, off, torch.zeros_like(off)).pow(2).sum()
        position = position / seen.sum().clamp(min=1)
        velocity = ((v - of["ball_velocity"][then]) / _VELOCITY).pow(2).mean()
        return position + velocity

    def _error(self) -> float:
        """Root mean square of the ball's position on what was held out [m]."""
        torch, of = self.torch, self.data.tensors
        with torch.no_grad():
            x, _ = self._free(self.check)
            seen = of["seen"][self.check[:, self.data.warm :]]
            error = float((x - seen)[torch.isfinite(seen)].pow(2).mean().sqrt())
        return error * math.sqrt(3.0) if math.isfinite(error) else math.inf

    def _free(self, rows: Tensor) -> tuple[Tensor, Tensor]:
        """Positions and velocities from the row after the warm-up on, (B, T, 3)."""
        torch, of, h, warm = self.torch, self.data.tensors, self.options.step, self.data.warm
        state = None
        if warm:
            _, state = self.net.sequence(of["inputs"][rows[:, :warm]])
        free = rows[:, warm:]
        rotation, link = of["rotation"][free], of["link"][free]
        position, velocity = of["position"][free], of["velocity"][free]
        x, v = of["ball"][free[:, 0]], of["ball_velocity"][free[:, 0]]
        xs, vs = [x], [v]
        for k in range(free.shape[1] - 1):
            R = rotation[:, k]  # noqa: N806
            relative = torch.stack([x - position[:, k], v - velocity[:, k]], dim=1) @ R
            inputs = torch.cat([relative.flatten(1), link[:, k]], dim=1)
            a, state = self.net.step(inputs, state)
            v = v + h * (R @ a[:, :, None])[:, :, 0]
            x = x + h * v
            xs.append(x)
            vs.append(v)
        return torch.stack(xs, dim=1), torch.stack(vs, dim=1)


class _bar:  # noqa: N801
    """What is called after every look at what was held out."""

    def __init__(self, progress: bool | Progress, iterations: int) -> None:
        self.progress, self.iterations, self.bar = progress, iterations, None

    def __enter__(self) -> Progress:
        if callable(self.progress):
            return self.progress
        try:
            if not self.progress:
                raise ImportError
            from tqdm.auto import tqdm
        except ImportError:
            return lambda stage, iteration, error: None
        bar = self.bar = tqdm(total=self.iterations, desc="training", unit="iteration")

        stages: dict[str, int] = {}  # of one network after the other

        def show(stage: str, iteration: int, error: float) -> None:
            before = stages.get(stage, 0)
            bar.update(iteration - before if iteration > before else iteration)
            stages[stage] = iteration
            bar.set_postfix_str(f"{stage} {iteration}: {1e3 * error:.1f} mm")

        return show

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()
