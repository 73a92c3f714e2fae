"""Closed linkages identified from torques of their drives; data by Lagrange's equation."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli import done, load
from planar_linkage import FIVE_BAR, FOUR_BAR, Linkage, described

import diffnea as package

NOISE = 0.05  # [N·m]
SEEDS = 20


def moves(linkage: Linkage, seed: int) -> package.Recording:
    """Ten seconds of random Fourier series of the drives, with the torque they need."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 10, 0.005)
    q, qd, qdd = linkage.moves(rng, t, 5.0, 4, 1.2 if linkage.drives == 1 else 0.3)
    tau = np.zeros((len(t), len(linkage.bars)))
    tau[:, : linkage.drives] = linkage.torques(q, qd, qdd) + NOISE * rng.normal(size=q.shape)
    names = [f"j{i + 1}" for i in range(len(linkage.bars))]
    return package.Recording(
        time=t,
        q=linkage.joints(q),
        tau=tau,
        joint_names=names,
        torque_side="link",
        passive=names[linkage.drives :],
    )


@pytest.mark.parametrize("linkage", [FOUR_BAR, FIVE_BAR], ids=["four-bar", "five-bar"])
def test_torques_of_the_drives_are_lagrange_s(linkage: Linkage, tmp_path: Path) -> None:
    """The library's inverse dynamics, and the generator's: no code in common."""
    truth, _ = map(package.load_model, described(tmp_path, linkage))
    driven = list(truth.joint_names)[: linkage.drives]
    rng = np.random.default_rng(1)
    n = len(linkage.bars)
    centre = np.array([-1.1] if linkage.drives == 1 else [-1.6, 1.2])
    q = centre + 0.2 * rng.normal(size=(20, linkage.drives))
    qd, qdd = rng.normal(size=(2, 20, linkage.drives))
    joints = linkage.joints(q)
    pad = ((0, 0), (0, n - linkage.drives))
    v = package.project_velocities(truth, q=joints, qd=np.pad(qd, pad), held=driven)
    a = package.project_accelerations(truth, q=joints, qd=v, qdd=np.pad(qdd, pad), held=driven)
    found = package.driven_torques(truth, q=joints, qd=v, qdd=a, driven=driven)
    # The generator differentiates by differences: 1e-7 of torques of 20 N·m.
    np.testing.assert_allclose(found, linkage.torques(q, qd, qdd), atol=1e-5)


