"""Options that the compiled part describes, as Python shows and takes them."""

import inspect

import pytest

import diffnea


@pytest.mark.parametrize("function", [diffnea.identify, diffnea.diagnose])
def test_signature_and_docstring_name_every_argument(function) -> None:
    parameters = inspect.signature(function).parameters
    assert all(p.kind is not inspect.Parameter.VAR_KEYWORD for p in parameters.values())
    doc = inspect.getdoc(function)
    assert doc is not None
    assert "**options" not in doc
    for name in parameters:
        assert f"\n    {name}: " in doc, name
    assert max(map(len, doc.splitlines())) <= 100


def test_defaults_are_those_of_the_library() -> None:
    parameters = inspect.signature(diffnea.identify).parameters
    defaults = {name: parameters[name].default for name in parameters}
    assert defaults["loss"] == "inverse"
    assert defaults["fit"] == ("inertia", "armature", "effects", "string")
    assert defaults["effects"] is None
    assert defaults["fix"] == ()
    assert defaults["horizon"] == 0.0
    assert defaults["ball_lambda"] == (1.0, 1.0, 1.0)
    assert defaults["threads"] == 1
    parameters = inspect.signature(diffnea.diagnose).parameters
    assert parameters["base"].default == "auto"
    assert parameters["effects"].default is None
    assert parameters["grey_box"].default is True


def test_the_defaults_can_be_given(arm, train) -> None:
    names = ("loss", "fit", "effects", "fix", "horizon", "ball_lambda", "filter_hz", "physical")
    parameters = inspect.signature(diffnea.identify).parameters
    given = diffnea.identify(arm, train, **{name: parameters[name].default for name in names})
    assert given.to_dict()["parameters"] == diffnea.identify(arm, train).to_dict()["parameters"]


def test_a_word_is_a_list_of_one(arm, train) -> None:
    one = diffnea.identify(arm, train, fix="lower.*")
    assert all(p.fixed for p in one.parameters if p.name.startswith("lower."))


def test_an_option_that_does_not_exist_is_answered_with_those_that_do(arm, train) -> None:
    with pytest.raises(TypeError, match=r"identify\(\) got an unexpected .*'filter'.*filter_hz"):
        diffnea.identify(arm, train, filter=12)
    with pytest.raises(TypeError, match=r"diagnose\(\) got an unexpected .*'loss'.*grey_box"):
        diffnea.diagnose(arm, train, loss="inverse")


def test_a_value_of_another_type_is_refused_by_name(arm, train) -> None:
    with pytest.raises(TypeError, match="identify: filter_hz: got 'low'"):
        diffnea.identify(arm, train, filter_hz="low")
    with pytest.raises(TypeError, match="identify: robust: got 3"):
        diffnea.identify(arm, train, robust=3)
    with pytest.raises(TypeError, match=r"diagnose: max_causes: got 2\.5"):
        diffnea.diagnose(arm, train, max_causes=2.5)
    with pytest.raises(diffnea.Error, match="effects: got none; leave it out"):
        diffnea.diagnose(arm, train, effects=[])
