# ruff: noqa: E501
"""FIGAROH's workflow as its examples for real arms have it.

Friction, offsets, rotors and weighted least squares as in its TX40 example, filters of torques and the relative rank
threshold as in its SO-101 example.

    fit        base parameters by weighted least squares
    physical   `select_stage: physical_fit`, as in its reference example: LMIs make every link possible (cvxopt)

Both once with its own signal processing from raw positions (`own`: median and Butterworth filter of the same cutoff,
its differentiation; torques as recorded, decimation filters them), and once with the common signals (`given`).
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import yaml
from cases import Case
from figaroh.identification.base_identification import BaseIdentification
from figaroh.tools.regressor import build_regressor_basic
from identify_least_squares import pinocchio_model
from signals import Array
from worker import Outcome, main

TIME_LIMIT = 600.0  # s, of the LMI solver


def configuration(case: Case, stage: str, rate: float, folder: Path) -> Path:
    n = len(case.joints)
    out = {
        "robot": {
            "name": case.name,
            "properties": {
                "joints": {"active_joints": case.joints},
                "mechanics": {
                    "reduction_ratios": [1.0] * n,
                    "friction_coefficients": {"viscous": [0.0] * n, "static": [0.0] * n},
                    "actuator_inertias": [0.0] * n,
                    "joint_offsets": [0.0] * n,
                },
                "coupling": {"has_coupled_wrist": False},
            },
        },
        "tasks": {
            "identification": {
                "enabled": True,
                "select_stage": stage,
                "physical_fit": {"enabled": stage == "physical_fit", "max_seconds": TIME_LIMIT},
                "problem": {
                    "include_external_forces": False,
                    "use_joint_torques": True,
                    "wls": True,
                    "qr_relative_tolerance": 1e-4,
                    "model_components": {
                        "friction": True,
                        "joint_offset": True,
                        "actuator_inertia": True,
                    },
                },
                "signal_processing": {
                    "sampling_frequency": float(rate),
                    "cutoff_frequency": case.cutoff,
                    "filter_type": "butterworth",
                    "filter_order": 4,
                },
            }
        },
    }
    path = folder / "figaroh.yaml"
    path.write_text(yaml.safe_dump(out), encoding="utf-8")
    return path


class Identification(BaseIdentification):  # type: ignore[misc]
    """A recording in FIGAROH: the subclass that its manual asks a user to write, as its SO-101 and TX40 examples do."""

    def __init__(self, case: Case, given: bool, stage: str, folder: Path) -> None:
        self.signals = case.signals("train")
        self.given = given
        robot = pin.RobotWrapper(pinocchio_model(case.model))
        super().__init__(robot, str(configuration(case, stage, self.signals.rate, folder)))
        joints = [self.model.joints[self.model.getJointId(name)] for name in case.joints]
        self.identif_config["act_J"] = joints
        self.identif_config["act_Jid"] = [j.id for j in joints]
        self.identif_config["act_idxq"] = [j.idx_q for j in joints]
        self.identif_config["act_idxv"] = [j.idx_v for j in joints]
        self.filter_config = {
            "differentiation_method": "gradient",
            "filter_params": {
                "nbutter": 4,
                "f_butter": case.cutoff,
                "med_fil": 5,
                "f_sample": self.signals.rate,
            },
        }

    def load_trajectory_data(self, data_source: str | None = None) -> dict[str, Array | None]:
        s = self.signals
        if self.given:
            k = s.rows()
            return {
                "timestamps": s.time[k].reshape(-1, 1),
                "positions": s.q[k],
                "velocities": s.qd[k],
                "accelerations": s.qdd[k],
                "torques": s.tau[k],
            }
        return {
            "timestamps": s.time.reshape(-1, 1),
            "positions": s.raw_q,
            "velocities": None,
            "accelerations": None,
            "torques": s.raw_tau,
        }

    def process_kinematics_data(self, filter_config: Any = None) -> None:
        if self.given:  # they are filtered
            self.processed_data = dict(self.raw_data)
        else:
            super().process_kinematics_data(filter_config)

    def process_torque_data(self, **kwargs: Any) -> Array:
        """Low-passed as in its SO-101 example; borders left out as in its TX40 example, by more rows than there."""
        if self.given:
            return np.asarray(self.raw_data["torques"])
        tau = self._apply_filters(self.raw_data["torques"], **self.filter_config["filter_params"])
        k = self.signals.rows()
        for key in ("timestamps", "positions", "velocities", "accelerations"):
            self.processed_data[key] = self.processed_data[key][k]
        return np.asarray(tau[k])


def fit(case: Case, given: bool, stage: str) -> Outcome:
    printed = io.StringIO()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(printed):
        problem = Identification(case, given, stage, Path(folder))
        problem.initialize()
        factor = problem.signals.decimation
        decimate = factor > 1
        problem.solve(
            decimate=decimate,
            decimation_factor=factor if decimate else 10,
            plotting=False,
            wls=True,
        )
    notes = []
    standard = stage == "physical_fit"
    selected = problem.selected
    if standard and not selected.accepted:
        notes.append(f"physical_fit {selected.status}: {selected.reason}")
        standard = selected.values is not None
    names = list(problem.standard_parameter)

    def regressor(q: Array, qd: Array, qdd: Array) -> Array:
        return np.asarray(build_regressor_basic(problem.robot, q, qd, qdd, problem.identif_config))

    def predict(q: Array, qd: Array, qdd: Array) -> Array:
        w = regressor(q, qd, qdd)
        if standard:
            tau = w @ selected.values
        else:
            kept = [i for i in range(len(names)) if i not in set(problem._idx_eliminated)]
            tau = w[:, kept][:, problem._base_indices] @ problem.phi_base
        return np.asarray(tau.reshape(len(case.joints), -1).T)

    inertias = None
    if standard:
        value = dict(zip(selected.names, selected.values, strict=True))
        keys = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"]
        inertias = np.array([[link_value(value, key, j) for key in keys] for j in case.joints])
    return Outcome(
        predict,
        inertias,
        settings=f"friction, joint_offset, actuator_inertia, wls; select_stage {stage}; Butterworth "
        f"order 4, {case.cutoff:g} Hz; decimation {factor if decimate else 'off'}",
        says="standard deviations of base parameters; on held-out data an rmse per joint and a verdict; no cause",
        notes=notes,
        extra={"base_parameters": len(problem.phi_base), "report": printed.getvalue()[-1500:]},
    )


def link_value(value: dict[str, float], key: str, joint: str) -> float:
    return float(value[f"{key}_{joint}"])


if __name__ == "__main__":
    main(
        {
            "own": lambda c: fit(c, False, "fit"),
            "given": lambda c: fit(c, True, "fit"),
            "physical_own": lambda c: fit(c, False, "physical_fit"),
            "physical_given": lambda c: fit(c, True, "physical_fit"),
        }
    )