@pytest.mark.parametrize("linkage", [FOUR_BAR, FIVE_BAR], ids=["four-bar", "five-bar"])
def test_base_parameters_lie_in_their_intervals(linkage: Linkage, tmp_path: Path) -> None:
    """Truth lies in 90 to 98 % of the 95 % intervals of 20 recordings."""
    truth, wrong = map(package.load_model, described(tmp_path, linkage))
    value = dict(
        zip(
            (
                f"bar{i + 1}.{name}"
                for i in range(len(linkage.bars))
                for name in ("mass", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
            ),
            truth.inertial_parameters,
            strict=True,
        )
    )
    inside = count = 0
    for seed in range(SEEDS):
        result = package.identify(wrong, moves(linkage, seed), effects=[])
        assert result.summary.converged
        names = [p.name for p in result.parameters]
        for base in result.base_parameters:
            true = sum(
                c * value[names[k]] for k, c in zip(base.columns, base.coefficients, strict=True)
            )
            count += 1
            inside += abs(base.value - true) <= 1.96 * base.std
    assert count == SEEDS * (8 if linkage.drives == 1 else 11)
    assert 0.90 <= inside / count <= 0.98


@pytest.mark.parametrize("linkage", [FOUR_BAR, FIVE_BAR], ids=["four-bar", "five-bar"])
def test_passive_joints_need_no_encoder(linkage: Linkage, tmp_path: Path) -> None:
    """Their positions follow from the drives': the fit is that of a log that has them."""
    _, wrong = map(package.load_model, described(tmp_path, linkage))
    full, n = moves(linkage, 1), linkage.drives
    driven = package.Recording(
        time=full.time,
        q=full.q[:, :n],
        tau=full.tau[:, :n],
        joint_names=full.joint_names[:n],
        torque_side="link",
    )
    of_all, of_driven = (package.identify(wrong, r, effects=[]) for r in (full, driven))
    assert len(of_all.base_parameters) == len(of_driven.base_parameters)
    for a, b in zip(of_all.base_parameters, of_driven.base_parameters, strict=True):
        assert a.columns[0] == b.columns[0]
        assert abs(a.value - b.value) < 0.01 * a.std  # loops close to 1e-9 m
    package.write_recording(driven, tmp_path / "log.csv")
    done("audit", tmp_path / "log.csv", "--model", tmp_path / "wrong.xml")
    done("identify", tmp_path / "wrong.xml", tmp_path / "log.csv", "-o", tmp_path / "run")
    notes = load(tmp_path / "run" / "result.json")["preprocessing"]["notes"]
    assert any("follow from the other joints'" in note for note in notes)


def test_positions_that_no_loop_has_are_refused(tmp_path: Path) -> None:
    """A crank is logged where a linkage that cannot turn right round does not reach."""
    long = replace(FOUR_BAR.bars[0], length=0.6)
    (tmp_path / "rocker.xml").write_text(
        replace(FOUR_BAR, bars=(long, *FOUR_BAR.bars[1:])).mjcf()
    )
    t = np.arange(0, 10, 0.005)
    q = np.where(t < 4.9975, -1.1 + 0.3 * np.sin(t), 3.1)[:, None]
    log = package.Recording(time=t, q=q, tau=np.cos(t)[:, None], joint_names=["j1"])
    with pytest.raises(package.DataError, match=r"at 5 s the loops of 'linkage' do not close"):
        package.identify(package.load_model(tmp_path / "rocker.xml"), log)


def cart_moves(seed: int, path: Path) -> tuple[package.Model, package.Recording, dict[str, float]]:
    """A cart on two wheels and a base of x, y and yaw, ridden by its equation of motion.

    Forward speed v and yaw rate w of the axle's middle, the wheels' halves b apart, radius r:
    A v' - h w² = F and C w' + h w v = T, h the first moment ahead of the axle.
    """
    r, b, mass, ahead, turn, spin = 0.1, 0.2, 8.0, 0.04, 0.3, 0.0025
    wheel = 0.5
    a = mass + 2 * wheel + 2 * spin / r**2
    c = turn + mass * ahead**2 + 2 * (0.0013 + wheel * b**2) + 2 * spin * (b / r) ** 2
    rng = np.random.default_rng(seed)
    f, phase = 2 * np.pi * rng.uniform(0.2, 1.2, (2, 4, 1)), rng.uniform(0, 6, (2, 4, 1))
    step = 5e-4
    t = np.arange(0, 20, step)
    (v, w), (dv, dw) = (
        np.array([[0.15], [0.4]]) * np.sin(f * t + phase).sum(1),
        np.array([[0.15], [0.4]]) * (f * np.cos(f * t + phase)).sum(1),
    )
    force, moment = a * dv - mass * ahead * w**2, c * dw + mass * ahead * w * v
    tau = np.stack([force * r / 2 - moment * r / (2 * b), force * r / 2 + moment * r / (2 * b)], 1)

    def integral(x: np.ndarray) -> np.ndarray:
        return np.concatenate([[0.0], np.cumsum(0.5 * step * (x[1:] + x[:-1]))])

    yaw = integral(w)
    q = np.stack(
        [integral(v * np.cos(yaw)), integral(v * np.sin(yaw)), yaw,
         integral(v - b * w) / r, integral(v + b * w) / r], 1
    )[::10]  # fmt: skip
    names = ["x", "y", "yaw", "left", "right"]
    axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0], [0, 1, 0]]
    places = [[0, 0, r], [0, 0, 0], [0, 0, 0], [0, b, 0], [0, -b, 0]]
    wheels = {"mass": wheel, "about_com": [0.0013, 0, 0, spin, 0, 0.0013]}
    hull = {"mass": 6.0, "com": [0.01, 0, 0.05], "about_com": [0.2, 0, 0, 0.25, 0, 0.2]}
    links = [
        {
            "name": name,
            **({"parent": "yaw" if k > 2 else names[k - 1]} if k else {}),
            "joint": {
                "name": name,
                "type": "prismatic" if k < 2 else "revolute",
                "axis": axes[k],
                "pose": {"position": places[k]},
                "passive": k < 3,
            },
            **({"inertia": wheels if k > 2 else hull} if k > 1 else {}),
        }
        for k, name in enumerate(names)
    ]
    axle = {"quaternion": [0.5**0.5, -(0.5**0.5), 0, 0]}
    rolls = [
        {"name": n, "kind": "rolling", "second": {"link": n, "pose": axle}, "radius": r}
        for n in names[3:]
    ]
    path.write_text(
        json.dumps({"schema": "diffnea/model/1", "links": links, "constraints": rolls})
    )
    torque = np.zeros(q.shape)
    torque[:, 3:] = tau[::10] + 0.01 * rng.normal(size=(len(q), 2))
    log = package.Recording(
        time=t[::10],
        q=q + rng.normal(size=q.shape) * [1e-3, 1e-3, 1e-3, 2e-4, 2e-4],
        tau=torque,
        joint_names=names,
        passive=names[:3],
        torque_side="link",
    )
    return package.load_model(path), log, {"A": a, "h": mass * ahead, "C": c}


