import json
import pickle
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import whole_files
from cli import SECONDS, done
from planar_arm import recorded

import diffnea

COULOMB = 0.4


@pytest.fixture(scope="module")
def stiff_arm(arm) -> diffnea.Model:
    return arm.with_effects([diffnea.Effect("coulomb_friction", "elbow", {"coulomb": COULOMB})])


@pytest.fixture(scope="module")
def train(stiff_arm) -> diffnea.Recording:
    return recorded(stiff_arm, 11)


@pytest.fixture(scope="module")
def held_out(stiff_arm) -> diffnea.Recording:
    return recorded(stiff_arm, 12)


@pytest.fixture(scope="module")
def finding(arm, train, held_out) -> diffnea.Finding:
    return diffnea.diagnose(arm, train, test=held_out)


def without_time(result: dict) -> dict:
    skipped = ("reproduce", "summary")
    return {key: value for key, value in result.items() if key not in skipped}


def test_the_cause_is_named_with_its_size(finding) -> None:
    assert finding.verdict == "NAMED"
    assert "oulomb friction at elbow" in finding.sentence
    [cause] = finding.causes
    assert (cause.effect, cause.where, cause.verdict) == ("coulomb_friction", "elbow", "NAMED")
    assert cause.members == []
    [coulomb] = [p for p in cause.parameters if p.name == "coulomb"]
    assert coulomb.unit == "N*m"
    assert coulomb.low < coulomb.value < coulomb.high
    # At 1.96 standard errors the interval would miss one time in 20; the seed is fixed.
    assert abs(coulomb.value - COULOMB) < 4 * coulomb.std
    assert cause.delta_bic > 10
    assert cause.gain.low > 0
    assert finding.gain.after < finding.gain.before
    assert finding.held_out == "test recording"
    assert finding.base == "refit"
    assert finding.candidates[0].effect in {"coulomb_friction", "asymmetric_coulomb"}
    assert not finding.interrupted


def test_the_error_falls_at_the_joint(finding) -> None:
    shoulder, elbow = finding.joints
    assert (shoulder.joint, elbow.joint) == ("shoulder", "elbow")
    assert elbow.extended < 0.5 * elbow.base
    for joint, series in zip(finding.joints, finding.series, strict=True):
        assert series.joint == joint.joint
        shapes = {getattr(series, name).shape for name in ("time", "q", "qd", "qdd", "extended")}
        assert shapes == {series.measured.shape}
        # The figures leave out a tenth of the rows: those at rest, where dry friction is the most
        # that is left, and those after the ends of stretches. At a joint without it, they are like
        # the others.
        base, extended = (
            np.sqrt(np.mean((series.measured - values) ** 2))
            for values in (series.base, series.extended)
        )
        assert base == pytest.approx(joint.base, rel=0.1)
        assert 0.5 * extended < joint.extended <= 1.1 * extended


def test_the_extended_model_holds_the_cause(finding, arm) -> None:
    [effect] = finding.model.effects
    assert (effect.effect, effect.where) == ("coulomb_friction", "elbow")
    [cause] = finding.causes
    assert effect.parameters["coulomb"] == cause.parameters[0].value
    again = diffnea.Model.from_dict(finding.model.to_dict())
    assert again == finding.model
    assert finding.parameters["upper.hx"].name == "upper.hx"


def test_arrays_frames_and_files_give_the_numbers_of_the_command(
    arm, train, held_out, finding, tmp_path: Path
) -> None:
    arm.save(tmp_path / "arm.json")
    diffnea.write_recording(train, tmp_path / "train.csv")
    diffnea.write_recording(held_out, tmp_path / "test.csv")
    done("diagnose", "arm.json", "train.csv", "--test", "test.csv", "-o", "run", cwd=tmp_path)
    expected = json.loads((tmp_path / "run/result.json").read_text())
    found = [
        finding,
        diffnea.diagnose(
            tmp_path / "arm.json", tmp_path / "train.csv", test=[tmp_path / "test.csv"]
        ),
    ]
    if hasattr(train, "to_frame"):
        pytest.importorskip("pandas")
        found.append(diffnea.diagnose(arm, train.to_frame(), test=held_out.to_frame()))
    for one in found:
        got = one.to_dict()
        assert got.keys() == expected.keys()
        assert without_time(got) == without_time(expected)
    assert [item["role"] for item in found[1].to_dict()["reproduce"]["inputs"]] == [
        "model",
        "data",
        "test",
    ]


