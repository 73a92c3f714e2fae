"""The data of the paper's experiment, four minutes of it, and the robot identified from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ._core import (
    Excitation,
    FitProgress,
    IdentifyResult,
    Model,
    ModelError,
    Recording,
    _identify_robot,
    _robot_motions,
)
from ._files import StrPath, load_model


@dataclass(frozen=True)
class RobotMotions:
    """What the robot executes before anything is learned."""

    arm: Excitation
    """Fast, all of the arm's limits; to record without a ball."""
    ball: Excitation
    """Slow, about the home posture: the ball swings, the string stays taut."""


def robot_motions(
    model: Model | StrPath,
    *,
    arm_seconds: float = 40.0,
    ball_seconds: float = 40.0,
    seed: int = 0,
) -> RobotMotions:
    """Design the two motions that ``diffnea experiment`` records, about the model's ``home``.

    Args:
        model: description, or its file or name; only its joints and limits are used.
        arm_seconds: of the fast motion [s], whole periods that cover it.
        ball_seconds: of the slow one [s].
        seed: of the search for both; the same one gives the same motions.

    Raises:
        ModelError: the model has no ``home`` posture.

    """
    if not isinstance(model, Model):
        model = load_model(model)
    home = model.to_dict().get("home")
    if home is None:
        raise ModelError(f"robot_motions: {model.name} has no `home` posture; write one into it")
    return RobotMotions(*_robot_motions(model, home, arm_seconds, ball_seconds, seed))


@dataclass(frozen=True)
class IdentifiedRobot:
    """A robot with a ball on a string, identified in two steps."""

    arm: IdentifyResult
    """Without the ball."""
    ball: IdentifyResult
    """String and attachment, on the arm that was identified."""
    model: Model
    """Both."""


def identify_robot(
    model: Model | StrPath,
    arm: Recording,
    ball: Recording,
    *,
    progress: Callable[[FitProgress], bool | None] | None = None,
) -> IdentifiedRobot:
    """Fit arm and ball one after the other, as ``diffnea experiment`` does.

    Args:
        model: nominal description, with the ball.
        arm: recording without a ball.
        ball: recording with it; its torques are not used: the joints' motion is an input.
        progress: as of :func:`identify`.

    Raises:
        DataError: a recording is not of the model's joints, or is too short to be fitted.

    """
    if not isinstance(model, Model):
        model = load_model(model)
    return IdentifiedRobot(*_identify_robot(model, arm, ball, progress))
