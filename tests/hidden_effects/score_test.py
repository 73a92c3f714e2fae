"""Verdicts on verdicts, by hand."""

from typing import Any

import pytest
import score as scoring
from score import judge

Json = dict[str, Any]


def hidden(effect: str, where: str = "elbow", lm: float = 500.0, **more: Any) -> Json:
    base = {"effect": effect, "where": where, "parameters": {}, "size": 0.01}
    return base | {"expected_lm": lm, "reachable_lm": lm, "rivals": [], "variables": []} | more


def truth(*effects: Json, kind: str = "named") -> Json:
    return {"kind": kind, "effects": list(effects)}


def said(effect: str, where: str = "elbow", *, others: tuple[str, ...] = (), **more: Any) -> Json:
    members = [{"effect": name, "where": where} for name in others]
    return {"effect": effect, "where": where, "parameters": [], "class": members} | more


def result(*causes: Json, verdict: str = "NAMED", **more: Any) -> Json:
    return {"verdict": verdict, "causes": list(causes)} | more


NOTHING = result(verdict="NONE")
UNKNOWN = result(
    verdict="UNKNOWN", witness=[{"where": "elbow", "variables": ["q_elbow", "qd_elbow"]}]
)
COULOMB = hidden("coulomb_friction")
WEAK = hidden("cogging", "shoulder", lm=5.0)
STRIBECK = hidden(
    "stribeck_friction", rivals=[{"effects": ["coulomb_friction"], "lm_beyond": 12.0}]
)
CLEAR_STRIBECK = hidden(
    "stribeck_friction", rivals=[{"effects": ["coulomb_friction"], "lm_beyond": 90.0}]
)
LAG = hidden("actuator_lag")
PAIR = hidden("cable_differential_friction", "shoulder,elbow")

GRAVITY = hidden("gravity_scale", "ball")
TURNED = hidden(
    "camera_rotation", "camera", rivals=[{"effects": ["camera_scale"], "lm_beyond": 9.0}]
)

CASES = {
    "the effect at its joint": (truth(COULOMB), result(said("coulomb_friction")), "right"),
    "a pair in the other order": (
        truth(PAIR),
        result(said("cable_differential_friction", "elbow,shoulder")),
        "right",
    ),
    "another joint": (truth(COULOMB), result(said("coulomb_friction", "wrist")), "wrong"),
    "another effect": (truth(COULOMB), result(said("cogging")), "wrong"),
    "the truth and one more": (
        truth(COULOMB),
        result(said("coulomb_friction"), said("cogging", "wrist")),
        "wrong",
    ),
    "in the class": (
        truth(COULOMB),
        result(said("load_friction", others=("coulomb_friction",)), verdict="CLASS"),
        "class",
    ),
    "a parent that explains as much": (
        truth(STRIBECK),
        result(said("coulomb_friction")),
        "confusable",
    ),
    "a parent that explains less": (
        truth(CLEAR_STRIBECK),
        result(said("coulomb_friction")),
        "wrong",
    ),
    "a documented confusion": (truth(LAG), result(said("actuator_delay")), "confusable"),
    "a documented confusion elsewhere": (
        truth(LAG),
        result(said("actuator_delay", "wrist")),
        "wrong",
    ),
    "the ball's restoring forces": (
        truth(GRAVITY),
        result(said("string_bending", "string")),
        "confusable",
    ),
    "a view that explains as much": (
        truth(TURNED),
        result(said("camera_scale", "camera")),
        "confusable",
    ),
    "a view that explains as much, and a drag": (
        truth(TURNED),
        result(said("camera_scale", "camera"), said("linear_drag", "ball")),
        "wrong",
    ),
    "another effect of the ball": (
        truth(GRAVITY),
        result(said("linear_drag", "ball")),
        "wrong",
    ),
    "nothing named": (truth(COULOMB), NOTHING, "missed"),
    "nothing named of what cannot be seen": (truth(WEAK), NOTHING, "right"),
    "what can hardly be seen": (truth(WEAK), result(said("cogging", "shoulder")), "right"),
    "another effect where none can be seen": (
        truth(WEAK),
        result(said("viscous_friction")),
        "false_alarm",
    ),
    "unknown though in the catalogue": (truth(COULOMB), UNKNOWN, "unknown"),
    "both of two": (
        truth(COULOMB, hidden("cogging", "wrist")),
        result(said("cogging", "wrist"), said("coulomb_friction")),
        "right",
    ),
    "one of two": (
        truth(COULOMB, hidden("cogging", "wrist")),
        result(said("coulomb_friction")),
        "partial",
    ),
    "the visible one of two": (truth(COULOMB, WEAK), result(said("coulomb_friction")), "right"),
    "nothing where nothing is": (truth(kind="none"), NOTHING, "right"),
    "something where nothing is": (
        truth(kind="none"),
        result(said("coulomb_friction")),
        "false_alarm",
    ),
    "unknown where nothing is": (truth(kind="none"), UNKNOWN, "false_alarm"),
    "no result": (truth(COULOMB), None, "failed"),
}


