/// A motor behind a gap in its gear, or behind a spring, in a motion that repeats and in one that does not.

#include <algorithm>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/sim/record.hpp>

#include "support/three_links.hpp"

namespace backlash_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// The arm with a rotor at its vertical axis, behind something that gives.
struct GearedArm {
  GearedArm(double rotor, const EffectSpec& gives) : nominal(arm().nominal) {
    nominal.effects = {{"armature", "yaw", {{"armature", rotor, ""}}}};
    robot = nominal;
    robot.effects.push_back(gives);
  }
  /// @param period  of the motion [s]
  Recording recorded(unsigned seed, double period = 10.0) const {
    FourierOptions motion;
    motion.seed = seed;
    motion.duration = 30.0;
    motion.period = period;
    motion.harmonics = static_cast<int>(period);  // up to 1 Hz
    RecordOptions options;
    options.seed = seed;
    options.position_noise = 5e-5;
    options.bandwidth = 8.0;  // [rad/s]; the spring's loop is stable then
    const SimulatedRecording r =
        record_model(robot, nominal, random_fourier(nominal, motion), options);
    if (!r.failure.empty()) throw Error(r.failure);
    return r.recording;
  }
  Model nominal, robot;
};

constexpr double kRotor = 0.3;  // [kg·m²]

/// @param side  of the encoder: 0 the link's, 1 the motor's
EffectSpec gap_of(double gap, double side) {
  return {"backlash",
          "yaw",
          {{"gap", gap, ""},
           {"stiffness", 1e5, ""},
           {"motor_inertia", kRotor, ""},
           {"restitution", 0.5, ""},
           {"encoder_side", side, ""}}};
}

const CauseParameter& parameter(const Cause& cause, const std::string& name) {
  return *std::ranges::find(cause.parameters, name, &CauseParameter::name);
}

}  // namespace

TEST_CASE("diagnose: a gap of a few standard deviations of the positions is named at its joint",
          "[diagnose]") {
  const double gap = 5e-4;                            // [rad]
  const double period = GENERATE(10.0, 30.0);         // [s]; of as long a recording
  const double side = GENERATE(0.0, 1.0);
  const GearedArm geared(kRotor, gap_of(gap, side));
  const Finding finding =
      diagnose(geared.nominal, {geared.recorded(1, period)}, {geared.recorded(2, period)});
  CAPTURE(period, side, finding.sentence);
  REQUIRE(finding.causes.size() == 1);
  CHECK(finding.causes[0].effect == "backlash");
  CHECK(finding.causes[0].where == "yaw");
  const CauseParameter& found = parameter(finding.causes[0], "gap");
  CHECK(found.low <= gap);
  CHECK(found.high >= gap);
  CHECK(parameter(finding.causes[0], "encoder_side").value == side);
  const auto says_motor = [](const std::string& note) {
    return note.starts_with("yaw: its encoder is at the motor, and the link has play");
  };
  CHECK(std::ranges::any_of(finding.notes, says_motor) == (side > 0.0));
}

TEST_CASE("diagnose: a spring before a rotor is named in a motion that never repeats",
          "[diagnose]") {
  const double stiffness = 2000.0;  // [N·m/rad]
  const GearedArm geared(kRotor, {"joint_elasticity",
                                  "yaw",
                                  {{"stiffness", stiffness, ""},
                                   {"damping", 5.0, ""},
                                   {"motor_inertia", kRotor, ""}}});
  const Finding finding =
      diagnose(geared.nominal, {geared.recorded(1, 30.0)}, {geared.recorded(2, 30.0)});
  CAPTURE(finding.sentence);
  REQUIRE(finding.causes.size() == 1);
  CHECK(finding.causes[0].effect == "joint_elasticity");
  CHECK(finding.causes[0].where == "yaw");
  const CauseParameter& found = parameter(finding.causes[0], "stiffness");
  CHECK(found.low <= stiffness);
  CHECK(found.high >= stiffness);
}

TEST_CASE("diagnose: neither a gap nor a spring is named where the rotor is rigid",
          "[diagnose]") {
  const unsigned seed = GENERATE(1u, 3u, 5u);
  const GearedArm rigid(kRotor, {"viscous_friction", "yaw", {{"viscous", 0.0, ""}}});
  const Finding finding =
      diagnose(rigid.nominal, {rigid.recorded(seed, 30.0)}, {rigid.recorded(seed + 1, 30.0)},
               {.effects = {"joint_elasticity", "backlash"}});
  CAPTURE(seed, finding.sentence);
  CHECK(finding.refused.size() < 6);  // three joints of each were tried
  CHECK(finding.causes.empty());
}

}  // namespace backlash_test
