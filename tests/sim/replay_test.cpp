/// replay() against recordings of the same plant (noise-free, so that what is left is the
/// derivation of the start), and against plants that it does not know.

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/record.hpp>
#include <diffnea/sim/replay.hpp>

namespace replay_test {

using namespace diffnea;

namespace {

Model wam() { return read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml"); }

Recording recorded(const Model& robot) {
  FourierOptions motion;
  motion.duration = motion.period = 8.0;
  RecordOptions quiet;
  quiet.scale_noise(0.0);
  const SimulatedRecording r = record_model(robot, wam(), random_fourier(wam(), motion), quiet);
  REQUIRE(r.failure.empty());
  return r.recording;
}

/// Motion by differences of the noise-free log, torque about each row from what is held beside it.
JointSeries series_of(const Recording& r) {
  JointSeries x;
  x.dt = r.time[1] - r.time[0];
  x.q = r.q;
  x.qd = x.qdd = x.q;
  x.logged = r.tau;
  for (long j = 0; j < r.q.cols(); ++j) {
    x.qd.col(j) = derivative(r.q.col(j), x.dt);
    x.qdd.col(j) = derivative(x.qd.col(j), x.dt);
    for (long k = 1; k < r.rows(); ++k) x.logged(k, j) = 0.5 * (r.tau(k - 1, j) + r.tau(k, j));
  }
  return x;
}

Feedback feedback_of(const Recording& r) {
  const int n = r.num_joints();
  Feedback out{VecX<double>::Zero(n), VecX<double>::Zero(n),
               VecX<double>::Constant(n, std::numeric_limits<double>::infinity())};
  for (const JointValue& v : r.info.controller)
    for (int j = 0; j < n; ++j)
      if (r.joint_names[static_cast<std::size_t>(j)] == v.joint) {
        if (v.name == "kp") out.kp[j] = v.value;
        if (v.name == "kd") out.kd[j] = v.value;
      }
  return out;
}

/// The largest of the joints' root mean square errors [rad].
double error(const Model& model, const JointSeries& x, long begin, long end,
             const Feedback* feedback = nullptr) {
  const RowMatX<double> q = replay(extend(model), x, begin, end, feedback);
  const RowMatX<double> off = q - x.q.middleRows(begin, end - begin);
  double worst = 0.0;
  for (long j = 0; j < off.cols(); ++j) {
    double sum = 0.0;
    long count = 0;
    for (long k = 0; k < off.rows(); ++k)
      if (std::isfinite(off(k, j))) {
        sum += off(k, j) * off(k, j);
        ++count;
      }
    REQUIRE(count > off.rows() / 2);
    worst = std::max(worst, std::sqrt(sum / static_cast<double>(count)));
  }
  return worst;
}

/// The motion is some 0.5 rad, its velocity 1 rad/s. What differs between replay and plant is the
/// torque within a row (held there, averaged here) and the first velocity: a few times 1e-5 rad
/// after half a second. An effect that is left out costs 100 times that.
constexpr double kSame = 5e-4;

}  // namespace

TEST_CASE("replay: every kind of effect, driven by the recorded torque, repeats the recording",
          "[replay]") {
  const EffectSpec effect = GENERATE(
      EffectSpec{"coulomb_friction", "joint2", {{"coulomb", 2.0, ""}, {"smoothing", 0.05, ""}}},
      EffectSpec{"joint_spring", "joint4", {{"stiffness", 6.0, ""}}},
      EffectSpec{"torque_gain", "joint2", {{"gain_error", 0.15, ""}}},
      EffectSpec{"actuator_delay", "joint2", {{"delay", 0.02, ""}}},
      EffectSpec{"actuator_lag", "joint2", {{"time_constant", 0.02, ""}}},
      EffectSpec{"time_shift", "all", {{"shift", 0.02, ""}}},
      EffectSpec{"encoder_offset", "joint2", {{"offset", 0.08, ""}}},
      EffectSpec{"presliding_dahl", "joint2", {{"coulomb", 2.0, ""}, {"presliding", 0.05, ""}}},
      EffectSpec{"joint_elasticity",
                 "joint4",
                 {{"stiffness", 200.0, ""}, {"damping", 1.0, ""}, {"motor_inertia", 0.05, ""}}},
      EffectSpec{"joint_elasticity",
                 "joint4",
                 {{"stiffness", 200.0, ""},
                  {"damping", 1.0, ""},
                  {"motor_inertia", 0.05, ""},
                  {"friction_share", 0.0, ""}}},
      EffectSpec{"joint_elasticity",
                 "joint4",
                 {{"stiffness", 200.0, ""},
                  {"damping", 1.0, ""},
                  {"motor_inertia", 0.05, ""},
                  {"encoder_side", 1.0, ""}}});
  CAPTURE(effect.effect);
  Model robot = wam(), rigid = wam();
  rigid.effects = {{"armature", "joint4", {{"armature", 0.05, ""}}},  // that the spring turns
                   {"viscous_friction", "joint4", {{"viscous", 0.5, ""}}}};
  robot.effects = rigid.effects;
  robot.effects.push_back(effect);
  const Recording r = recorded(robot);
  const JointSeries x = series_of(r);
  const long half_second = std::lround(0.5 / x.dt), begin = 3 * half_second;
  const double own = error(robot, x, begin, begin + half_second);
  const double without = error(rigid, x, begin, begin + half_second);
  CAPTURE(own, without);
  // The first state of bristles and hidden motors is itself an estimate, good to a few per cent.
  CHECK(own < std::max(kSame, 0.03 * without));
  CHECK(without > 5.0 * own);
}

TEST_CASE("replay: with its controller in the loop a wrong model stays near, a right one nearer",
          "[replay]") {
  Model robot = wam();
  robot.effects = {{"coulomb_friction", "joint2", {{"coulomb", 2.0, ""}, {"smoothing", 0.05, ""}}}};
  const Recording r = recorded(robot);
  const JointSeries x = series_of(r);
  const Feedback feedback = feedback_of(r);
  REQUIRE(feedback.kp.minCoeff() > 0.0);
  const long begin = std::lround(1.0 / x.dt), end = begin + std::lround(4.0 / x.dt);
  const double own = error(robot, x, begin, end, &feedback);
  const double without = error(wam(), x, begin, end, &feedback);
  CAPTURE(own, without);
  CHECK(own < kSame);
  CHECK(without > 5.0 * own);
  // By its proportional part alone the controller bends 2 N·m into Fc/kp.
  CHECK(without < 2.0 * 2.0 / feedback.kp[1]);
  CHECK(error(wam(), x, begin, end) > 10.0 * without);  // without it the model drifts away
}

TEST_CASE("replay: a simulation that blows up ends in NaN, rows that are not there are refused",
          "[replay]") {
  const Recording r = recorded(wam());
  JointSeries x = series_of(r);
  x.logged.col(0).setConstant(1e9);  // [N·m]
  const RowMatX<double> q = replay(extend(wam()), x, 10, 500, nullptr);
  CHECK(q.row(0).allFinite());
  CHECK(std::isnan(q(489, 0)));
  CHECK_THROWS_AS(replay(extend(wam()), x, 0, 500, nullptr), ShapeError);
  CHECK_THROWS_AS(replay(extend(wam()), x, 10, x.rows(), nullptr), ShapeError);
  x.logged.resize(0, 0);
  CHECK_THROWS_AS(replay(extend(wam()), x, 10, 500, nullptr), ShapeError);
}

}  // namespace replay_test
