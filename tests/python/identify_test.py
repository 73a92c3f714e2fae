import json
import pickle
import time
from pathlib import Path

import numpy as np
import pytest
from cli import done

import diffnea


@pytest.fixture(scope="module")
def result(arm, train, held_out) -> diffnea.IdentifyResult:
    return diffnea.identify(arm, train, test=held_out)


def test_the_truth_is_found_within_its_uncertainty(result) -> None:
    assert result.summary.converged
    assert result.physically_consistent
    truth = {
        "shoulder.viscous_friction.viscous": 0.7,
        "elbow.torque_offset.offset": -0.3,
        "lower.hx": 0.15,
    }
    for name, value in truth.items():
        parameter = result.parameters[name]
        assert parameter.identifiable
        # Three numbers at four standard errors: a false alarm in 5000 runs, and the seed is fixed.
        assert abs(parameter.value - value) < 4 * parameter.std, name
    for error in result.errors:
        assert error.test < 0.1 * error.nominal_test


def test_arrays_give_the_numbers_of_the_command(
    arm, train, held_out, result, tmp_path: Path
) -> None:
    arm.save(tmp_path / "arm.json")
    diffnea.write_recording(train, tmp_path / "train.csv")
    diffnea.write_recording(held_out, tmp_path / "test.csv")
    done("identify", "arm.json", "train.csv", "--test", "test.csv", "-o", "run", cwd=tmp_path)
    expected = json.loads((tmp_path / "run" / "result.json").read_text())
    from_files = diffnea.identify(arm, tmp_path / "train.csv", test=[tmp_path / "test.csv"])
    for found in (result.to_dict(), from_files.to_dict()):
        assert found.keys() == expected.keys()
        for key in ("schema", "parameters", "effects", "base_parameters", "rmse", "boundary"):
            assert found[key] == expected[key], key
    read = diffnea.read_result(tmp_path / "run")
    assert read.to_dict()["parameters"] == expected["parameters"]


def test_frames_and_lists_of_recordings_are_data_too(arm, train, held_out, result) -> None:
    pytest.importorskip("pandas")
    framed = diffnea.identify(arm, train.to_frame(), test=held_out.to_frame())
    assert framed.to_dict()["rmse"] == result.to_dict()["rmse"]
    both = diffnea.identify(arm, [train, held_out])
    assert both.summary.rows == len(train) + len(held_out)
    mixed = diffnea.identify(arm, [train, held_out.to_frame()])
    assert mixed.to_dict()["rmse"] == both.to_dict()["rmse"]


def test_options_reach_the_fit(arm, train) -> None:
    fixed = diffnea.identify(
        arm, train, effects=["viscous_friction"], fix=["lower.*"], filter_hz=12
    )
    assert fixed.plan.filter_hz == 12
    assert all(p.fixed for p in fixed.parameters if p.name.startswith("lower."))
    assert {p.name.split(".")[1] for p in fixed.parameters if "friction" in p.name} == {
        "viscous_friction"
    }
    free = diffnea.identify(arm, train, physical=False)
    assert not free.physically_consistent
    robust = diffnea.identify(arm, train, robust="cauchy")
    assert robust.summary.passes > 1


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (
            {"loss": "backward"},
            diffnea.Error,
            "loss: got .backward.; choices: constrained, forward",
        ),
        ({"robust": "very"}, diffnea.Error, "robust: got 'very'; choices: cauchy, huber, none"),
        ({"fit": ["mood"]}, diffnea.ModelError, "mood"),
        ({"effects": ["magic"]}, diffnea.ModelError, "magic"),
        ({"fix": ["wing.mass"]}, diffnea.ModelError, "wing.mass"),
    ],
)
def test_wrong_options_are_answered_with_the_choices(arm, train, options, error, message) -> None:
    with pytest.raises(error, match=message):
        diffnea.identify(arm, train, **options)


def test_joints_that_are_not_the_models_are_listed(arm, train) -> None:
    other = diffnea.Recording(
        time=train.time, q=train.q, tau=train.tau, joint_names=["shoulder", "wrist"]
    )
    with pytest.raises(diffnea.DataError, match=r"(?s)elbow.*wrist|wrist.*elbow"):
        diffnea.identify(arm, other)


def test_parameters_by_name_and_as_frame(result) -> None:
    assert result.parameters[0].name in result.parameters.to_frame().index
    with pytest.raises(KeyError, match=r"no parameter 'wing.mass'; names: upper.mass"):
        result.parameters["wing.mass"]
    frame = result.to_frame()
    assert frame.loc["lower.hx", "unit"] == "kg*m"
    assert len(frame) == len(result.parameters)


def test_results_are_values(result, tmp_path: Path) -> None:
    back = pickle.loads(pickle.dumps(result))
    assert back.to_dict() == result.to_dict()
    assert back.model == result.model
    for ours, theirs in zip(back.test_series, result.test_series, strict=True):
        assert ours.joint == theirs.joint
        np.testing.assert_array_equal(ours.fitted, theirs.fitted)
    assert (
        pickle.loads(pickle.dumps(result.parameters))["lower.hx"].value
        == result.parameters["lower.hx"].value
    )
    json.dumps(result.to_dict(), allow_nan=False)
    assert "IdentifyResult('planar'" in repr(result)
    assert "held-out" in repr(result)
    assert "lower.hx" in str(result)
    page = result._repr_html_()
    assert page.count("<table>") == 2
    assert "elbow.torque_offset.offset" in page
    assert repr(result.errors[0]).startswith("JointError(joint='shoulder', unit='N*m'")


