import threading

import numpy as np
import pytest

import diffnea

# Sums of a dozen products of order 10: some ulp each.
ROUNDING = 1e-12


def test_rnea_is_the_textbook_formula(arm, states, formulas) -> None:
    q, qd, qdd = states
    np.testing.assert_allclose(
        diffnea.rnea(arm, q=q, qd=qd, qdd=qdd), formulas.torques(q, qd, qdd), atol=ROUNDING
    )


def test_mass_matrix_and_gravity_torques_are_the_textbook_formulas(arm, states, formulas) -> None:
    q = states[0]
    np.testing.assert_allclose(
        diffnea.mass_matrix(arm, q=q), formulas.mass_matrix(q), atol=ROUNDING
    )
    np.testing.assert_allclose(
        diffnea.gravity_torques(arm, q=q), formulas.gravity_torques(q), atol=ROUNDING
    )


def test_aba_solves_the_textbook_equation(arm, states, formulas) -> None:
    q, qd, qdd = states
    found = diffnea.aba(arm, q=q, qd=qd, tau=formulas.torques(q, qd, qdd))
    np.testing.assert_allclose(found, qdd, atol=1e3 * ROUNDING)  # condition of M: below 100


def test_effects_add_what_their_formulas_say(rubbing_arm, states, formulas) -> None:
    q, qd, qdd = states
    added = np.stack([0.7 * qd[:, 0], 0.05 * qdd[:, 1] - 0.3], -1)
    tau = diffnea.rnea(rubbing_arm, q=q, qd=qd, qdd=qdd, effects=True)
    np.testing.assert_allclose(tau, formulas.torques(q, qd, qdd) + added, atol=ROUNDING)
    back = diffnea.aba(rubbing_arm, q=q, qd=qd, tau=tau, effects=True)
    np.testing.assert_allclose(back, qdd, atol=1e3 * ROUNDING)
    # Without effects the rotor inertia stays: it is part of the tree.
    tree = diffnea.rnea(rubbing_arm, q=q, qd=qd, qdd=qdd)
    np.testing.assert_allclose(tree[:, 1], formulas.torques(q, qd, qdd)[:, 1] + 0.05 * qdd[:, 1])


def test_regressor_times_parameters_is_rnea(arm, states, formulas) -> None:
    q, qd, qdd = states
    columns = diffnea.regressor(arm, q=q, qd=qd, qdd=qdd)
    assert columns.shape == (20, 2, 20)
    np.testing.assert_allclose(
        columns @ arm.inertial_parameters, formulas.torques(q, qd, qdd), atol=ROUNDING
    )


def test_derivatives_are_central_differences(arm, states, formulas) -> None:
    q, qd, qdd = states
    step = 1e-6
    found = diffnea.rnea_derivatives(arm, q=q, qd=qd, qdd=qdd)
    for k, analytic in enumerate(found):
        for j in range(2):
            low, high = [list(states) for _ in range(2)]
            offset = step * np.eye(2)[j]
            low[k], high[k] = low[k] - offset, high[k] + offset
            difference = (formulas.torques(*high) - formulas.torques(*low)) / (2 * step)
            # Rounding of torques of order 10 over the step: 1e-8 or so.
            np.testing.assert_allclose(analytic[:, :, j], difference, atol=1e-7)


def test_frames_are_where_plane_geometry_says(arm, states, formulas) -> None:
    q, qd, qdd = states
    a, b = q[:, 0], q[:, 0] + q[:, 1]
    pose = diffnea.frame_pose(arm, "hand", q=q)
    position = np.stack(
        [formulas.L1 * np.cos(a) + 0.3 * np.cos(b), formulas.L1 * np.sin(a) + 0.3 * np.sin(b)], -1
    )
    np.testing.assert_allclose(pose[:, :2, 3], position, atol=ROUNDING)
    np.testing.assert_allclose(pose[:, 0, 0], np.cos(b), atol=ROUNDING)
    np.testing.assert_allclose(pose[:, 3], np.tile([0, 0, 0, 1], (20, 1)))

    motion = diffnea.frame_motion(arm, "hand", q=q, qd=qd, qdd=qdd)
    jacobian = diffnea.frame_jacobian(arm, "hand", q=q)
    twist = np.einsum("kij,kj->ki", jacobian, qd)
    np.testing.assert_allclose(motion.angular_velocity[:, 2], qd.sum(1), atol=ROUNDING)
    np.testing.assert_allclose(twist[:, :3], motion.angular_velocity, atol=ROUNDING)
    np.testing.assert_allclose(twist[:, 3:], motion.velocity, atol=ROUNDING)
    h = 1e-5  # second difference of lengths of order 1: 1e-6 of rounding
    forward, backward = (
        diffnea.frame_pose(arm, "hand", q=q + s * h * qd + 0.5 * h * h * qdd)[:, :3, 3]
        for s in (1, -1)
    )
    np.testing.assert_allclose(motion.velocity, (forward - backward) / (2 * h), atol=1e-8)
    second = (forward - 2 * pose[:, :3, 3] + backward) / h**2
    np.testing.assert_allclose(motion.acceleration, second, atol=1e-4)


