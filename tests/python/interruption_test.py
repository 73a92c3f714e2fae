"""What is told to stop stops: Ctrl-C, an exception or ``False`` from ``progress``."""

import signal

import numpy as np
import pytest

import diffnea

MODEL = "wam4_ball_in_cup"


class MistakeError(Exception):
    """Of the caller's own function."""


@pytest.fixture(scope="module")
def robot() -> tuple[diffnea.Model, diffnea.Recording, diffnea.Recording]:
    """Description, a recording of the arm, one of the ball: five seconds each."""
    model = diffnea.load_model(MODEL)
    recordings = []
    for seed, ball in enumerate(("none", "tendon"), start=1):
        motion = diffnea.excite(model, duration=5.0, seed=seed, velocity_share=0.3)
        world = f"mujoco:{MODEL},perturb=A,seed=1,ball={ball}"
        recordings.append(diffnea.simulate(model, motion, world=world).recording)
    return model, *recordings


@pytest.mark.parametrize("test", [False, True])
def test_who_said_stop_is_not_asked_again(arm, train, held_out, test) -> None:
    asked = []

    def progress(p: diffnea.FitProgress) -> bool:
        asked.append(p.stage)
        return False

    result = diffnea.identify(
        arm, train, test=held_out if test else None, robust="cauchy", progress=progress
    )
    assert result.summary.interrupted
    assert asked == ["reading"]


def test_an_exception_is_the_last_that_progress_does(arm, train, held_out) -> None:
    asked = []

    def progress(p: diffnea.FitProgress) -> None:
        asked.append(p.stage)
        raise MistakeError

    for work in (diffnea.identify, diffnea.diagnose):
        asked.clear()
        with pytest.raises(MistakeError):
            work(arm, train, test=held_out, progress=progress)
        assert len(asked) == 1


def test_no_ball_is_fitted_to_an_arm_whose_fit_was_stopped(robot) -> None:
    asked = []

    def progress(p: diffnea.FitProgress) -> bool:
        asked.append(p.stage)
        return False

    found = diffnea.identify_robot(*robot, progress=progress)
    assert found.arm.summary.interrupted
    assert found.ball.summary.interrupted
    assert len(found.ball.parameters) == 0
    assert found.model.to_dict()["ball"] == robot[0].to_dict()["ball"]
    assert len(asked) == 1


def test_a_mistake_comes_through_where_nothing_can_be_fitted(robot) -> None:
    """The arm rests, which is not what went wrong."""
    model, arm, ball = robot
    still = diffnea.Recording(
        time=arm.time, q=np.zeros_like(arm.q), tau=np.ones_like(arm.q), joint_names=arm.joint_names
    )
    with pytest.raises(diffnea.DataError, match="no joint moves"):
        diffnea.identify_robot(model, still, ball)

    def progress(p: diffnea.FitProgress) -> None:
        raise MistakeError

    with pytest.raises(MistakeError):
        diffnea.identify_robot(model, still, ball, progress=progress)


def test_ctrl_c_in_the_first_of_two_designs_is_not_lost_in_the_second() -> None:
    description = diffnea.load_model(MODEL).to_dict()
    description["home"] = (np.array(description["home"]) + 100.0).tolist()
    model = diffnea.Model.from_dict(description)
    with pytest.raises(diffnea.ModelError, match=r"lower 99\.4"):  # of the second one
        diffnea.robot_motions(model, arm_seconds=1.0, ball_seconds=1.0)

    def press(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, press)
    try:
        with pytest.raises(KeyboardInterrupt):  # noqa: PT012
            signal.setitimer(signal.ITIMER_REAL, 0.2)
            diffnea.robot_motions(model, arm_seconds=40.0, ball_seconds=40.0)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
