/// A gap in a gear, and its motor behind it.

#include <algorithm>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/sim/record.hpp>

#include "support/three_links.hpp"

namespace backlash_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// The arm with a rotor at its vertical axis, and a gap before it.
struct GearedArm {
  GearedArm(double rotor, double gap) : nominal(arm().nominal) {
    nominal.effects = {{"armature", "yaw", {{"armature", rotor, ""}}}};
    robot = nominal;
    robot.effects.push_back({"backlash",
                             "yaw",
                             {{"gap", gap, ""},
                              {"stiffness", 1e5, ""},
                              {"motor_inertia", rotor, ""},
                              {"restitution", 0.5, ""}}});
  }
  Recording recorded(unsigned seed) const {
    FourierOptions motion;
    motion.seed = seed;
    motion.duration = 30.0;
    RecordOptions options;
    options.seed = seed;
    options.position_noise = 5e-5;
    const SimulatedRecording r =
        record_model(robot, nominal, random_fourier(nominal, motion), options);
    if (!r.failure.empty()) throw Error(r.failure);
    return r.recording;
  }
  Model nominal, robot;
};

}  // namespace

TEST_CASE("diagnose: a gap of a few standard deviations of the positions is named at its joint",
          "[diagnose]") {
  const double gap = 5e-4;  // [rad]
  const GearedArm geared(0.3, gap);
  const Finding finding = diagnose(geared.nominal, {geared.recorded(1)}, {geared.recorded(2)});
  CAPTURE(finding.sentence);
  REQUIRE(finding.causes.size() == 1);
  CHECK(finding.causes[0].effect == "backlash");
  CHECK(finding.causes[0].where == "yaw");
  const auto found = std::ranges::find(finding.causes[0].parameters, "gap", &CauseParameter::name);
  REQUIRE(found != finding.causes[0].parameters.end());
  CHECK(found->low <= gap);
  CHECK(found->high >= gap);
}

}  // namespace backlash_test
