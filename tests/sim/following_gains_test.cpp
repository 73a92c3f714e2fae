#include <cmath>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/sim/record.hpp>

namespace following_gains_test {

using namespace diffnea;

namespace {

/// A light joint with much friction: a hobby servo without its rotor.
Model light_arm(double coulomb) {
  Model m;
  m.name = "light";
  ModelLink link;
  link.name = "flag";
  link.joint = "wrist";
  link.type = ModelJoint::kRevolute;
  link.axis = {0, 1, 0};
  link.inertia = inertia_from_com<double>(0.05, {0.02, 0, 0}, {2e-5, 0, 0, 2e-5, 0, 2e-5});
  link.limits.effort = 3.0;
  m.links.push_back(link);
  if (coulomb > 0.0)
    m.effects = {{"coulomb_friction", "wrist", {{"coulomb", coulomb, "N*m"}}},
                 {"armature", "wrist", {{"armature", 0.002, "kg*m^2"}}}};
  return m;
}

/// 0.5 sin(2 π 0.5 t) rad for 8 s.
Trajectory waving() {
  Trajectory t;
  t.source = "waving";
  t.joint_names = {"wrist"};
  const long rows = 801;
  const double w = 3.141592653589793;
  t.time.setLinSpaced(rows, 0.0, 8.0);
  t.q = (0.5 * (w * t.time.array()).sin()).matrix();
  t.qd = (0.5 * w * (w * t.time.array()).cos()).matrix();
  t.qdd = (-0.5 * w * w * (w * t.time.array()).sin()).matrix();
  return t;
}

double miss(const SimulatedRecording& r) {
  REQUIRE(r.failure.empty());
  const VecX<double> wanted = r.recording.qcmd.col(0);
  return (r.recording.q.col(0) - wanted).norm() / (wanted.array() - wanted.mean()).matrix().norm();
}

}  // namespace

TEST_CASE("following gains: a light joint that its friction would hold follows its motion",
          "[sim]") {
  const Model robot = light_arm(0.2), controller = light_arm(0.0);
  RecordOptions options;
  options.scale_noise(0.0);
  CHECK(miss(record_model(robot, controller, waving(), options)) > 0.2);
  options.follow = true;
  // Friction and rotor count, though the controller does not know of them.
  CHECK(miss(record_model(robot, controller, waving(), options)) < 0.15);
}

TEST_CASE("following gains: those that follow already, or are given, stay", "[sim]") {
  const Model robot = light_arm(0.0);
  RecordOptions options;
  options.scale_noise(0.0);
  options.bandwidth = 40.0;  // misses by (π/40)² of the motion
  const SimulatedRecording before = record_model(robot, robot, waving(), options);
  options.follow = true;
  const SimulatedRecording after = record_model(robot, robot, waving(), options);
  CHECK(after.recording.q == before.recording.q);
  RecordOptions given = options;
  given.kp = VecX<double>::Constant(1, 0.01);
  CHECK(record_model(robot, robot, waving(), given).recording.info.controller.front().value ==
        0.01);
}

}  // namespace following_gains_test