def test_a_saved_run_holds_what_the_command_leaves(result, tmp_path: Path) -> None:
    result.save(tmp_path / "run")
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert names == {"result.json", "series.json", "model.json", "report.html"}
    back = diffnea.read_result(tmp_path / "run")
    assert back.to_dict()["rmse"] == result.to_dict()["rmse"]
    assert result.report_html().startswith("<!")
    result.save(tmp_path / "run")  # its own
    with pytest.raises(diffnea.FileError):
        result.save("/proc/nowhere")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "model.json").write_text("{}")
    with pytest.raises(diffnea.FileError, match=r"model\.json: was not left by diffnea"):
        result.save(tmp_path / "mine")
    assert (tmp_path / "mine" / "model.json").read_text() == "{}"


def test_plot_draws_a_panel_for_every_joint(result, arm, train) -> None:
    pytest.importorskip("matplotlib")
    figure = result.plot()
    assert [axes.get_ylabel() for axes in figure.axes] == ["shoulder [N·m]", "elbow [N·m]"]
    drawn = figure.axes[0].lines[0].get_ydata()
    np.testing.assert_array_equal(drawn[~np.isnan(drawn)], result.test_series[0].measured)
    with pytest.raises(diffnea.Error, match="choices: auto, test, train"):
        result.plot(of="both")
    with pytest.raises(diffnea.Error, match="holds no test series"):
        diffnea.identify(arm, train).plot(of="test")


def test_compare_sees_a_payload_and_nothing_else(arm, train, held_out, result) -> None:
    same = diffnea.compare(result, diffnea.identify(arm, held_out, test=train))
    assert same.joints == ["shoulder", "elbow"]
    assert same.to_dict()["schema"] == "diffnea/compare/1"
    assert not same.changed
    pickle.loads(pickle.dumps(same))
    loaded = arm.with_inertial_parameters(
        arm.inertial_parameters + np.r_[np.zeros(10), 0.5, 0.15, 0, 0, 0, 0, 0, 0.045, 0, 0.045]
    )
    motion = diffnea.excite(arm, duration=10, seed=3)
    other = diffnea.identify(arm, diffnea.simulate(loaded, motion, noise=0.2, seed=3).recording)
    assert diffnea.compare(result, other).changed


def test_a_known_payload_calibrates_torque_constants(arm, rubbing_arm, train) -> None:
    loaded = rubbing_arm.with_inertial_parameters(
        arm.inertial_parameters + np.r_[np.zeros(10), 0.5, 0.15, 0, 0, 0, 0, 0, 0.045, 0, 0.045]
    )
    other = diffnea.simulate(loaded, diffnea.excite(arm, duration=10, seed=4), noise=0.2, seed=4)
    gains = np.array([0.9, 1.1])

    def with_gains(r: diffnea.Recording, **more) -> diffnea.Recording:
        return diffnea.Recording(
            time=r.time,
            q=r.q,
            tau=r.tau * gains,
            joint_names=r.joint_names,
            torque_constant={"elbow": 2.0},
            **more,
        )

    runs = [with_gains(train), with_gains(other.recording, payload={"mass": 0.5})]
    assert runs[1].payload == {"where": "tip", "mass": 0.5}
    assert pickle.loads(pickle.dumps(runs[1])).payload == runs[1].payload
    effects = ["armature", "viscous_friction", "torque_offset", "torque_gain"]
    result = diffnea.identify(arm, runs, effects=effects)
    for joint, gain in zip(arm.joint_names, gains, strict=True):
        found = result.parameters[f"{joint}.torque_gain.gain_error"]
        # Two numbers at four standard errors, the seed is fixed.
        assert abs(found.value - (gain - 1)) < 4 * found.std
        assert found.std < 0.02
    (constant,) = result.torque_constants
    assert (constant.joint, constant.unit, constant.assumed) == ("elbow", "N*m/A", 2.0)
    assert abs(constant.value - 2.0 / 1.1) < 4 * constant.std
    assert pickle.loads(pickle.dumps(result)).torque_constants[0].value == constant.value

    unknown = diffnea.identify(
        arm,
        [train, other.recording],
        effects=["armature", "viscous_friction", "torque_offset", "payload@tip:run=1"],
    )
    mass = unknown.parameters["tip:run=1.payload.mass"]
    assert abs(mass.value - 0.5) < 4 * mass.std
    assert any("hangs on the torque constants" in note for note in unknown.notes)
    with pytest.raises(diffnea.Error, match="keys: name, where, mass, com, about_com"):
        with_gains(train, payload={"weight": 2})


def test_progress_is_told_and_can_stop_the_fit(arm, train) -> None:
    seen = []
    diffnea.identify(arm, train, progress=lambda p: seen.append((p.stage, p.rows)))
    assert seen
    assert all(isinstance(stage, str) for stage, _ in seen)

    stopped = diffnea.identify(
        arm,
        train,
        robust="cauchy",
        progress=lambda p: not (p.stage != "reading" or p.iteration > 0),
    )
    assert stopped.summary.interrupted


def test_an_exception_of_progress_comes_through(arm, train) -> None:
    def fail(_: diffnea.FitProgress) -> None:
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        diffnea.identify(arm, train, progress=fail)


@pytest.fixture(scope="module")
def seconds_of_20_runs(arm, train) -> float:
    start = time.monotonic()
    diffnea.identify(arm, [train] * 20, robust="cauchy")
    return time.monotonic() - start


def test_ctrl_c_ends_a_long_fit(arm, train, seconds_of_20_runs, ctrl_c_soon) -> None:
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        diffnea.identify(arm, [train] * 400, robust="cauchy")
    # To its end it would be twenty times as long as 20 runs.
    assert time.monotonic() - start < 1.0 + 5.0 * seconds_of_20_runs
