"""Results as data frames: the numbers of the results, under the names of their fields."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import diffnea

pandas = pytest.importorskip("pandas")


@pytest.fixture(scope="module")
def result(arm, train, held_out) -> diffnea.IdentifyResult:
    return diffnea.identify(arm, train, test=held_out)


@pytest.fixture(scope="module")
def finding(arm, train, held_out) -> diffnea.Finding:
    return diffnea.diagnose(arm, train, test=held_out)


def test_parameters_and_errors_have_the_names_of_their_fields(result) -> None:
    frame = result.to_frame()
    assert frame.index.name == "name"
    assert frame.loc["lower.mass", "value"] == result.parameters["lower.mass"].value
    errors = diffnea.to_frame(result.errors)
    assert list(errors.index) == ["shoulder", "elbow"]
    assert errors.index.name == "joint"
    assert errors.loc["elbow", "test"] == result.errors[1].test
    base = diffnea.to_frame(result.base_parameters)
    assert list(base["expression"]) == [b.expression for b in result.base_parameters]
    assert "coefficients" not in base.columns  # an array is no cell


def test_causes_have_a_row_for_each_parameter(finding) -> None:
    frame = finding.to_frame()
    cause = finding.causes[0]
    assert frame.index.names == ["effect", "where", "parameter"]
    parameter = cause.parameters[0]
    row = frame.loc[(cause.effect, cause.where, parameter.name)]
    for name in ("value", "std", "low", "high", "unit"):
        assert row[name] == getattr(parameter, name)
    assert row["verdict"] == cause.verdict
    assert row["delta_bic"] == cause.delta_bic
    assert row["explained_share"] == cause.gain.explained_share
    assert frame.equals(diffnea.to_frame(finding.causes))
    none = diffnea.to_frame(finding.causes[:0])
    assert len(none) == 0


def test_a_finding_without_causes_has_an_empty_frame_of_the_same_kind(arm, train, finding) -> None:
    healthy = diffnea.diagnose(finding.model, train)
    assert not healthy.causes
    frame = healthy.to_frame()
    assert len(frame) == 0
    filled = finding.to_frame()
    assert frame.index.names == filled.index.names
    assert list(frame.columns) == list(filled.columns)
    assert {"value", "delta_bic", "explained_share"} <= set(frame.columns)


def test_a_motion_without_joints_has_an_empty_frame_of_the_same_kind(arm, train, finding) -> None:
    stopped = diffnea.diagnose(arm, train, progress=lambda p: p.stage == "reading")
    motion = stopped.simulated
    assert not motion.joints
    assert list(motion.to_frame().columns) == list(finding.simulated.to_frame().columns)


def test_lists_of_a_finding_are_tables(finding) -> None:
    candidates = diffnea.to_frame(finding.candidates)
    assert candidates.index.names == ["effect", "where"]
    assert len(candidates) == len(finding.candidates)
    best = finding.candidates[0]
    assert candidates.iloc[0]["delta_bic"] == best.delta_bic
    joints = diffnea.to_frame(finding.joints)
    assert joints.loc["elbow", "extended"] == finding.joints[1].extended
    assert len(diffnea.to_frame(finding.refused)) == len(finding.refused)


def test_series_are_over_time(result, finding) -> None:
    series = result.test_series[0]
    frame = series.to_frame()
    assert list(frame.columns) == ["time", "measured", "fitted", "nominal", "velocity"]
    np.testing.assert_array_equal(frame["fitted"], series.fitted)
    assert frame.attrs["units"] == {"shoulder": "N*m"}
    both = diffnea.to_frame(finding.series)
    assert both.columns[0] == "joint"
    assert len(both) == sum(len(s.time) for s in finding.series)
    elbow = both[both["joint"] == "elbow"]
    np.testing.assert_array_equal(elbow["extended"], finding.series[1].extended)
    simulated = finding.simulated.to_frame()
    assert len(simulated) == sum(len(s.time) for s in finding.simulated.joints)


def test_comparisons_and_audits_are_tables(result, arm, train, tmp_path: Path) -> None:
    changed = diffnea.compare(result, result)
    frame = changed.to_frame()
    assert len(frame) == len(changed.parameters)
    assert not frame["significant"].any()
    time = train.time
    time[200:] += 0.5
    broken = diffnea.Recording(time=time, q=train.q, tau=train.tau, joint_names=train.joint_names)
    report = diffnea.audit(broken)
    faults = report.to_frame()
    assert list(faults["fault"]) == [f.fault for f in report.faults]
    assert "time_gap" in set(faults["fault"])
    assert list(diffnea.audit(train).to_frame().columns) == list(faults.columns)
    assert {"channel", "value", "std", "evidence"} <= set(faults.columns)
    json.loads(faults.to_json(orient="records"))


def test_what_is_no_result_is_refused(train) -> None:
    with pytest.raises(diffnea.Error, match="got int, expected a result or a list"):
        diffnea.to_frame(3)
    with pytest.raises(diffnea.Error, match="got a list of int"):
        diffnea.to_frame([3])
    with pytest.raises(diffnea.Error, match="a recording has its own to_frame"):
        diffnea.to_frame([train])
    assert list(diffnea.to_frame(train).columns[:2]) == ["time", "q_shoulder"]


def test_without_pandas_the_message_says_what_to_install(
    finding, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"Finding.to_frame needs pandas.*pip install .*pandas>="):
        finding.to_frame()
