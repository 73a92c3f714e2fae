"""What a rope does that a massless string cannot: named from what learned policies did.

The world is MuJoCo's chain of capsules, which knows nothing of the effects.
"""

import numpy as np
import pytest

import diffnea

ROBOT = "wam4_ball_in_cup"
CONTACT = ["string_wrap", "string_rebound", "string_folding"]


@pytest.fixture(scope="module")
def learned() -> diffnea.LearnResult:
    """Return eight policies, learned in the description."""
    return diffnea.learn(
        diffnea.models.path(f"{ROBOT}.xml"), string=0.4, seeds=range(1, 9), progress=False
    )


@pytest.fixture(scope="module")
def seen(learned: diffnea.LearnResult) -> list[diffnea.Recording]:
    """Return what the robot's sensors see of them."""
    world = f"mujoco:{ROBOT},perturb=none,rope=mid"
    return diffnea.transfer(learned, world, repetitions=0, record=True).recordings


@pytest.fixture(scope="module")
def found(learned: diffnea.LearnResult, seen: list[diffnea.Recording]) -> diffnea.Finding:
    """Return what the description lacks of them, two of them held out."""
    return diffnea.diagnose(
        learned.model, seen[:6], test=seen[6:], base="fixed", effects=CONTACT, grey_box=False
    )


def test_every_recording_has_noise_of_its_own(seen: list[diffnea.Recording]) -> None:
    # All begin at rest in one posture: first rows differ by noise alone, of the camera 1.5 mm.
    first = np.array([recording.ball[0] for recording in seen])
    assert np.isfinite(first).all()
    assert len(np.unique(first, axis=0)) == len(seen)
    assert 0.5e-3 < first.std(axis=0).mean() < 3e-3


def test_a_rope_is_named(found: diffnea.Finding) -> None:
    named = {cause.effect for cause in found.causes}
    assert named
    assert named <= set(CONTACT)
    ball = next(joint for joint in found.joints if joint.joint == "ball")
    assert ball.extended < 0.75 * ball.base
    # The extended model holds what was named.
    effects = {effect["effect"] for effect in found.model.to_dict()["effects"]}
    assert named <= effects


def test_nothing_is_named_that_is_not_needed(found: diffnea.Finding) -> None:
    for cause in found.causes:
        assert cause.delta_bic >= 10, cause.effect
        assert all(np.isfinite(p.value) and p.value > 0 for p in cause.parameters)
