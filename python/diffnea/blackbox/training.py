"""Training with PyTorch: first to accelerations, then through rollouts in the simulator's steps."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from .._core import Error, IdentifyResult, Model
from .._files import StrPath
from .._readers.packages import install_command
from .data import model_of, recordings_of, series_of, windows
from .network import BallNetwork, FreeRun, names_of, run_windows
from .options import FIRST_HORIZON, TrainOptions
from .tensors import TrainingData
from .torch_network import torch_network

if TYPE_CHECKING:
    from torch import Tensor

    from .data import Recordings

Progress: TypeAlias = Callable[[str, int, float], object]

# Scales that make a centimetre and a decimetre a second weigh the same in the loss.
_POSITION, _VELOCITY = 0.01, 0.1
# Of the errors on what was held out that the file tells [s].
_TOLD = (0.1, 0.25, 0.5, 1.0, 1.5)


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
    data = TrainingData(torch, series_of(given, model_of(model), options.step), kind, options)
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
        "options": asdict(options) | {"hidden": list(options.layers(kind))},
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
            f"blackbox.train needs PyTorch: {install_command('blackbox')} (a network that was"
            " trained elsewhere needs nothing)"
        ) from error
    return torch


def _iterations(options: TrainOptions) -> int:
    return options.first_iterations + len(options.horizons) * options.iterations


class _Fit:
    """One network of the ensemble."""

    def __init__(
        self,
        torch: Any,
        data: TrainingData,
        kind: str,
        options: TrainOptions,
        seed: int,
        report: Progress,
    ) -> None:
        self.torch, self.data, self.options, self.report = torch, data, options, report
        self.rng = np.random.default_rng(seed)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.net = torch_network(torch, data, kind, options.layers(kind))
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
        rows = self.data.warm + round(FIRST_HORIZON / o.step)
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