def test_a_saved_finding_is_what_the_command_leaves(finding, tmp_path: Path) -> None:
    finding.save(tmp_path / "run")
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert names >= {"result.json", "series.json", "model.json"}
    assert json.loads((tmp_path / "run/result.json").read_text()) == finding.to_dict()
    assert diffnea.load_model(tmp_path / "run/model.json").effects == finding.model.effects
    with pytest.raises(diffnea.FileError):
        finding.save("/proc/nowhere")
    (tmp_path / "run/result.json").write_text('{"schema": "diffnea/identify/1"}')
    with pytest.raises(diffnea.FileError, match="holds another command's result"):
        finding.save(tmp_path / "run")


def test_findings_are_values(finding) -> None:
    back = pickle.loads(pickle.dumps(finding))
    assert back.to_dict() == finding.to_dict()
    assert back.model == finding.model
    np.testing.assert_array_equal(back.series[1].extended, finding.series[1].extended)
    np.testing.assert_array_equal(back.noise, finding.noise)
    assert pickle.loads(pickle.dumps(finding.causes[0])).effect == "coulomb_friction"
    json.dumps(finding.to_dict(), allow_nan=False)
    assert finding.to_dict()["schema"] == "diffnea/diagnose/1"
    assert repr(finding).startswith("Finding('planar': NAMED. ")
    assert "coulomb friction" in str(finding)
    assert repr(finding.causes[0]).startswith("Cause(effect='coulomb_friction', where='elbow'")
    page = finding._repr_html_()
    assert page.count("<table>") == 2
    assert "coulomb_friction" in page


def test_nothing_hidden_is_nothing_named(arm) -> None:
    finding = diffnea.diagnose(arm, recorded(arm, 13), test=recorded(arm, 14))
    assert (finding.verdict, finding.causes) == ("NONE", [])
    assert finding._repr_html_().count("<table>") == 1
    assert finding.model.effects == []


def hum(time: np.ndarray, phase: float) -> np.ndarray:
    return 0.1 * np.sin(2 * np.pi * 2.7 * time + phase)


def blows(time: np.ndarray, phase: float) -> np.ndarray:
    at = phase + np.array([1.3, 3.7, 7.1])
    return np.exp(-0.5 * ((time[:, None] - at) / 0.06) ** 2).sum(axis=1)


@pytest.mark.parametrize(
    ("disturbance", "form", "words"),
    [(hum, "oscillation", "oscillates at 2.7"), (blows, "bursts", "comes in bursts")],
)
def test_what_goes_with_no_motion_is_no_noise(arm, disturbance, form, words) -> None:
    def disturbed(seed: int) -> diffnea.Recording:
        recording = recorded(arm, seed)
        tau = recording.tau.copy()
        tau[:, 1] += disturbance(recording.time, 0.1 * seed)
        return diffnea.Recording(
            time=recording.time, q=recording.q, tau=tau, joint_names=recording.joint_names
        )

    finding = diffnea.diagnose(arm, disturbed(13), test=disturbed(14))
    assert finding.verdict == "UNKNOWN"
    assert words in finding.sentence
    [witness] = finding.witness
    assert (witness.where, witness.variables, witness.form) == ("elbow", ["time"], form)
    if form == "oscillation":
        # An eighth of a bin of a window of half of the ten seconds.
        assert witness.frequency == pytest.approx(2.7, abs=0.025)


def test_without_a_test_recording_blocks_of_time_are_held_out(arm, train) -> None:
    finding = diffnea.diagnose(arm, train, effects=["coulomb_friction", "cogging@elbow"])
    assert finding.held_out == "time blocks"
    tried = {(c.effect, c.where) for c in finding.candidates}
    assert ("cogging", "elbow") in tried
    assert ("cogging", "shoulder") not in tried
    assert [c.where for c in finding.causes] == ["elbow"]


