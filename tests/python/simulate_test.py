import pickle

import numpy as np
import pytest

import diffnea


def test_excitation_stays_within_the_limits(arm) -> None:
    motion = diffnea.excite(arm, duration=10, period=5, rate=200, seed=1)
    assert motion.q.shape == (2001, 2)
    assert np.abs(motion.q).max() <= 3
    assert np.abs(motion.qd).max() <= 6
    np.testing.assert_allclose(motion.qd[0], 0, atol=1e-12)  # at rest, to rounding
    same = diffnea.excite(arm, duration=10, period=5, rate=200, seed=1)
    assert np.array_equal(motion.q, same.q)
    with pytest.raises(diffnea.Error, match="harmonics"):
        diffnea.excite(arm, harmonics=1)


def test_the_model_itself_obeys_its_equation(rubbing_arm) -> None:
    motion = diffnea.excite(rubbing_arm, duration=10, seed=1)
    simulation = diffnea.simulate(rubbing_arm, motion)
    assert simulation.truth == rubbing_arm
    assert simulation.failure == ""
    r = simulation.recording
    # Torque is held from row k to k+1: what acts about row k is the mean of two rows.
    dt = r.time[1] - r.time[0]
    qd, qdd = (r.q[2:] - r.q[:-2]) / (2 * dt), (r.q[2:] - 2 * r.q[1:-1] + r.q[:-2]) / dt**2
    tau = diffnea.rnea(rubbing_arm, q=r.q[1:-1], qd=qd, qdd=qdd, effects=True)
    held = (r.tau[:-2] + r.tau[1:-1]) / 2
    # Differences are of second order in dt = 2 ms.
    assert np.abs(tau - held)[5:].max() < 1e-3 * np.abs(held).max()


def test_a_mujoco_world_is_the_perturbed_robot() -> None:
    wam = diffnea.load_model("wam4")
    motion = diffnea.excite(wam, duration=10, seed=1)
    noiseless = "mujoco:wam4,perturb=A,noise=0"
    one = diffnea.simulate(wam, motion, world=noiseless, seed=3)
    assert one.truth != wam
    assert len(one.recording) == len(motion)
    again = diffnea.simulate(wam, motion, world=noiseless, seed=3)
    assert np.array_equal(one.recording.q, again.recording.q)
    other = diffnea.simulate(wam, motion, world=noiseless, seed=4)
    assert not np.array_equal(one.recording.q, other.recording.q)
    back = pickle.loads(pickle.dumps(one))
    assert back.truth == one.truth
    assert np.array_equal(back.recording.tau, one.recording.tau)


def test_what_mujoco_records_is_what_the_truth_computes() -> None:
    wam = diffnea.load_model("wam4")
    motion = diffnea.excite(wam, duration=10, seed=1)
    result = diffnea.simulate(wam, motion, world="mujoco:wam4,perturb=A,seed=3,noise=0")
    r = result.recording
    dt = r.time[1] - r.time[0]
    qd, qdd = (r.q[2:] - r.q[:-2]) / (2 * dt), (r.q[2:] - 2 * r.q[1:-1] + r.q[:-2]) / dt**2
    tau = diffnea.rnea(result.truth, q=r.q[1:-1], qd=qd, qdd=qdd, effects=True)
    held = (r.tau[:-2] + r.tau[1:-1]) / 2
    # Away from reversals, where MuJoCo's friction sticks and tanh does not.
    moving = (np.abs(qd) > 0.1).all(axis=1)
    error = np.sqrt(np.mean((tau - held)[moving] ** 2, axis=0))
    assert (error < 0.01 * np.sqrt(np.mean(held**2, axis=0))).all()


def test_worlds_are_listed_and_wrong_ones_named() -> None:
    listed = diffnea.worlds()
    assert "mujoco:wam4" in [world["world"] for world in listed["worlds"]]
    assert {"A", "B", "C"} <= {robot["perturb"] for robot in listed["surrogates"]}
    assert "surrogate_a" not in diffnea.models.names()
    keys = {key["key"] for key in listed["keys"]}
    robot, ball = {"perturb", "seed", "noise", "effect", "repetitions"}, {"ball", "rope", "tilt"}
    assert keys == robot | ball | {"string", "nominal_string"}
    wam = diffnea.load_model("wam4")
    motion = diffnea.excite(wam, duration=10)
    with pytest.raises(diffnea.Error, match=r"no model 'wam9'.*wam4"):
        diffnea.simulate(wam, motion, world="mujoco:wam9")
    with pytest.raises(diffnea.Error, match="unknown key 'colour'"):
        diffnea.simulate(wam, motion, world="mujoco:wam4,colour=red")


def test_gains_of_the_wrong_number_are_refused(arm) -> None:
    with pytest.raises(diffnea.ShapeError):
        diffnea.simulate(arm, diffnea.excite(arm, duration=10), kp=[1.0], kd=[1.0])


def test_one_robot_is_recorded_with_noise_of_its_own_each_time() -> None:
    wam = diffnea.load_model("wam4")
    motion = diffnea.excite(wam, duration=10, seed=1)
    world = "mujoco:wam4,perturb=A,seed=3"
    one, two = (diffnea.simulate(wam, motion, world=world, seed=k) for k in (1, 2))
    assert one.truth == two.truth
    noise = (one.recording.q - two.recording.q).std(axis=0)
    assert (noise > 1e-6).all()
    assert not np.array_equal(one.recording.tau, two.recording.tau)
    again = diffnea.simulate(wam, motion, world=world, seed=1)
    assert np.array_equal(one.recording.q, again.recording.q)
