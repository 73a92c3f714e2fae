"""The paper's experiment as a study: its table, its page, and that it goes on where it was."""

import csv
import json
import signal
import subprocess
import sys
import time
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli import DONE, INTERRUPTED, ROOT, SECONDS, load
from cli import diffnea as run_command

import diffnea
from diffnea.reproduce import command, jobs, numbers, table, table1, work
from diffnea.reproduce.guess import wrong_guess
from diffnea.reproduce.jobs import Results, in_order, read_result_file
from diffnea.reproduce.page import write_page
from diffnea.reproduce.table1_command import options_of

ROBOT = table1.ROBOT
# Far too short to catch anything: what is tested is the same for any size.
TINY = (
    *("--models", "1", "--seeds", "2", "--chunk", "1", "--lengths", "0.40"),
    *("--simulated-lengths", "0.40", "--kinds", "nominal,diffnea", "--repetitions", "2"),
    *("--rope", "none", "--arm-seconds", "5", "--ball-seconds", "5", "--ball-repetitions", "1"),
    *("--search", "samples=16", "--search", "iterations=3"),
)


def reproduce(*arguments: object) -> int:
    return command.main([str(a) for a in arguments])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny study, interrupted by Ctrl-C when the first results are there, and then finished."""
    out: Path = tmp_path_factory.mktemp("study") / "table1"
    arguments = ["table1", "-o", out, *TINY, "--executor", "processes:2", "--quiet"]
    process = subprocess.Popen(
        [sys.executable, "-m", "diffnea.reproduce", *map(str, arguments)],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    until = time.monotonic() + 600
    while len(list((out / "results").glob("*.json"))) < 2 and time.monotonic() < until:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=SECONDS)
    assert process.returncode == INTERRUPTED, said
    assert "interrupted: the same command goes on" in said
    finished = {file: file.stat().st_mtime_ns for file in (out / "results").glob("*.json")}
    assert len(finished) >= 2
    assert reproduce(*arguments) == DONE
    assert {file: file.stat().st_mtime_ns for file in finished} == finished
    return out


def test_every_job_left_one_result(folder) -> None:
    args = command._parser().parse_args(["table1", "-o", str(folder), *TINY])
    study = in_order(table1.study(options_of(args)).jobs)
    results = Results(folder / "results")
    files = {file.name for file in results.folder.glob("*.json")}
    assert files == {f"{job.stem}.json" for job in study}
    # One robot a system, identified; two policies of each kind, one a job; nominal ones serve both.
    assert len(study) == 2 * 2 + (2 + 4) + 2 * 4 + 4
    transfer = next(job for job in study if job.name.startswith("transfer-A-40cm-diffnea"))
    assert [need.kind for need in transfer.needs] == ["learn_policies"]
    assert [need.kind for need in transfer.needs[0].needs] == ["identify"]


def test_nothing_is_computed_again(folder, capsys) -> None:
    before = {file: file.stat().st_mtime_ns for file in (folder / "results").iterdir()}
    runs = (folder / "runs.jsonl").read_text()
    assert reproduce("table1", "-o", folder, *TINY, "--executor", "processes:1") == DONE
    assert {file: file.stat().st_mtime_ns for file in (folder / "results").iterdir()} == before
    assert (folder / "runs.jsonl").read_text() == runs
    out, error = capsys.readouterr()
    assert "0 jobs" in error
    assert "surrogate A" in out


def test_the_table_counts_what_the_results_say(folder) -> None:
    written = load(folder / "table.json")
    assert [(r["system"], r["model"]) for r in written["rows"]] == [
        ("simulation", "nominal"),
        ("simulation", "diffnea"),
        ("A", "nominal"),
        ("A", "diffnea"),
    ]
    row = written["rows"][3]
    rewards = [
        policy["reward_wide"]
        for file in (folder / "results").glob("transfer-A-40cm-diffnea-*.json")
        for policy in load(file)["result"]["policies"]
    ]
    assert row["policies"] == row["asked"] == len(rewards) == 2
    assert row["all"]["reward"]["value"] == pytest.approx(np.mean(rewards), abs=1e-12)
    assert row["repeatability"]["repetitions"] == 2
    assert row["paper"] == {"reward": 1.77, "spread": 0.74, "transfer": 0.6, "repeatability": 0.9}
    assert written["cost"]["full"]["cpu_hours"] > 0

    lines = list(csv.DictReader((folder / "table.csv").read_text(encoding="utf-8").splitlines()))
    assert float(lines[3]["all.reward.value"]) == row["all"]["reward"]["value"]
    assert (folder / "table.tex").read_text(encoding="utf-8").count(r" \\") == 5


def test_the_table_keeps_its_schema(folder) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((ROOT / "docs/schema/table1.schema.json").read_text(encoding="utf-8"))
    jsonschema.validate(load(folder / "table.json"), schema)


def test_the_page_needs_nothing_else(folder) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Of all policies these are in the cup at the end" in page
    assert "http" not in page.replace("http-equiv", "")
    assert page.count("<figure>") == 1 + 4 + 1 + 1  # rewards, movements, the robot, lengths
    assert "models × policies" in page


def test_the_best_policy_is_what_is_repeated(folder) -> None:
    results = Results(folder / "results")
    for file in results.folder.glob("repeat-*.json"):
        content = load(file)
        rows = [
            policy
            for name in content["needs"]
            if name.startswith("transfer-")
            for policy in load(results.folder / name)["result"]["policies"]
        ]
        best = max(rows, key=lambda p: (p["success"], p["reward"]))
        assert content["result"]["seed"] == best["seed"]
        assert len(content["result"]["repetitions"]) == 2


def test_an_expected_reward_is_the_library_s_at_its_own_epsilon() -> None:
    learned = diffnea.learn(ROBOT, samples=16, iterations=2, lambda_slack=0.0, progress=False)
    (policy,) = learned.policies
    trace = learned.imagine()
    own = work.paper_reward(trace, policy, epsilon=policy.reward["epsilon"])
    assert own == pytest.approx(policy.expected, abs=1e-12)  # the same sums in another order


def test_a_recording_comes_back_from_its_file(folder) -> None:
    """Identified from it, the robot is the one that the job found."""
    results = Results(folder / "results")
    (record,) = results.folder.glob("record-A-*.json")
    (fit,) = results.folder.glob("identify-A-*.json")
    read = read_result_file(record)
    arm, ball = work.recording_of(read, "arm"), work.recording_of(read, "ball")
    assert arm.ball is None
    assert np.isnan(ball.ball).any()  # a camera slower than the joints
    assert np.isfinite(ball.ball).all(axis=1).sum() == 501
    robot = diffnea.identify_robot(ROBOT, arm, ball)
    found = load(fit)["result"]
    assert robot.model.to_dict()["ball"]["string"]["length"] == found["string"]


def test_identification_is_the_command_s(tmp_path) -> None:
    """Motions, recordings and fit of `diffnea experiment`, number by number."""
    world = f"mujoco:{ROBOT},perturb=A,seed=3,rope=none"
    run_command(
        *("experiment", "ball-in-cup", "--string", 0.4, "--world", world, "--seed", 5),
        *("--arm-seconds", 4, "--ball-seconds", 4, "--ball-repetitions", 2, "--samples", 4),
        *("--iterations", 1, "--seeds", 1, "--repetitions", 0, "-o", tmp_path, "--quiet"),
    )
    theirs = load(tmp_path / "identify-ball" / "model.json")["ball"]["string"]
    settings = {"model": ROBOT, "string": 0.4}
    record = {"world": world, "seed": 5, "arm_seconds": 4.0, "ball_seconds": 4.0, "repetitions": 2}
    output = work.record(settings | record, [])
    (tmp_path / "record.json").write_text(
        json.dumps({"schema": "diffnea/job/1", "result": output.data}), encoding="utf-8"
    )
    np.savez(tmp_path / "record.npz", **output.arrays)
    read = read_result_file(tmp_path / "record.json")
    ours = work.identify(settings, [read]).data["model"]["ball"]["string"]
    # The command's model comes from a description without a string's length of its own.
    assert ours["length"] == pytest.approx(theirs["length"], abs=1e-9)
    np.testing.assert_allclose(ours["attachment"], theirs["attachment"], atol=1e-9)


def test_a_wrong_guess_is_possible_and_wrong() -> None:
    model = diffnea.load_model(ROBOT)
    for seed in range(20):
        guess = wrong_guess(model, seed).to_dict()
        assert guess != model.to_dict()
        assert guess == wrong_guess(model, seed).to_dict()
        for link in guess["links"][1:]:
            mass = link["inertia"]["mass"]
            centre = np.array(link["inertia"]["first_moment"]) / mass
            xx, xy, xz, yy, yz, zz = link["inertia"]["about_origin"]
            about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            about -= mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
            a, b, c = np.linalg.eigvalsh(about)
            assert mass > 0
            assert a > 0
            assert a + b > c  # a distribution of mass can have these moments


def test_intervals_know_that_policies_of_a_model_are_alike() -> None:
    # Ten models whose ten policies do the same: as good as ten policies.
    alike = [[k % 2 == 0] * 10 for k in range(10)]
    mixed = [[k % 2 == 0 for k in range(10)]] * 10
    wide, narrow = numbers.share(alike), numbers.share(mixed)
    assert wide.value == narrow.value == 0.5
    assert wide.high - wide.low > 0.5  # of ten values: ±31 points
    assert narrow.high - narrow.low < 0.25  # of a hundred: ±10
    none = numbers.share([[False] * 10] * 2)
    assert none.low == 0.0
    assert none.high == pytest.approx(0.161, abs=1e-3)  # Wilson, 0 of 20
    assert numbers.wilson(3, 4).low == pytest.approx(0.301, abs=1e-3)


def test_the_best_are_chosen_in_each_model() -> None:
    rows = [{"expected": value} for value in (1.0, None, 3.0, 2.0)]
    assert [row["expected"] for row in numbers.best(rows, "expected", 2)] == [3.0, 2.0]
    assert numbers.best(rows, "expected", 9)[-1]["expected"] is None


def test_studies_are_listed(capsys) -> None:
    assert reproduce("--list") == DONE
    assert "table1" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--kinds", "magic"), "choices: lstm, ff-nn, nominal, diffnea"),
        (("--seeds", "0"), "expected 1 or more"),
        (("--page-only", "--seeds", "1001"), "expected 1000 at most"),
        (("--page-only", "--chunk", "0"), "--chunk: got 0, expected 1 or more"),
        (("--search", "samples"), "expected KEY=VALUE"),
        (("--search", "rate=250"), "--search rate: is the study's own"),
        (("--search", "seeds=3"), "--search seeds: is the study's own"),
        (("--executor", "abacus"), "choices: processes"),
    ],
)
def test_mistakes_are_named(tmp_path, capsys, words, message) -> None:
    assert reproduce("table1", "-o", tmp_path, *words) == 1
    assert message in capsys.readouterr().err


def test_ranges_of_one_s_own_are_told_apart_by_what_they_say(tmp_path, monkeypatch) -> None:
    """A study that finds results of other ranges under the same name must not take them."""

    def described(file: str) -> list[jobs.Job]:
        options = replace(
            table1.QUICK, models=1, seeds=1, kinds=("nominal", "diffnea"), surrogates=(file,)
        )
        return in_order(table1.study(options).jobs)

    monkeypatch.chdir(tmp_path)
    Path("mine").mkdir()
    stems = []
    for file, com in (("mine/robot.json", 0.05), ("mine/robot.json", 0.1), ("robot.json", 0.2)):
        ranges = {"schema": "diffnea/surrogate/1", "summary": "mine", "com": com}
        Path(file).write_text(json.dumps(ranges), encoding="utf-8")
        found = described(file)
        assert not any("/" in job.name for job in found)
        assert len({job.name for job in found}) == len(found)
        in_world = [job for job in found if file in job.settings.get("world", "")]
        assert {job.kind for job in in_world} == {"record", "transfer_policies", "repeat_best"}
        stems.append({job.stem for job in in_world})
    assert not stems[0] & stems[1]
    assert not stems[1] & stems[2]
    # Those that no robot of these ranges went into are shared.
    assert any(job.kind == "learn_policies" and not job.needs for job in found)


def test_an_output_that_is_a_file_is_refused(tmp_path, capsys) -> None:
    (tmp_path / "file").touch()
    assert reproduce("table1", "-o", tmp_path / "file", "--page-only") == command.BAD_INPUT
    assert str(tmp_path / "file") in capsys.readouterr().err


def test_a_table_of_worlds_that_all_failed_can_be_read(tmp_path) -> None:
    """Their solver gave up: no reward, no path, nothing to repeat, and a page all the same."""
    described = table1.study(
        replace(table1.QUICK, models=1, seeds=1, kinds=("nominal",), repetitions=0)
    )
    results = Results(tmp_path)
    failed = {
        "seed": 1000, "expected": 1.0, "expected_wide": 1.0, "solved": False, "rollouts": 1,
        "outcome": "failed", "text": "", "reward": None, "reward_wide": None,
        "failure": "MuJoCo: bad acceleration", "success": False, "path_error": None,
    }  # fmt: skip
    for job in described.jobs:
        if job.kind in ("transfer_policies", "repeat_best"):
            content = {
                "schema": jobs.SCHEMA, "result": {"policies": [failed], "repetitions": []},
                "seconds": 1.0, "cpu_seconds": 1.0, "build": "", "host": "",
            }  # fmt: skip
            results.file(job).write_text(json.dumps(content), encoding="utf-8")
    written = table.table_of(described, results)
    written["cost"] = table.cost_of(described, described, results) | {"runs": []}
    written["failed"] = {}
    assert written["cost"]["full"]["not_measured"] == ["learn_policies", "repeat_best"]
    assert [table.cells(row)[3] for row in written["rows"]] == ["–", "–"]
    assert [row["outcomes"] for row in written["rows"]] == [{"failed": 1}] * 2
    assert "–" in table.table_text(written)
    assert "reward" in table.table_tex(written)
    write_page(tmp_path / "report.html", described, written, results)


def test_a_page_of_nothing_is_a_page(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(work, "missing_for_networks", lambda: "not run: torch is not installed")
    assert reproduce("table1", "-o", tmp_path, "--kinds", "lstm", "--page-only") == DONE
    assert "Nothing was transferred yet" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_networks_without_pytorch_are_said_to_be_missing(monkeypatch) -> None:
    monkeypatch.setattr(work, "missing_for_networks", lambda: "not run: torch is not installed")
    rows = table1.study(table1.QUICK).rows
    assert [row.not_run for row in rows[:2]] == ["not run: torch is not installed"] * 2
    assert not rows[0].units
    assert rows[2].units


def test_networks_are_given_what_white_box_models_did(monkeypatch) -> None:
    monkeypatch.setattr(work, "missing_for_networks", lambda: "")
    rows = {(r.system, r.kind): r for r in table1.study(table1.QUICK).rows}
    (unit,) = rows["A", "lstm"].units
    assert unit.trained is not None
    given = [need.name for need in unit.trained.needs]
    assert given == [
        "identify-A-40cm-m00",
        "record-A-40cm-m00",
        "transfer-A-40cm-diffnea-m00-s000",
        "transfer-A-40cm-nominal-m00-s000",
    ]


def test_networks_see_the_recording_and_what_policies_did(tmp_path, monkeypatch) -> None:
    def result(name: str, output: jobs.Output) -> jobs.Result:
        path = tmp_path / f"{name}.json"
        content = {"schema": jobs.SCHEMA, "result": jobs.plain(output.data)}
        path.write_text(json.dumps(content), encoding="utf-8")
        np.savez(path.with_suffix(".npz"), **output.arrays)
        return jobs.read_result_file(path)

    settings = {"model": ROBOT, "string": 0.4, "seed": 1, "training": {"batch": 8}}
    search = {"samples": 4, "iterations": 1}
    world = f"mujoco:{ROBOT},perturb=A,rope=none,seed=1"
    model = diffnea.load_model(ROBOT)
    learned = result(
        "learn", work.learn_policies(settings | {"seeds": [1, 2], "search": search}, [])
    )
    executed = result("transfer", work.transfer_policies(settings | {"world": world}, [learned]))
    hanging = diffnea.Recording(
        time=[0.0, 0.01], q=[[0.0, 0.6, 0.0, 1.25]] * 2, ball=np.zeros((2, 3)),
        joint_names=model.joint_names,
    )  # fmt: skip
    arrays = work._arrays_of("ball", hanging)
    described = {"ball": {"joints": hanging.joint_names, "period": None}}
    recorded = result("record", jobs.Output(described, arrays))
    identified = result("identify", jobs.Output({"model": model.to_dict()}))
    given = {}

    class Network:
        def to_dict(self):
            return {"kind": "lstm"}

    def train(kind, recordings, model, **options):
        given.update(options, kind=kind, recordings=recordings, model=model)
        return Network()

    stand_in = types.SimpleNamespace(train=train, TrainOptions=dict)  # PyTorch may not be there
    monkeypatch.setattr(work, "blackbox", stand_in)
    output = work.train_network(settings | {"kind": "lstm"}, [identified, recorded, executed])
    assert output.data["network"] == {"kind": "lstm"}
    assert given["kind"] == "lstm"
    assert given["options"] == {"batch": 8}
    first, *others = given["recordings"]
    assert len(first.time) == 2
    assert len(others) == 2
    (policy, _) = work.policies_of(learned)
    again = diffnea.transfer(policy, f"{world},nominal_string=0.4", repetitions=0)
    trace = again.executions[0].trace
    np.testing.assert_allclose(others[0].time, trace.time, atol=1e-12)
    q = np.stack([trace[f"q_{joint}"] for joint in model.joint_names], axis=1)
    np.testing.assert_allclose(others[0].q, q, atol=3e-7)  # float32 of radians
    seen = np.isfinite(others[0].ball).all(axis=1)
    assert seen.tolist() == [k % 5 == 0 for k in range(len(seen))]  # the camera's 100 Hz
    np.testing.assert_allclose(others[0].ball[seen], trace.points("ball")[::5], atol=3e-7)