def test_the_posterior_of_a_fit_is_a_prior(arm, train, held_out) -> None:
    fitted = diffnea.identify(arm, recorded(arm, 15), effects=[]).model
    finding = diffnea.diagnose(fitted, train, test=held_out)
    assert finding.base == "prior"
    assert ("coulomb_friction", "elbow") in [(c.effect, c.where) for c in finding.causes]


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"base": "none"}, diffnea.Error, "base: got 'none'; choices: auto, fixed, prior, refit"),
        ({"base": "prior"}, diffnea.ModelError, "no posterior"),
        ({"effects": ["magic"]}, diffnea.ModelError, r"(?s)magic.*coulomb_friction"),
        ({"effects": []}, diffnea.Error, "effects: got none"),
        ({"effects": ["cogging@wrist"]}, diffnea.ModelError, "wrist"),
    ],
)
def test_wrong_options_are_answered_with_the_choices(arm, train, options, error, message) -> None:
    with pytest.raises(error, match=message):
        diffnea.diagnose(arm, train, **options)


def test_training_data_cannot_be_held_out(arm, train) -> None:
    with pytest.raises(diffnea.DataError, match="held-out data must be other recordings"):
        diffnea.diagnose(arm, train, test=train)


def test_plot_draws_the_joints_of_the_causes(finding) -> None:
    pytest.importorskip("matplotlib")
    torque, error = finding.plot().axes
    assert torque.get_ylabel() == "elbow [N·m]"
    before, after = error.lines
    elbow = finding.series[1]
    np.testing.assert_array_equal(before.get_xdata(), elbow.qd)
    np.testing.assert_array_equal(before.get_ydata(), elbow.measured - elbow.base)
    np.testing.assert_array_equal(after.get_ydata(), elbow.measured - elbow.extended)
    assert len(finding.plot(joints=["shoulder", "elbow"]).axes) == 4
    with pytest.raises(diffnea.Error, match=r"got \['wrist'\]; choices: shoulder, elbow"):
        finding.plot(joints=["wrist"])


def test_plot_without_matplotlib_says_what_to_install(finding, tmp_path: Path) -> None:
    (tmp_path / "finding.pickle").write_bytes(pickle.dumps(finding))
    code = f"""
import pickle, sys
sys.modules["matplotlib"] = sys.modules["matplotlib.figure"] = None
finding = pickle.load(open({str(tmp_path / "finding.pickle")!r}, "rb"))
try:
    finding.plot()
except ImportError as error:
    print(error)
"""
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "Finding.plot needs matplotlib; install it with: " in answer.stdout
    assert "-m pip install 'matplotlib>=" in answer.stdout


def test_progress_is_told_and_can_stop(arm, train) -> None:
    seen = []
    diffnea.diagnose(arm, train, progress=lambda p: seen.append(p.stage))
    assert "reading" in seen
    assert "testing" in seen

    stopped = diffnea.diagnose(arm, train, progress=lambda p: p.stage != "testing")
    assert stopped.interrupted
    assert stopped.causes == []


def test_once_stopped_it_is_not_asked_again(arm, train) -> None:
    told: list[str] = []

    def stages(stop_at: int) -> list[str]:
        told.clear()
        finding = diffnea.diagnose(
            arm, train, progress=lambda at: told.append(at.stage) or len(told) < stop_at
        )
        assert finding.interrupted == (len(told) >= stop_at)
        return [*told]

    whole = stages(10**6)
    assert len(whole) > 2
    for stop_at in range(1, len(whole) + 1):
        assert stages(stop_at) == whole[:stop_at]


def test_an_exception_of_progress_comes_through(arm, train) -> None:
    def fail(_: diffnea.FitProgress) -> None:
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        diffnea.diagnose(arm, train, progress=fail)


def test_ctrl_c_ends_it(arm, train, ctrl_c_soon) -> None:
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        while time.monotonic() - start < SECONDS:  # as many as it takes
            diffnea.diagnose(arm, train)


