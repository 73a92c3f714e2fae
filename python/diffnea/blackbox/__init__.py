"""Black-box baselines: networks that are trained to move the ball.

The ball's acceleration as a function of the last link's full motion and the ball's,
``ẍ_B = f(x_L, ẋ_L, ẍ_L, x_B, ẋ_B)``, by a feed-forward network or an LSTM. Training needs PyTorch
(extra ``blackbox``); a network that was trained needs nothing: C++ evaluates it.
"""

from .network import BallNetwork, FreeRun, free_run
from .options import TrainOptions
from .training import train

__all__ = ["BallNetwork", "FreeRun", "TrainOptions", "free_run", "train"]
