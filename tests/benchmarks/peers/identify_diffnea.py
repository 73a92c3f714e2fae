# ruff: noqa: E501
"""diffnea on the same recordings.

stock      the recording's file and its own automatic filter, as a user calls it
band       the same with the low-pass of the common signals asked for
given      the common signals as arrays in place of the file: what its own filters are worth
free       `stock` without physical consistency
shapes     `stock`, and the speeds at which friction sets in are fitted, too
diagnose   which effects are lacking. The held-out recording is not shown to it: causes are found in the first two
           thirds of the training recording, checked on its last third, and the model is fitted to all of it
diagnose_test   as its manual says: the second recording is shown to it, so that no error of it is held out
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from cases import Case, split
from signals import Array
from worker import Outcome, main

import diffnea

EFFECTS = ("armature", "viscous_friction", "coulomb_friction", "torque_offset")


def outcome(model: diffnea.Model, settings: str, says: str, **more: Any) -> Outcome:
    def predict(q: Array, qd: Array, qdd: Array) -> Array:
        return np.asarray(diffnea.rnea(model, q=q, qd=qd, qdd=qdd, effects=True))

    inertias = np.asarray(model.inertial_parameters).reshape(-1, 10)
    return Outcome(predict, inertias, settings=settings, says=says, **more)


def fit(case: Case, given: bool = False, **options: Any) -> Outcome:
    model = diffnea.load_model(case.model)
    data: Any = case.train
    if given:
        s = case.signals("train")
        k = s.rows()
        data = diffnea.Recording(
            time=s.time[k],
            q=s.q[k],
            tau=s.tau[k],
            joint_names=case.joints,
            torque_side="link",  # as sampled: half a period of hold is in the common signals
        )
        options["filter_hz"] = 2.0 * case.cutoff
    else:
        options["torque_side"] = case.torque_side
    result = diffnea.identify(model, data, effects=EFFECTS, **options)
    return outcome(
        result.model,
        settings=f"effects {', '.join(EFFECTS)}; "
        + (", ".join(f"{k}={v}" for k, v in options.items()) or "defaults"),
        says="standard errors, what cannot be told, notes: " + " | ".join(result.notes),
        extra={"filter_hz": result.plan.filter_hz, "seconds": result.summary.seconds},
    )


def named(finding: diffnea.Finding) -> dict[str, Any]:
    return {
        "causes": [f"{c.effect} at {c.where}" for c in finding.causes],
        "verdict": str(finding.verdict),
        "noises_before": finding.gain.before,
        "noises_after": finding.gain.after,
    }


def diagnose(case: Case) -> Outcome:
    model, side = diffnea.load_model(case.model), case.torque_side
    with tempfile.TemporaryDirectory() as folder:
        parts = split(Path(case.train), 2.0 / 3.0, Path(folder))
        sidecar = Path(case.train).with_suffix(".json")
        for part in parts:
            if sidecar.is_file():
                shutil.copy(sidecar, part.with_suffix(".json"))
        finding = diffnea.diagnose(model, parts[0], test=parts[1], torque_side=side)
    settings = "diagnose, defaults: causes on the first two thirds, checked on the last"
    try:
        fitted = diffnea.identify(finding.model, case.train, effects=[], torque_side=side).model
    except diffnea.ModelError as e:
        # An effect with memory: torques are no function of one instant, and the common judge has no state.
        inertias = np.asarray(finding.model.inertial_parameters).reshape(-1, 10)
        return Outcome(
            None, inertias, settings, finding.sentence, notes=[str(e)], extra=named(finding)
        )
    return outcome(
        fitted,
        settings=settings + "; then identify of its model with all of the training recording",
        says=finding.sentence,
        extra=named(finding),
    )


def diagnose_test(case: Case) -> Outcome:
    finding = diffnea.diagnose(
        diffnea.load_model(case.model), case.train, test=case.test, torque_side=case.torque_side
    )
    inertias = np.asarray(finding.model.inertial_parameters).reshape(-1, 10)
    return Outcome(
        None,
        inertias,
        settings="diagnose --test, defaults: causes are checked on the held-out recording",
        says=finding.sentence,
        extra=named(finding),
    )


if __name__ == "__main__":
    main(
        {
            "stock": fit,
            "band": lambda c: fit(c, filter_hz=c.cutoff),
            "given": lambda c: fit(c, given=True),
            "shapes": lambda c: fit(c, fit=("inertia", "armature", "effects", "shapes")),
            "free": lambda c: fit(c, physical=False),
            "diagnose": diagnose,
            "diagnose_test": diagnose_test,
        }
    )
