"""diffnea on the runs of a servo: the command as a user calls it, with its defaults and no start.

It chooses itself which bounds of the drive the runs need (reach, dead band, speed of the setpoint).
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from dataclasses import fields
from pathlib import Path

import numpy as np
from servo_cases import ServoCase
from servo_pendulum import Law
from servo_worker import Fit, main

NAMES = {
    "stiffness": "position_servo.stiffness",
    "reach": "position_servo.reach",
    "damping": "position_servo.damping",
    "viscous": "viscous_friction.viscous",
    "coulomb": "coulomb_friction.coulomb",
    "armature": "armature.armature",
    "offset": "torque_offset.offset",
    "delay": "position_servo.delay",
    "speed": "position_servo.speed",
}
UNBOUNDED = {"reach": np.inf, "speed": np.inf}


def fit(case: ServoCase, out: Path) -> Fit:
    shutil.rmtree(out, ignore_errors=True)
    words = [os.environ["DIFFNEA"], "identify", case.model, *case.train, "-o", out, "--quiet"]
    subprocess.run(list(map(str, words)), check=True, stdout=subprocess.DEVNULL)
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    found = {p["name"]: p["value"] for p in result["parameters"] if p["std"]}
    values = {
        f.name: found.pop(f"servo.{NAMES[f.name]}", UNBOUNDED.get(f.name, 0.0)) for f in fields(Law)
    }
    return Fit(
        Law(**values),
        held=True,
        settings="diffnea identify, defaults",
        notes=[f"fitted beside the common law: {name} = {v:.3g}" for name, v in found.items()],
        extra={"model": str(out / "model.json")},
    )


if __name__ == "__main__":
    main({"stock": fit})
