"""Hyper-parameters of a network's training."""

from __future__ import annotations

from dataclasses import dataclass

# Of the windows of the first stage, which end where rollouts begin to be asked for [s].
FIRST_HORIZON = 0.1


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

    def layers(self, kind: str) -> tuple[int, ...]:
        """Units of each layer of a network of this kind."""
        return tuple(self.hidden) or ((64, 64) if kind == "ff" else (32,))