def test_a_single_state_is_a_row_of_the_batch(arm, states) -> None:
    q, qd, qdd = states
    one = {"q": q[3], "qd": qd[3], "qdd": qdd[3]}
    many = {"q": q, "qd": qd, "qdd": qdd}
    for function, shape in ((diffnea.rnea, (2,)), (diffnea.regressor, (2, 20))):
        assert function(arm, **one).shape == shape
        # SIMD lanes round as scalars do, up to contracted products.
        np.testing.assert_allclose(function(arm, **one), function(arm, **many)[3], atol=ROUNDING)
    assert diffnea.mass_matrix(arm, q=q[3]).shape == (2, 2)
    assert diffnea.frame_pose(arm, "lower", q=q[3]).shape == (4, 4)
    assert diffnea.frame_jacobian(arm, "lower", q=q[3]).shape == (6, 2)
    assert diffnea.rnea(arm, q=q[:0], qd=qd[:0], qdd=qdd[:0]).shape == (0, 2)


@pytest.mark.parametrize(
    "change",
    [
        np.asfortranarray,
        lambda x: np.repeat(x, 2, axis=0)[::2],
        lambda x: np.hstack([x, x])[:, :2],
        lambda x: x.tolist(),
        lambda x: x.astype(">f8"),
    ],
    ids=["column-major", "strided rows", "strided columns", "lists", "big-endian"],
)
def test_memory_layout_does_not_matter(arm, states, change) -> None:
    q, qd, qdd = states
    tau = diffnea.rnea(arm, q=change(q), qd=change(qd), qdd=change(qdd))
    assert np.array_equal(tau, diffnea.rnea(arm, q=q, qd=qd, qdd=qdd))
    assert tau.dtype == np.float64
    assert tau.flags.c_contiguous
    assert tau.flags.writeable


def test_single_precision_and_integers_are_converted(arm, formulas) -> None:
    zero = np.zeros((4, 2), dtype=np.float32)
    tau = diffnea.rnea(arm, q=zero.astype(int), qd=zero, qdd=zero)
    np.testing.assert_allclose(tau, formulas.gravity_torques(np.zeros((4, 2))))


def test_arguments_are_not_changed_and_results_own_their_memory(arm, states) -> None:
    q, qd, qdd = states
    before = q.copy()
    tau = diffnea.rnea(arm, q=q, qd=qd, qdd=qdd)
    tau[:] = 0
    assert np.array_equal(q, before)
    assert not np.array_equal(tau, diffnea.rnea(arm, q=q, qd=qd, qdd=qdd))


def test_threads_do_not_change_the_result(arm) -> None:
    q, qd, qdd = np.random.default_rng(1).normal(size=(3, 1001, 2))
    one = diffnea.rnea(arm, q=q, qd=qd, qdd=qdd)
    np.testing.assert_allclose(
        diffnea.rnea(arm, q=q, qd=qd, qdd=qdd, threads=3), one, atol=ROUNDING
    )


@pytest.mark.parametrize(
    ("q", "message"),
    [
        (np.zeros(3), r"rnea: q: got shape \(3,\), expected \(2,\) or \(T, 2\)"),
        (np.zeros((5, 4, 2)), r"got shape \(5, 4, 2\)"),
        (np.zeros((1, 2)), r"rnea: qd: got shape \(2,\), expected \(1, 2\), that of q"),
        (0.0, r"got shape \(\), expected \(2,\)"),
    ],
)
def test_wrong_shapes_are_named(arm, q, message) -> None:
    with pytest.raises(diffnea.ShapeError, match=message):
        diffnea.rnea(arm, q=q, qd=np.zeros(2), qdd=np.zeros(2))


def test_what_is_no_array_of_numbers_is_named(arm) -> None:
    with pytest.raises(TypeError, match="rnea: qd: got str, expected an array of real numbers"):
        diffnea.rnea(arm, q=np.zeros(2), qd="fast", qdd=np.zeros(2))
    with pytest.raises(TypeError, match="rnea: qdd: got NoneType"):
        diffnea.rnea(arm, q=np.zeros(2), qd=np.zeros(2), qdd=None)
    with pytest.raises(TypeError):
        diffnea.rnea(arm, np.zeros(2), np.zeros(2), np.zeros(2))  # keyword-only


def test_an_unknown_frame_is_answered_with_those_there_are(arm) -> None:
    with pytest.raises(diffnea.ModelError, match=r"no frame 'foot'.*hand, upper, lower"):
        diffnea.frame_pose(arm, "foot", q=np.zeros(2))


def test_other_threads_run_during_a_long_call(arm) -> None:
    q, qd, qdd = np.random.default_rng(2).normal(size=(3, 200_000, 2))
    calls, ticks, done = [], 0, threading.Event()

    def work() -> None:
        calls.append(diffnea.regressor(arm, q=q, qd=qd, qdd=qdd))
        done.set()

    worker = threading.Thread(target=work)
    worker.start()
    while not done.wait(0.001):  # to come back it needs the lock
        ticks += 1
    worker.join()
    assert calls[0].shape == (200_000, 2, 20)
    assert ticks > 5  # one or two with the lock held: before the call and after it


def test_what_fades_with_the_time_needs_more_than_a_state(arm, states) -> None:
    q, qd, qdd = states
    fading = {"viscous": 1.0, "time_constant": 3.0}
    cold = arm.with_effects([diffnea.Effect("warm_up", "elbow", fading)])
    with pytest.raises(ValueError, match="warm_up at 'elbow' depends on the time"):
        diffnea.rnea(cold, q=q, qd=qd, qdd=qdd, effects=True)
    with pytest.raises(ValueError, match="warm_up at 'elbow' depends on the time"):
        diffnea.aba(cold, q=q, qd=qd, tau=qdd, effects=True)
