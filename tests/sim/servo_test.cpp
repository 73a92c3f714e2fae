/// Robots whose joints are driven by servo laws: what their recordings hold, and what a fit to
/// commands and positions alone reads back.

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/sim/record.hpp>

#include "support/servo_bench.hpp"

namespace diffnea::servo_sim_test {
namespace {

constexpr double kMass = 0.5, kLength = 0.12, kGravity = 9.81;

Model bench(const std::vector<EffectSpec>& effects) {
  return test::servo_bench(kMass, kLength, 0.001, effects);
}

EffectSpec servo(double stiffness, double damping, double delay, double reach) {
  return {"position_servo",
          "servo",
          {{"stiffness", stiffness, ""},
           {"damping", damping, ""},
           {"delay", delay, ""},
           {"reach", reach, ""}}};
}

/// @param of  command over time [s], [rad]
Trajectory motion(double seconds, const std::function<double(double)>& of) {
  Trajectory out;
  out.source = "motion";
  out.joint_names = {"servo"};
  const long rows = std::lround(seconds * 100.0) + 1;
  out.time.resize(rows);
  out.q.resize(rows, 1);
  for (long k = 0; k < rows; ++k) {
    out.time[k] = 0.01 * static_cast<double>(k);
    out.q(k, 0) = of(out.time[k]);
  }
  out.qd = out.qdd = RowMatX<double>::Zero(rows, 1);
  return out;
}

RecordOptions at_100_hz(double noise) {
  RecordOptions out;
  out.control_rate = 100.0;
  out.scale_noise(noise);
  return out;
}

double wave(double t) {
  return 0.6 * std::sin(1.7 * t) + 0.4 * std::sin(6.0 * t) * std::sin(0.4 * t);
}

double waves_and_steps(double t) {
  return t < 8.0 ? wave(t) : (std::fmod(t, 1.6) < 0.8 ? 0.7 : -0.5);
}

}  // namespace

TEST_CASE("simulate: a servo sags under its load, saturates at its reach, and logs no torque",
          "[sim]") {
  const double stiffness = 12.0, told = 0.8;
  for (const double reach : {0.5, 0.02}) {
    const Model robot = bench({servo(stiffness, 0.8, 0.0, reach)});
    const SimulatedRecording out = record_model(
        robot, robot, motion(30.0, [&](double t) { return t < 0.5 ? 0.0 : told; }), at_100_hz(0.0));
    CHECK(out.failure.empty());
    REQUIRE(out.recording.has_tau == std::vector<bool>{false});
    CHECK(out.recording.tau.array().isNaN().all());
    CHECK(out.recording.info.controller.empty());
    const double q = out.recording.q(out.recording.rows() - 1, 0),
                 weight = kMass * kGravity * kLength * std::sin(q);
    CAPTURE(reach, q, weight);
    CHECK(std::abs(stiffness * std::min(told - q, reach) - weight) < 1e-6);
  }
}

TEST_CASE("simulate: what a servo answers comes its delay later", "[sim]") {
  const auto step = [](double t) { return t < 0.5 ? 0.0 : 0.3; };
  const auto positions = [&](double delay) {
    const Model robot = bench({servo(12.0, 0.8, delay, 0.5)});
    return record_model(robot, robot, motion(3.0, step), at_100_hz(0.0)).recording.q;
  };
  const RowMatX<double> now = positions(0.0), late = positions(0.03);
  constexpr long kLater = 3;  // rows
  const long n = now.rows() - kLater;
  CHECK((late.bottomRows(n) - now.topRows(n)).cwiseAbs().maxCoeff() < 1e-6);
}

TEST_CASE("simulate, identify: a servo's law is read back from commands and positions", "[sim]") {
  const double stiffness = 14.0, damping = 0.6, delay = 0.024, reach = 0.3, armature = 0.02;
  const Model truth =
      bench({servo(stiffness, damping, delay, reach),
             {"armature", "servo", {{"armature", armature, ""}}},
             // Sharp, as a fit of commands takes friction to be: it holds the joint.
             {"coulomb_friction", "servo", {{"coulomb", 0.08, ""}, {"smoothing", 1e-4, "rad/s"}}}});
  const SimulatedRecording out =
      record_model(truth, truth, motion(14.0, waves_and_steps), at_100_hz(1.0));
  REQUIRE(out.failure.empty());
  const IdentifyResult result = identify(bench({}), {out.recording}, {}, {});
  for (const auto& [name, is] : {std::pair{"stiffness", stiffness},
                                 {"position_servo.damping", damping},
                                 {"delay", delay},
                                 {"reach", reach},
                                 {"armature.armature", armature},
                                 {"coulomb", 0.08}}) {
    const ParameterEstimate& p = test::estimate(result, name);
    CAPTURE(name, is, p.value, p.std);
    // Both simulations take the straight line of what a step holds: 2 % where commands jump.
    CHECK(std::abs(p.value - is) < std::max(4.0 * p.std, 0.02 * is));
    CHECK(p.std < 0.05 * is);
  }
}

TEST_CASE("simulate, identify: a drive is told its trajectory's velocity, which its log has",
          "[sim]") {
  const EffectSpec fed{"feed_forward", "servo", {{"damping", 0.4, ""}, {"share", 1.0, ""}}};
  const EffectSpec drive = servo(14.0, 0.6, 0.024, 1e3);
  Trajectory path = motion(14.0, wave);
  // No derivative of the command, which a delay would stand in for.
  for (long k = 0; k < path.rows(); ++k) path.qd(k, 0) = 2.0 * std::cos(9.0 * path.time[k]);
  const auto recorded = [&](const std::vector<EffectSpec>& effects) {
    const Model robot = bench(effects);
    return record_model(robot, robot, path, at_100_hz(0.0)).recording;
  };
  const Recording log = recorded({drive, fed}), without = recorded({drive});
  CHECK(without.qdcmd.size() == 0);
  REQUIRE(log.qdcmd.rows() == log.rows());
  CHECK((log.q - without.q).cwiseAbs().maxCoeff() > 0.01);
  const IdentifyResult result = identify(bench({}), {log}, {}, {});
  for (const auto& [name, is] : {std::pair{"feed_forward.damping", 0.4},
                                 {"position_servo.damping", 0.6},
                                 {"delay", 0.024}}) {
    const ParameterEstimate& p = test::estimate(result, name);
    CAPTURE(name, is, p.value, p.std);
    CHECK(std::abs(p.value - is) < std::max(4.0 * p.std, 0.02 * is));
  }
  CHECK(test::estimate(result, "feed_forward.share").fixed);  // no torque was told
}

TEST_CASE("simulate, identify: a drive that integrates its error leaves none, and is read back",
          "[sim]") {
  const double rate = 2.0, told = 0.8;
  const Model truth = bench({servo(14.0, 0.6, 0.01, 1e3),
                             {"armature", "servo", {{"armature", 0.02, ""}}},
                             {"integral_action", "servo", {{"rate", rate, ""}}}});
  const SimulatedRecording rest = record_model(
      truth, truth, motion(20.0, [&](double t) { return t < 0.5 ? 0.0 : told; }), at_100_hz(0.0));
  CHECK(std::abs(rest.recording.q(rest.recording.rows() - 1, 0) - told) < 1e-6);

  const SimulatedRecording out =
      record_model(truth, truth, motion(14.0, waves_and_steps), at_100_hz(1.0));
  REQUIRE(out.failure.empty());
  IdentifyOptions options;
  options.choice.effects = {"position_servo", "armature", "integral_action"};
  const IdentifyResult result = identify(bench({}), {out.recording}, {}, options);
  for (const auto& [name, is] : {std::pair{"stiffness", 14.0}, {"integral_action.rate", rate}}) {
    const ParameterEstimate& p = test::estimate(result, name);
    CAPTURE(name, is, p.value, p.std);
    // Both simulations take the straight line of what a step holds: 2 % where commands jump.
    CHECK(std::abs(p.value - is) < std::max(4.0 * p.std, 0.02 * is));
    CHECK(p.std < 0.05 * is);
  }
}

TEST_CASE("simulate, identify: a gap behind a servo, encoder on either side", "[sim]") {
  const double side = GENERATE(0.0, 1.0), gap = 0.03;
  const std::vector<EffectSpec> known{servo(14.0, 0.6, 0.02, 1e3),
                                      {"armature", "servo", {{"armature", 0.02, ""}}},
                                      {"coulomb_friction", "servo", {{"coulomb", 0.06, ""}}}};
  std::vector<EffectSpec> hidden = known;
  hidden.push_back({"backlash",
                    "servo",
                    {{"gap", gap, ""},
                     {"stiffness", 700.0, ""},
                     {"motor_inertia", 0.02, ""},
                     {"restitution", 0.0, ""},
                     {"encoder_side", side, ""}}});
  const Model truth = bench(hidden);
  const SimulatedRecording out = record_model(truth, truth, motion(10.0, wave), at_100_hz(1.0));
  REQUIRE(out.failure.empty());
  const Model begun = bench({{"backlash", "servo", {{"encoder_side", side, ""}}}});
  const IdentifyResult result = identify(begun, {out.recording}, {}, {});
  const ParameterEstimate& p = test::estimate(result, "backlash.gap");
  CAPTURE(side, p.value, p.std);
  // The fit's flanks give way by 2 % of what the drive does, those of the simulation at once.
  CHECK(std::abs(p.value - gap) < 0.1 * gap);
}

}  // namespace diffnea::servo_sim_test