def test_other_threads_run_meanwhile(arm, train) -> None:
    ticks = 0
    done_event = threading.Event()

    def work() -> None:
        diffnea.diagnose(arm, train)
        done_event.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done_event.wait(0.001):
        ticks += 1
    thread.join()
    assert ticks > 5  # with the lock held there would be none


def test_how_long_the_simulation_follows_before_and_after(finding, tmp_path: Path) -> None:
    motion = finding.simulated
    assert motion.reason == ""
    assert motion.extended_follows > motion.base_follows
    shoulder, elbow = motion.joints
    assert (shoulder.joint, elbow.joint, elbow.unit) == ("shoulder", "elbow", "rad")
    assert elbow.extended_follows > elbow.base_follows
    # The first joint to leave its tolerance decides.
    assert motion.base_follows == pytest.approx(min(s.base_follows for s in motion.joints))
    lengths = [h.horizon for h in motion.horizons]
    assert lengths == sorted(lengths)
    first = motion.horizons[0]
    assert first.base == pytest.approx(
        max(e / s.tolerance for e, s in zip(first.base_rmse, motion.joints, strict=True))
    )
    assert finding.sentence.startswith("Your simulation ")
    assert str(finding).startswith(finding.sentence.split(". ")[0])
    finite = np.isfinite(elbow.base)
    error = np.sqrt(np.mean((elbow.measured - elbow.base)[finite] ** 2))
    # Thinned, and without the last value of each window.
    assert error == pytest.approx(elbow.base_rmse, rel=0.1)
    stored = finding.to_dict()["simulated"]
    assert stored["joints"][1]["rmse_base"] == pytest.approx(elbow.base_rmse)
    assert stored["follows"]["base"] == pytest.approx(motion.base_follows)
    assert [h["horizon"] for h in stored["horizons"]] == lengths
    finding.save(tmp_path / "run")
    series = json.loads((tmp_path / "run/series.json").read_text())["simulated"]
    assert [s["joint"] for s in series] == ["shoulder", "elbow"]
    assert len(series[1]["time"]) == len(elbow.time)