def test_wheels_tell_the_motion_of_a_base_that_is_seen_less_well(tmp_path: Path) -> None:
    """Encoders of 0.2 mrad at wheels of 0.1 m know the way to 20 µm; the base is seen to 1 mm."""
    inside = 0
    for seed in range(10):
        model, log, truth = cart_moves(seed, tmp_path / "cart.json")
        result = package.identify(model, log, effects=[], fix=["x.*", "y.*", "left.*", "right.*"])
        p = {x.name: x for x in result.parameters}
        found = p["yaw.hx"]
        assert found.std < 0.03 * truth["h"]
        inside += abs(found.value - truth["h"]) <= 1.96 * found.std
    assert inside >= 8  # 7 or fewer intervals of 95 % in 10: one time of 1000


def test_more_drives_than_motions_share_the_load(tmp_path: Path) -> None:
    """A second drive pushes at random; the first does what is left, by virtual work."""
    truth, wrong = map(package.load_model, described(tmp_path, FOUR_BAR))
    path = tmp_path / "wrong.xml"
    path.write_text(path.read_text().replace("</actuator>", '<motor joint="j3"/></actuator>'))
    wrong = package.load_model(path)
    one = moves(FOUR_BAR, 1)
    h = 1e-6
    q = one.q[:, :1]
    ratio = (FOUR_BAR.joints(q + h) - FOUR_BAR.joints(q - h))[:, 2] / (2 * h)
    rng = np.random.default_rng(1)
    second = 5 * np.sin(3 * one.time)
    tau = one.tau.copy()
    tau[:, 0] -= ratio * second
    tau[:, 2] = second + NOISE * rng.normal(size=len(second))
    both = package.Recording(
        time=one.time, q=one.q, tau=tau, joint_names=one.joint_names, passive=["j2"],
        torque_side="link",
    )  # fmt: skip
    alone = package.identify(package.load_model(tmp_path / "truth.xml"), one, effects=[])
    result = package.identify(wrong, both, effects=[])
    assert [e.joint for e in result.errors if np.isfinite(e.train)] in (["j1"], ["j3"])
    assert len(result.base_parameters) == len(alone.base_parameters)
    value = dict(
        zip([p.name for p in result.parameters], truth.inertial_parameters, strict=True)
    )
    names = [p.name for p in result.parameters]
    for base in result.base_parameters:
        true = sum(
            c * value[names[k]] for k, c in zip(base.columns, base.coefficients, strict=True)
        )
        assert abs(base.value - true) <= 4 * base.std


def test_the_command_fits_a_four_bar_and_keeps_its_loop(tmp_path: Path) -> None:
    """From CSV, with the default effects; held-out torque is known to the noise."""
    described(tmp_path, FOUR_BAR)
    for name, seed in (("train", 1), ("test", 2)):
        package.write_recording(moves(FOUR_BAR, seed), tmp_path / f"{name}.csv")
    done(
        "identify", tmp_path / "wrong.xml", tmp_path / "train.csv", "--test",
        tmp_path / "test.csv", "-o", tmp_path / "run",
    )  # fmt: skip
    result = package.read_result(tmp_path / "run")
    error = result.errors[0]
    assert error.joint == "j1"
    assert error.nominal_test > 0.5
    assert error.test < NOISE
    assert not any("torque_offset" in p.name and "j1" not in p.name for p in result.parameters)
    fitted = package.load_model(tmp_path / "run")
    assert fitted.constraints == ["pin"]
    assert package.load_model(tmp_path / "run" / "model.xml").constraints == ["pin"]


def test_refusals(tmp_path: Path) -> None:
    """Torques that nobody knows, losses that do not serve loops."""
    _, wrong = map(package.load_model, described(tmp_path, FOUR_BAR))
    without_drives = FOUR_BAR.mjcf().replace('<motor joint="j1"/>', "")
    (tmp_path / "open.xml").write_text(without_drives)
    silent = package.load_model(tmp_path / "open.xml")  # does not say which joints are passive
    good = moves(FOUR_BAR, 1)
    known = {"time": good.time, "q": good.q, "joint_names": good.joint_names}
    unknown = good.tau.copy()
    unknown[:, 1] = np.nan
    with pytest.raises(package.DataError, match="torque of joint 'j2' beside constraints"):
        package.identify(silent, package.Recording(**known, tau=unknown, passive=["j3"]))
    with pytest.raises(package.ModelError, match="by this loss: 'linkage' has constraints, 'pin'"):
        package.identify(wrong, good, loss="motion")


def test_an_audit_knows_the_limits_of_a_loop_s_joints(tmp_path: Path) -> None:
    """It looks at channels alone, whatever holds the links together."""
    described(tmp_path, FOUR_BAR)
    package.write_recording(moves(FOUR_BAR, 1), tmp_path / "log.csv")
    done("audit", tmp_path / "log.csv", "--model", tmp_path / "truth.xml")
