"""Parts of results: as dicts they are what files hold of them, and each has a table."""

import inspect
import json

import numpy as np
import pytest

import diffnea


@pytest.fixture(scope="module")
def result(arm, train, held_out) -> diffnea.IdentifyResult:
    return diffnea.identify(arm, train, test=held_out)


@pytest.fixture(scope="module")
def finding(arm, train, held_out) -> diffnea.Finding:
    return diffnea.diagnose(arm, train, test=held_out)


def test_parts_as_dicts_are_those_of_the_file(result, finding) -> None:
    fit, found = result.to_dict(), finding.to_dict()
    assert [p.to_dict() for p in result.parameters] == fit["parameters"]
    assert finding.causes
    assert [c.to_dict() for c in finding.causes] == found["causes"]
    assert [c.to_dict() for c in finding.candidates] == found["candidates"]
    assert finding.gain.to_dict() == found["gain"]
    assert [a.to_dict() for a in finding.absorbed] == found["absorbed"]
    assert len(finding.causes[0].gain.to_dict()["ci95"]) == 2


def test_numbers_that_do_not_exist_are_null(result) -> None:
    unknown = [p for p in result.parameters if np.isnan(p.std)]
    assert unknown
    assert unknown[0].to_dict()["std"] is None


def test_series_are_lists(result) -> None:
    series = result.test_series[0]
    content = json.loads(json.dumps(series.to_dict(), allow_nan=False))
    np.testing.assert_array_equal(content["fitted"], series.fitted)
    assert content["unit"] == "N*m"


def test_every_value_type_has_a_dict_and_a_table() -> None:
    types = [
        thing
        for thing in vars(diffnea).values()
        if inspect.isclass(thing) and "to_dict" in vars(thing)
    ]
    described = [
        thing
        for thing in vars(diffnea).values()
        if inspect.isclass(thing)
        and thing.__module__ == "diffnea"
        and any(isinstance(x, property) for x in vars(thing).values())
        and inspect.get_annotations(thing)
    ]
    assert len(described) > 30
    for thing in described:
        assert thing in types, thing
        assert "_repr_html_" in vars(thing), thing


def test_tables_have_names_values_and_units(result) -> None:
    error = result.errors[1]
    table = error._repr_html_()
    assert f"<tr><td>test</td><td>{error.test:.4g}</td>" in table
    assert "<td>joint</td><td>&#x27;elbow&#x27;</td>" in table
    assert "<td>dt</td>" in result.plan._repr_html_()
    assert "<td>s</td>" in result.plan._repr_html_()
