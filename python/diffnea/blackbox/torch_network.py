"""A network in PyTorch whose document C++ reads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .._core import Error
from .data import INPUTS
from .tensors import TrainingData

if TYPE_CHECKING:
    from torch import Tensor

_LSTM_NAMES = ("weight_ih", "weight_hh", "bias_ih", "bias_hh")


def torch_network(torch: Any, data: TrainingData, kind: str, hidden: tuple[int, ...]) -> Any:
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


def _layer(weights: Tensor, bias: Tensor) -> dict[str, Any]:
    return {"weights": weights.detach().tolist(), "bias": bias.detach().tolist()}
