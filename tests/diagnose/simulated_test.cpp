/// The motion of a diagnosis, simulated without and with what it names.

#include <limits>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/diagnose/diagnose.hpp>

#include "support/three_links.hpp"

namespace simulated_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

TEST_CASE("diagnose: the motion is simulated before and after, with the controller or without",
          "[diagnose]") {
  const bool in_loop = GENERATE(true, false);
  Recording train = arm().recorded({kCoulomb}, 1), test = arm().recorded({kCoulomb}, 2);
  if (!in_loop) {
    train.qcmd.resize(0, 0);
    test.qcmd.resize(0, 0);
  }
  const SimulatedMotion motion = diagnose(arm().nominal, {train}, {test}).simulated;
  CAPTURE(motion.reason);
  CHECK(motion.driven_by == (in_loop ? "controller" : "measured torque"));
  CHECK(motion.windows >= 5);
  CHECK(motion.base_failed + motion.extended_failed == 0);
  REQUIRE(motion.joints.size() == 3);
  const SimulatedSeries& elbow = motion.joints[2];
  CAPTURE(elbow.base_rmse, elbow.extended_rmse);
  CHECK(elbow.joint == "elbow");
  CHECK(elbow.unit == "rad");
  // The cause is all there is at this joint: the rest is the noise of the first velocity.
  CHECK(elbow.extended_rmse < 0.3 * elbow.base_rmse);
  CHECK(elbow.time.size() == elbow.measured.size());
  CHECK(elbow.time.size() == elbow.extended.size());
  CHECK(elbow.time.size() > 500);
  CHECK(elbow.time.size() <= 4000);
}

TEST_CASE("diagnose: a motion that cannot be simulated is declared with the reason", "[diagnose]") {
  Recording train = arm().recorded({}, 1), test = arm().recorded({}, 2);
  for (Recording* r : {&train, &test}) {  // the yaw is moved by something else
    r->has_tau[0] = false;
    r->tau.col(0).setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  const Finding finding = diagnose(arm().nominal, {train}, {test});
  CHECK(finding.simulated.joints.empty());
  CHECK_THAT(finding.simulated.reason, ContainsSubstring("yaw"));
}

}  // namespace simulated_test
