/// replay() against recordings of the same plant (noise-free, so that what is left is the
/// derivation of the start), and against plants that it does not know.

#include <algorithm>
#include <cmath>

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

/// Motion by differences of the noise-free log.
JointSeries series_of(const Recording& r) {
  JointSeries x;
  x.dt = r.time[1] - r.time[0];
  x.q = r.q;
  x.qd = x.qdd = x.q;
  for (long j = 0; j < r.q.cols(); ++j) {
    x.qd.col(j) = derivative(r.q.col(j), x.dt);
    x.qdd.col(j) = derivative(x.qd.col(j), x.dt);
  }
  return x;
}

/// The largest of the joints' root mean square errors [rad].
double error(const Model& model, const JointSeries& x, const RowMatX<double>& torque, long begin,
             long end) {
  const RowMatX<double> q = replay(extend(model), x, torque, begin, end);
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
/// first velocity: a few times 1e-5 rad after half a second. An effect that is left out costs 100
/// times that.
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
  const double own = error(robot, x, r.tau, begin, begin + half_second);
  const double without = error(rigid, x, r.tau, begin, begin + half_second);
  CAPTURE(own, without);
  // The first state of bristles and hidden motors is itself an estimate, good to a few per cent.
  CHECK(own < std::max(kSame, 0.03 * without));
  CHECK(without > 5.0 * own);
}

TEST_CASE("replay: lags and delays below a row of the grid are as long as they are", "[replay]") {
  Model rigid = wam();
  rigid.effects = {{"viscous_friction", "joint4", {{"viscous", 0.5, ""}}}};
  const Recording r = recorded(rigid);
  const JointSeries fine = series_of(r);
  constexpr long kEvery = 8;
  const auto kept = Eigen::seq(0, r.rows() / kEvery * kEvery - kEvery, kEvery);
  JointSeries coarse = fine;
  coarse.dt = kEvery * fine.dt;
  for (RowMatX<double>* m : {&coarse.q, &coarse.qd, &coarse.qdd}) {
    const RowMatX<double> of_kept = (*m)(kept, Eigen::all);
    *m = of_kept;
  }
  RowMatX<double> torque(coarse.q.rows(), r.tau.cols());  // means from each row to the next
  for (long k = 0; k < torque.rows(); ++k)
    torque.row(k) = r.tau.middleRows(k * kEvery, kEvery).colwise().mean();
  const long begin = std::lround(1.0 / coarse.dt), end = begin + std::lround(0.5 / coarse.dt);
  const auto late_by = [&](const char* effect, const char* name, double seconds) {
    Model late = rigid;
    if (seconds > 0.0) late.effects.push_back({effect, "joint2", {{name, seconds, ""}}});
    return replay(extend(late), coarse, torque, begin, end);
  };
  const auto apart = [](const RowMatX<double>& a, const RowMatX<double>& b) {
    return (a - b).cwiseAbs().maxCoeff();
  };
  // A millisecond moves joint 2 by some tenths of a milliradian; with a sixth of a row (1.3 ms) more,
  // the shortest would.
  const RowMatX<double> none = late_by("", "", 0.0);
  const RowMatX<double> lag = late_by("actuator_lag", "time_constant", 1e-3),
                        delay = late_by("actuator_delay", "delay", 1e-3);
  const double moved = apart(none, delay);
  REQUIRE(moved > 1e-5);
  CHECK(apart(none, late_by("actuator_lag", "time_constant", 1e-8)) < 1e-3 * moved);
  CHECK(apart(none, late_by("actuator_delay", "delay", 1e-8)) < 1e-3 * moved);
  CHECK(apart(lag, delay) < 0.1 * moved);
  CHECK(apart(none, late_by("actuator_delay", "delay", 2e-3)) < 2.2 * moved);
  CHECK(apart(none, late_by("actuator_delay", "delay", 2e-3)) > 1.8 * moved);
}

TEST_CASE("replay: a first state that is given counts, the measured one does not", "[replay]") {
  const Recording r = recorded(wam());
  const JointSeries x = series_of(r);
  const long begin = std::lround(1.0 / x.dt), end = begin + std::lround(0.1 / x.dt);
  const long n = x.q.cols();
  VecX<double> first(2 * n);
  first << x.q.row(begin).transpose(), x.qd.row(begin).transpose();
  CHECK(replay(extend(wam()), x, r.tau, begin, end, &first) ==
        replay(extend(wam()), x, r.tau, begin, end));
  JointSeries other = x;
  other.q.row(begin).array() += 1.0;
  other.qd.row(begin).array() += 1.0;
  CHECK(replay(extend(wam()), other, r.tau, begin, end, &first) ==
        replay(extend(wam()), x, r.tau, begin, end));
  first[n] += 0.5;  // velocity of the first joint [rad/s]
  const RowMatX<double> faster = replay(extend(wam()), x, r.tau, begin, end, &first);
  CHECK(faster(end - begin - 1, 0) - x.q(end - 1, 0) > 0.02);
}

TEST_CASE("replay: a simulation that blows up ends in NaN, rows that are not there are refused",
          "[replay]") {
  const Recording r = recorded(wam());
  const JointSeries x = series_of(r);
  RowMatX<double> torque = r.tau;
  torque.col(0).setConstant(1e9);  // [N·m]
  const RowMatX<double> q = replay(extend(wam()), x, torque, 10, 500);
  CHECK(q.row(0).allFinite());
  CHECK(std::isnan(q(489, 0)));
  CHECK_THROWS_AS(replay(extend(wam()), x, torque, 0, 500), ShapeError);
  CHECK_THROWS_AS(replay(extend(wam()), x, torque, 10, x.rows()), ShapeError);
  const VecX<double> short_state = VecX<double>::Zero(x.q.cols());
  CHECK_THROWS_AS(replay(extend(wam()), x, torque, 10, 500, &short_state), ShapeError);
  torque.resize(0, 0);
  CHECK_THROWS_AS(replay(extend(wam()), x, torque, 10, 500), ShapeError);
}

}  // namespace replay_test