@pytest.mark.parametrize("case", CASES)
def test_named(case: str) -> None:
    what, answer, outcome = CASES[case]
    assert judge(what, answer).outcome == outcome


OUTSIDE = truth(hidden("outside/wall", variables=["q_elbow"]), kind="unknown")


def test_outside_the_catalogue_unknown_is_right_and_the_variables_count() -> None:
    assert judge(OUTSIDE, UNKNOWN).outcome == "right"
    assert judge(OUTSIDE, UNKNOWN).witness is True
    elsewhere = result(verdict="UNKNOWN", witness=[{"where": "wrist", "variables": ["q_elbow"]}])
    assert judge(OUTSIDE, elsewhere).witness is False
    assert judge(OUTSIDE, result(said("cogging"))).outcome == "wrong"
    assert judge(OUTSIDE, NOTHING).outcome == "missed"


def test_what_a_grey_box_learned_is_no_name() -> None:
    learned = UNKNOWN | {"causes": [said("residual")]}
    assert judge(OUTSIDE, learned).outcome == "right"
    assert judge(OUTSIDE, learned).named == []


ABSORBED = truth(hidden("armature", "joint1", lm=0.0), kind="absorbed")


def test_absorbed_effects_are_to_be_declared_and_not_named() -> None:
    declared = result(
        verdict="NOT_IDENTIFIABLE", absorbed=[{"effect": "armature", "where": "joint1"}]
    )
    assert judge(ABSORBED, declared).outcome == "right"
    assert judge(ABSORBED, declared).absorbed is True
    assert judge(ABSORBED, NOTHING).outcome == "right"
    assert judge(ABSORBED, NOTHING).absorbed is False
    assert judge(ABSORBED, result(said("armature", "joint1"))).outcome == "false_alarm"


FAULT = truth(hidden("velocity_filter_lag", lm=0.0), kind="audit")


def test_channel_faults_are_the_audits() -> None:
    found = {"fault": "velocity_filter_lag", "where": "elbow"}
    assert judge(FAULT, NOTHING | {"audit": [found]}).outcome == "right"
    assert judge(FAULT, NOTHING | {"audit": [found | {"where": "wrist"}]}).outcome == "missed"
    assert judge(FAULT, result(said("actuator_lag"))).outcome == "false_alarm"


def test_intervals_are_compared_by_name() -> None:
    what = truth(hidden("coulomb_friction", parameters={"coulomb": 1.0, "other": 2.0}))
    parameters = [
        {"name": "coulomb", "ci95": [0.9, 1.1]},
        {"name": "other", "ci95": [2.1, 2.3]},
        {"name": "smoothing", "ci95": [0.0, 1.0]},
    ]
    answer = result(said("coulomb_friction") | {"parameters": parameters})
    assert judge(what, answer).covered == [True, False]


def test_the_power_is_that_of_the_weakest_effect_that_counts() -> None:
    score = judge(truth(COULOMB, hidden("cogging", "wrist", lm=60.0), WEAK), NOTHING)
    assert score.expected_lm == score.reachable_lm == 60.0
    assert scoring.VISIBLE < 60.0


def left(**rms: float) -> list[Json]:
    """Joints without an extension at 5 and 4 times their noise of 0.1 and 2."""
    noise = {"elbow": 0.1, "wrist": 2.0}
    base = {"elbow": 0.5, "wrist": 8.0}
    return [
        {"joint": j, "base": base[j], "extended": rms[j], "noise_floor": noise[j]} for j in noise
    ]


def test_the_gain_is_compared_with_that_of_the_true_effects() -> None:
    oracle = result(said("coulomb_friction"), joints=left(elbow=0.1, wrist=2.0))  # 41 to 2
    same = result(said("coulomb_friction"), joints=left(elbow=0.1, wrist=2.0))
    worse = result(said("cogging"), joints=left(elbow=0.5, wrist=2.0))  # 41 to 26
    missed = result(verdict="NONE", joints=left(elbow=0.5, wrist=8.0))
    for answer, gain in ((same, 1.0), (worse, 15 / 39), (missed, 0.0)):
        assert scoring.oracle_gain(answer, oracle) == pytest.approx(gain)
    assert scoring.oracle_gain(same, missed) is None


def test_an_oracle_that_refuses_the_truth_is_none() -> None:
    answer = result(said("coulomb_friction"), joints=left(elbow=0.1, wrist=2.0))
    refused = result(verdict="NONE", joints=left(elbow=0.5, wrist=8.0))
    for oracle, outcome, gain in (
        (answer, "right", 1.0),
        (refused, "missed", None),
        (None, "failed", None),
    ):
        score = judge(truth(COULOMB), answer)
        scoring.judge_oracle(truth(COULOMB), answer, oracle, score)
        assert (score.oracle, score.oracle_gain) == (outcome, gain)
