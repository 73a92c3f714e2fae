/// Faults put into clean velocities and accelerations: named with their size, and nothing else is.

#include <cmath>
#include <support/audited_arm.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/random.hpp>
#include <diffnea/recording/audit.hpp>

using Catch::Matchers::ContainsSubstring;

namespace diffnea::test::audit_velocity_test {

TEST_CASE("audit: a velocity's scale, sign, offset and lag are named with their size", "[audit]") {
  const unsigned seed = GENERATE(range(0u, 6u));
  CAPTURE(seed);
  const Arm arm = clean_arm(seed);
  Recording r = arm.recording;
  SECTION("scale") {
    const double scale = GENERATE(0.95, 1.01, 1.05, 2.0);
    r.qd.col(1) *= scale;
    check_near(only(found(r), "velocity_scale", "qd_elbow"), scale);
  }
  SECTION("a scale of half of the threshold is none") {
    r.qd.col(1) *= 1.0025;
    CHECK(names(found(r)).empty());
  }
  SECTION("degrees per second") {
    r.qd.col(2) *= 180.0 / kPi;
    const ChannelFault f = only(found(r), "velocity_scale", "qd_wrist");
    CHECK_THAT(f.evidence, ContainsSubstring("degrees"));
  }
  SECTION("sign") {
    r.qd.col(0) *= -1.0;
    check_near(only(found(r), "velocity_sign", "qd_shoulder"), -1.0);
  }
  SECTION("offset") {
    r.qd.col(0).array() += 0.05;
    check_near(only(found(r), "velocity_offset", "qd_shoulder"), 0.05);
  }
  SECTION("low-pass") {
    const double lag = GENERATE(0.002, 0.01, 0.03);
    double y = arm.motion[1].at(0.0, 1);
    constexpr int kSteps = 20;             // of the filter's equation a row
    for (long i = 1; i < r.rows(); ++i) {  // of q̇ without noise, which is measured after it
      const double h = (r.time[i] - r.time[i - 1]) / kSteps;
      for (int k = 1; k <= kSteps; ++k)
        y += (1.0 - std::exp(-h / lag)) * (arm.motion[1].at(r.time[i - 1] + (k - 0.5) * h, 1) - y);
      r.qd(i, 1) += y - arm.motion[1].at(r.time[i], 1);
    }
    const ChannelFault f = only(found(r), "velocity_filter_lag", "qd_elbow");
    check_near(f, lag, 0.01);
    CHECK_THAT(f.evidence, ContainsSubstring("low-pass of first order fits better") ||
                               ContainsSubstring("cannot tell a low-pass"));
  }
  SECTION("delay") {
    const double lag = GENERATE(0.004, 0.03);
    for (long i = 0; i < r.rows(); ++i)
      r.qd(i, 1) += arm.motion[1].at(r.time[i] - lag, 1) - arm.motion[1].at(r.time[i], 1);
    const std::vector<ChannelFault> faults = found(r);
    REQUIRE(faults.size() == 1);
    check_near(faults[0], lag);
    // Slow motion may not tell; it must not tell wrongly.
    if (faults[0].fault != "time_shift")
      CHECK_THAT(faults[0].evidence, ContainsSubstring("cannot tell a low-pass"));
  }
  SECTION("a delay below a tenth of a row is none") {
    for (long i = 0; i < r.rows(); ++i)
      r.qd(i, 1) += arm.motion[1].at(r.time[i] - 2e-4, 1) - arm.motion[1].at(r.time[i], 1);
    CHECK(names(found(r)).empty());
  }
  SECTION("swapped") {
    r.qd.col(0).swap(r.qd.col(2));
    const ChannelFault f = only(found(r), "velocity_swapped", "qd_shoulder");
    CHECK_THAT(f.evidence, ContainsSubstring("the two are swapped"));
  }
  SECTION("noise alone") {
    Rng rng(seed);
    for (long i = 0; i < r.rows(); ++i) r.qd(i, 1) = rng.normal();
    only(found(r), "velocity_unrelated", "qd_elbow");
  }
  SECTION("accelerations are held against the second derivative") {
    r.qdd.resize(r.rows(), kJoints);
    for (long i = 0; i < r.rows(); ++i)
      for (int j = 0; j < kJoints; ++j) r.qdd(i, j) = arm.motion[j].at(r.time[i], 2);
    CHECK(names(found(r)).empty());
    r.qdd.col(1) *= -1.0;
    only(found(r), "acceleration_sign", "qdd_elbow");
  }
}

TEST_CASE("audit: fast motion tells a low-pass from a delay", "[audit]") {
  const unsigned seed = GENERATE(range(0u, 6u));
  CAPTURE(seed);
  const Arm arm = clean_arm(seed, true, 2.0);  // up to 3 Hz
  Recording r = arm.recording;
  const double lag = 0.02;
  double y = arm.motion[1].at(0.0, 1);
  const bool filter = GENERATE(true, false);
  constexpr int kSteps = 20;  // of the filter's equation a row
  for (long i = 1; i < r.rows(); ++i) {
    const double h = (r.time[i] - r.time[i - 1]) / kSteps;
    for (int k = 1; k <= kSteps; ++k)
      y += (1.0 - std::exp(-h / lag)) * (arm.motion[1].at(r.time[i - 1] + (k - 0.5) * h, 1) - y);
    r.qd(i, 1) +=
        (filter ? y : arm.motion[1].at(r.time[i] - lag, 1)) - arm.motion[1].at(r.time[i], 1);
  }
  const ChannelFault f = only(found(r), filter ? "velocity_filter_lag" : "time_shift", "qd_elbow");
  check_near(f, lag, 0.01);
  CHECK_THAT(f.evidence, !ContainsSubstring("cannot tell"));
}

TEST_CASE("audit: a recording without velocities is none of velocity 0", "[audit]") {
  const Arm arm = clean_arm(3), other = clean_arm(4);
  Recording without = other.recording;
  without.source = "without.csv";
  without.qd.resize(0, 0);
  CHECK(names(audit({arm.recording, without}).faults).empty());
  CHECK(names(audit({without, arm.recording}).faults).empty());
  // And one that is wrong is told by the recording that has them.
  Recording wrong = arm.recording;
  wrong.qd.col(1) *= 1.05;
  check_near(only(audit({wrong, without}).faults, "velocity_scale", "qd_elbow"), 1.05);
}

}  // namespace diffnea::test::audit_velocity_test
