"""Identify a robot from a recording: on arrays, as a user of the Python module would.

    python identify.py

The recording comes from MuJoCo: a WAM whose inertias, friction and rotors differ from its
description by an amount that the fit does not know.
"""

import diffnea

# What the robot is supposed to be, and a motion that shows what it is.
model = diffnea.load_model("wam4")
print(model)
train_motion = diffnea.excite(model, duration=20, seed=1)
test_motion = diffnea.excite(model, duration=10, seed=2)

# Recordings of the robot as it is. With a real one: diffnea.read_recording("train.csv").
train = diffnea.simulate(model, train_motion, world="mujoco:wam4,perturb=A,seed=5").recording
test = diffnea.simulate(model, test_motion, world="mujoco:wam4,perturb=A,seed=5").recording

# A recording is arrays, so your own arrays do as well.
train = diffnea.Recording(time=train.time, q=train.q, tau=train.tau, joint_names=model.joint_names)

result = diffnea.identify(model, train, test=test)
print(result)

mass = result.parameters["forearm.hx"]
print(f"forearm.hx = {mass.value:.4f} ± {mass.std:.4f} {mass.unit} (before: {mass.prior:.4f})")

# The fitted model computes: torques of one state, or of many at once.
tau = diffnea.rnea(result.model, q=test.q[:3], qd=0 * test.q[:3], qdd=0 * test.q[:3], effects=True)
print("torques at rest [N·m]:", tau.round(2).tolist())

result.save("run")  # result.json, model.json, model.xml, report.html
before = max(error.nominal_test / error.torque_rms for error in result.errors)
after = max(error.test / error.torque_rms for error in result.errors)
print(f"worst joint, held out: {before:.0%} of the torque before, {after:.1%} after")