def sticky(t: np.ndarray, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Friction that grows with the position of the other joint: none of the catalogue."""
    return np.tanh(qd[:, 1] / 0.05) * q[:, 0] ** 2


STICKY = diffnea.Candidate(
    "sticky", "elbow", sticky, {"friction": "N*m/rad^2"}, signs={"friction": "nonnegative"}
)


def with_sticky_friction(recording: diffnea.Recording, size: float) -> diffnea.Recording:
    """Add what the robot would have needed more for the same motion.

    Held torques act from row to row, so theirs is the motion half a row later.
    """
    between = 0.5 * (recording.q[:-1] + recording.q[1:])
    velocity = np.diff(recording.q, axis=0) / np.diff(recording.time)[:, None]
    tau = recording.tau.copy()
    smooth = np.stack([np.convolve(v, np.ones(9) / 9, mode="same") for v in velocity.T], -1)
    tau[:-1, 1] += size * sticky(recording.time[:-1], between, smooth, smooth)
    return diffnea.Recording(
        time=recording.time, q=recording.q, tau=tau, joint_names=recording.joint_names
    )


def test_an_own_candidate_is_named(arm) -> None:
    train, test = (with_sticky_friction(recorded(arm, seed), 0.5) for seed in (21, 22))
    finding = diffnea.diagnose(arm, train, test=test, candidates=[STICKY])
    assert ("sticky", "elbow") in [(c.effect, c.where) for c in finding.causes]
    own = next(c for c in finding.causes if c.effect == "sticky")
    [size] = own.parameters
    assert (size.name, size.unit) == ("friction", "N*m/rad^2")
    # The velocity that hid it is that of the noisy positions: its sign turns later by some ms.
    assert size.value == pytest.approx(0.5, rel=0.1)
    assert any("sticky" in note for note in finding.notes)
    assert "sticky" in finding.sentence
    assert all(e.effect != "sticky" for e in finding.model.effects)


def held_by_a_magnet(arm: diffnea.Model, seed: int, size: float) -> diffnea.Recording:
    """Record an arm with a magnet at the elbow, which no friction explains.

    The motion repeats: without that, noise is what the model leaves, and so is the magnet.
    """
    motion = diffnea.excite(arm, duration=20, period=5, seed=seed)
    recording = diffnea.simulate(arm, motion, noise=0.2, seed=seed, period=5).recording
    tau = recording.tau.copy()
    off = (recording.q[:, 1] - 0.3) / 0.2
    tau[:, 1] += size * off * np.exp(-(off**2))
    return diffnea.Recording(
        time=recording.time,
        q=recording.q,
        tau=tau,
        joint_names=recording.joint_names,
        period=5,
    )


def test_what_has_no_name_is_learned_and_goes_with_the_model(arm, tmp_path: Path) -> None:
    train, test = tmp_path / "train.csv", tmp_path / "test.csv"
    for seed, path in enumerate((train, test), start=31):
        diffnea.write_recording(held_by_a_magnet(arm, seed, 0.5), path)
    frictions = ["coulomb_friction", "viscous_friction"]
    finding = diffnea.diagnose(arm, train, test=test, effects=frictions)
    assert finding.verdict == "UNKNOWN"
    box = next(g for g in finding.grey_box if g.where == "elbow")
    assert box.after < 0.5 * box.before
    assert len(box.torque) == np.prod([len(values) for values in box.at])
    assert any((c.effect, c.verdict) == ("residual", "UNKNOWN") for c in finding.causes)

    [learned] = [e for e in finding.model.effects if e.where == "elbow" and e.effect == "residual"]
    assert learned.table is not None
    assert learned.table["variables"] == box.variables
    assert pickle.loads(pickle.dumps(learned)) == learned
    finding.save(tmp_path / "RUN")
    whole_files.check(tmp_path / "RUN")
    again = diffnea.load_model(tmp_path / "RUN" / "model.json")
    assert [e.table for e in again.effects] == [e.table for e in finding.model.effects]
    result = json.loads((tmp_path / "RUN" / "result.json").read_text())
    assert [g["bound"] for g in result["grey_box"]] == [g.bound for g in finding.grey_box]

    without = diffnea.diagnose(arm, train, test=test, effects=frictions, grey_box=False)
    assert without.verdict == "UNKNOWN"
    assert without.grey_box == []
    assert without.gain.after > finding.gain.after
    assert not any(e.effect == "residual" for e in without.model.effects)


def test_an_own_candidate_that_does_not_act_is_not_named(arm) -> None:
    finding = diffnea.diagnose(arm, recorded(arm, 13), test=recorded(arm, 14), candidates=[STICKY])
    assert finding.verdict == "NONE"


def failing(*_: np.ndarray) -> np.ndarray:
    raise ZeroDivisionError("by nothing")


@pytest.mark.parametrize(
    ("candidate", "message"),
    [
        (diffnea.Candidate("odd", "elbow", failing), r"'odd'.*ZeroDivisionError: by nothing"),
        (diffnea.Candidate("odd", "elbow", lambda t, *_: t[:-1]), r"'odd'.*shape"),
        (diffnea.Candidate("odd", "elbow", lambda t, *_: np.full(len(t), np.nan)), "'odd'.*NaN"),
        (diffnea.Candidate("odd", "elbow", lambda *_: "much"), "'odd'.*numbers"),
        (diffnea.Candidate("odd", "knee", sticky), "shoulder"),
        (diffnea.Candidate("cogging", "elbow", sticky), "catalogue"),
        (diffnea.Candidate("odd", "elbow", sticky, {"k": "1"}, {"k": "up"}), "nonnegative"),
        (diffnea.Candidate("odd", "elbow", sticky, {"k": "1"}, {"c": "free"}), "parameters: k"),
    ],
)
def test_an_own_candidate_that_cannot_be_used_is_refused(arm, train, candidate, message) -> None:
    with pytest.raises(diffnea.Error, match=message):
        diffnea.diagnose(arm, train, candidates=[candidate])
