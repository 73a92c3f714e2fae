"""Closed linkages identified from torques of their drives; data by Lagrange's equation."""

from pathlib import Path

import numpy as np
import pytest
from cli import done
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
