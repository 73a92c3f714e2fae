"""What the jobs of the step beyond do, beside those of :mod:`work`."""

from __future__ import annotations

import math

import numpy as np

from .._core import Model, Recording
from .._diagnose import diagnose
from .._learn import learn
from .._transfer import transfer
from .jobs import Arrays, Json, Output, Result
from .work import learned_output, named_world, nominal_model, policies_of

STRING = (
    "string_wrap",
    "string_rebound",
    "string_folding",
    "string_mass",
    "string_damping",
    "string_bending",
)
"""What a string may lack."""
CANDIDATES = (
    *STRING,
    "linear_drag",
    "quadratic_drag",
    "joint_elasticity",
    "presliding_dahl",
    "stribeck_friction",
    "actuator_delay",
    "actuator_lag",
    "camera_delay",
)
"""All that is tried: what the model's simulator can then learn in."""
HELD_OUT = 4
"""Every which recording is held out."""
CONTACT = {
    "string_wrap.size": 1.0,
    "string_rebound.restitution": 0.2,
    "string_folding.resistance": 0.02,
}
"""What acts at the same impacts, and what of it ropes have. One can stand for another: the causes
that were named are these, not how much each of them is."""
VARIED = 1.5
"""Draws have what was named from none to so much of what was found."""
MOST = {"string_rebound.restitution": 0.6, "string_folding.resistance": 0.1}
"""That the effects take."""


def observe(settings: Json, needs: list[Result]) -> Output:
    """Execute the first policies before the robot's sensors, with their noise."""
    policies = policies_of(needs[0])[: settings["policies"]]
    found = transfer(
        policies,
        named_world(settings["world"], settings),
        controller=nominal_model(settings),
        repetitions=0,
        seed=settings["seed"],
        record=True,
    )
    arrays: Arrays = {}
    for k, recording in enumerate(found.recordings):
        for name in ("time", "q", "tau", "ball"):
            arrays[f"{name}_{k}"] = np.asarray(getattr(recording, name))
    joints = found.recordings[0].joint_names
    return Output({"joints": joints, "seeds": [policy.seed for policy in policies]}, arrays)


def diagnose_policies(settings: Json, needs: list[Result]) -> Output:
    """Ask what the identified model lacks of what its policies did, and extend it."""
    identified, observed = needs
    recordings = [
        Recording(
            time=observed.arrays[f"time_{k}"],
            q=observed.arrays[f"q_{k}"],
            tau=observed.arrays[f"tau_{k}"],
            ball=observed.arrays[f"ball_{k}"],
            joint_names=observed.data["joints"],
            source=f"{observed.file.name}: policy {seed}",
        )
        for k, seed in enumerate(observed.data["seeds"])
    ]
    held_out = recordings[HELD_OUT - 1 :: HELD_OUT]
    train = [r for k, r in enumerate(recordings) if k % HELD_OUT != HELD_OUT - 1]
    effects = CANDIDATES if settings["effects"] == "all" else (settings["effects"],)
    finding = diagnose(
        Model.from_dict(identified.data["model"]),
        train,
        test=held_out,
        effects=effects,
        grey_box=False,
    )
    causes = [
        {
            "effect": cause.effect,
            "where": cause.where,
            "delta_bic": cause.delta_bic,
            "parameters": {p.name: [p.value, p.low, p.high] for p in cause.parameters},
        }
        for cause in finding.causes
    ]
    ball = next((j for j in finding.joints if j.joint == "ball"), None)
    return Output(
        {
            "verdict": finding.verdict,
            "sentence": finding.sentence,
            "causes": causes,
            "ball_before": ball.base if ball else None,
            "ball_after": ball.extended if ball else None,
            "model": finding.model.to_dict(),
        }
    )


def learn_robustly(settings: Json, needs: list[Result]) -> Output:
    """Search in draws of the extended model: its posterior, and what was named of the string."""
    model = Model.from_dict(needs[0].data["model"])
    vary = varied(needs[0].data["causes"])
    learned = learn(
        model,
        controller=nominal_model(settings),
        string=settings["string"],
        seeds=settings["seeds"],
        progress=False,
        robust=True,
        vary=vary,
        **settings["search"],
    )
    found = learned_output(learned)
    return Output({**found.data, "vary": vary}, found.arrays)


def varied(causes: list[Json]) -> dict[str, tuple[float, float]]:
    """Return what draws vary: parameters of the string that were named, and those like them."""
    found = {
        f"{cause['effect']}.{name}": value
        for cause in causes
        if cause["effect"] in STRING
        for name, (value, _, _) in cause["parameters"].items()
    }
    if any(name in found for name in CONTACT):
        found = CONTACT | found
    return {
        f"string.{name}": (0.0, min(VARIED * value, MOST.get(name, math.inf)))
        for name, value in found.items()
    }
