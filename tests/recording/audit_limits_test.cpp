/// Channels that are dead, coarse, clipped, in another unit or beyond what the joint can.

#include <algorithm>
#include <cmath>
#include <limits>
#include <support/audited_arm.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/random.hpp>
#include <diffnea/recording/audit.hpp>

using Catch::Matchers::ContainsSubstring;

namespace diffnea::test::audit_limits_test {

TEST_CASE("audit: dead, coarse, slow and stuck channels", "[audit]") {
  const unsigned seed = GENERATE(range(0u, 6u));
  CAPTURE(seed);
  const Arm arm = clean_arm(seed);
  Recording r = arm.recording;
  SECTION("a torque that stays") {
    r.tau.col(1).setConstant(GENERATE(0.0, 1.7));
    only(found(r), "dead_channel", "tau_elbow");
  }
  SECTION("a velocity that stays") {
    r.qd.col(2).setZero();
    only(found(r), "dead_channel", "qd_wrist");
  }
  SECTION("a position that stays") {
    r.q.col(2).setConstant(0.3);
    r.qd.col(2).setZero();
    only(found(r), "dead_channel", "q_wrist");
  }
  SECTION("an empty velocity") {
    r.qd.col(2).setConstant(std::numeric_limits<double>::quiet_NaN());
    only(found(r), "dead_channel", "qd_wrist");
  }
  SECTION("a joint that holds still is none") {
    r.q.col(2).setConstant(0.3);
    r.qd.col(2).setZero();
    r.qcmd.col(2).setConstant(0.3);
    CHECK(names(found(r)).empty());
  }
  SECTION("coarse steps") {
    const double range = r.tau.col(0).maxCoeff() - r.tau.col(0).minCoeff();
    const double step = range / 20.0;
    for (long i = 0; i < r.rows(); ++i) r.tau(i, 0) = step * std::round(r.tau(i, 0) / step);
    const ChannelFault f = only(found(r), "coarse_quantisation", "tau_shoulder");
    CHECK(std::abs(f.value / step - 1.0) < 0.01);
  }
  SECTION("fine steps are none") {
    const double range = r.tau.col(0).maxCoeff() - r.tau.col(0).minCoeff();
    const double step = range / 200.0, angle = 2.0 * kPi / 65536.0;
    for (long i = 0; i < r.rows(); ++i) {
      r.tau(i, 0) = step * std::round(r.tau(i, 0) / step);
      for (int j = 0; j < kJoints; ++j) r.q(i, j) = angle * std::round(r.q(i, j) / angle);
    }
    CHECK(names(found(r)).empty());
  }
  SECTION("refreshed every few rows") {
    const int hold = GENERATE(2, 4);
    for (long i = 0; i < r.rows(); ++i) r.tau(i, 1) = r.tau(i - i % hold, 1);
    const ChannelFault f = only(found(r), "sample_and_hold", "tau_elbow");
    CHECK(std::abs(f.value / (250.0 / hold) - 1.0) < 0.01);
  }
  SECTION("single rows repeat the one before, in all channels") {
    const double share = GENERATE(0.01, 0.06);
    Rng rng(seed);
    double count = 0.0;
    for (long i = r.rows() - 2; i > 1; --i)
      if (rng.uniform() < share) {
        count += 1.0;
        r.q.row(i) = r.q.row(i - 1);
        r.qd.row(i) = r.qd.row(i - 1);
        r.tau.row(i) = r.tau.row(i - 1);
      }
    const std::vector<ChannelFault> faults = found(r);
    INFO(names(faults));
    REQUIRE(!faults.empty());
    CHECK(faults[0].fault == "stuck_samples");
    CHECK(faults[0].where == "all");
    // Two repeats in a row are not counted, and rows that hardly move.
    CHECK(std::abs(faults[0].value / share - 1.0) < 0.15 + 5.0 / std::sqrt(count));
  }
  SECTION("a torque that freezes and jumps") {
    r.tau.col(2).segment(3000, 250).setConstant(r.tau(3000, 2));
    r.tau(3250, 2) = r.tau(3000, 2) + 9.0;
    const std::vector<ChannelFault> faults = found(r);
    INFO(names(faults));
    CHECK(std::ranges::any_of(faults, [](const ChannelFault& f) {
      return f.fault == "frozen_channel" && f.channel == "tau_wrist" &&
             std::abs(f.value - 1.0) < 0.05;
    }));
  }
}

TEST_CASE("audit: a torque whose log ends early, or begins late", "[audit]") {
  const bool ends = GENERATE(true, false);
  const double held = GENERATE(0.0, 0.7);
  CAPTURE(ends, held);
  const auto spoiled = [&](long rows) {
    Recording r = clean_arm(2).recording;
    (ends ? r.tau.col(2).tail(rows) : r.tau.col(2).head(rows)).setConstant(held);
    return found(r);
  };
  const ChannelFault f = only(spoiled(3000), "frozen_channel", "tau_wrist");
  CHECK(std::abs(f.value - 0.004 * 2999) < 1e-9);
  CHECK_THAT(f.evidence, ContainsSubstring("3000 rows") && ContainsSubstring("the joint moves by"));
  CHECK(names(spoiled(9)).empty());
}

TEST_CASE("audit: clipping, limits and units", "[audit]") {
  const unsigned seed = GENERATE(range(0u, 6u));
  CAPTURE(seed);
  const Arm arm = clean_arm(seed);
  Recording r = arm.recording;
  const double high = r.tau.col(0).maxCoeff();
  SECTION("a torque at its limit") {
    const double limit = GENERATE(0.9, 0.6) * high;
    r.tau.col(0) = r.tau.col(0).cwiseMin(limit);
    const ChannelFault f = only(found(r), "torque_clipped", "tau_shoulder");
    CHECK(f.value == limit);
  }
  SECTION("a position at the end of its sensor") {
    const double limit = 0.8 * r.q.col(1).maxCoeff() + 0.2 * r.q.col(1).mean();
    const RowMatX<double> motion = r.q;
    r.q.col(1) = r.q.col(1).cwiseMin(limit);
    const auto is_clipped = [&] {
      return std::ranges::any_of(found(r), [](const ChannelFault& f) {
        return f.fault == "position_clipped" && f.channel == "q_elbow";
      });
    };
    CHECK(is_clipped());
    r.qcmd = motion;  // it was sent further
    CHECK(is_clipped());
    r.qcmd = r.q;  // it was to stay there
    CHECK_FALSE(is_clipped());
  }
  SECTION("spikes") {
    const long count = GENERATE(1, 20);
    for (long k = 0; k < count; ++k) r.tau(400 + 450 * k, 1) += k % 2 == 0 ? 5.0 : -4.0;
    const ChannelFault f = only(found(r), "spike", "tau_elbow");
    // 5 N·m plus the noise of three rows.
    CHECK(std::abs(f.value - 5.0) < 0.4);
    CHECK_THAT(f.evidence, ContainsSubstring(std::to_string(count) + " isolated"));
  }
  SECTION("a spike of eight standard deviations is none") {
    r.tau(400, 1) += 0.4;
    CHECK(names(found(r)).empty());
  }
  const auto joint = [](const char* name, double lower, double upper, double effort) {
    JointDescription out;
    out.name = name;
    out.lower = lower;
    out.upper = upper;
    out.effort = effort;
    return out;
  };
  const AuditLimits limits{.joints = {joint("shoulder", -3, 3, 40), joint("elbow", -3, 3, 40),
                                      joint("wrist", -3, 3, 40)}};
  SECTION("within the limits nothing is found") { CHECK(names(found(r, limits)).empty()); }
  SECTION("degrees") {
    r.q.col(1) *= 180.0 / kPi;
    r.qd.col(1) *= 180.0 / kPi;
    r.qcmd.col(1) *= 180.0 / kPi;
    const ChannelFault f = only(found(r, limits), "degrees", "q_elbow");
    CHECK_THAT(f.evidence, ContainsSubstring("q_elbow [deg]"));
  }
  SECTION("millimetres of a slide") {
    AuditLimits slide = limits;
    slide.joints[1] = {.name = "elbow", .prismatic = true, .lower = -3, .upper = 3, .effort = 40};
    r.q.col(1) *= 1000.0;
    r.qd.col(1) *= 1000.0;
    r.qcmd.col(1) *= 1000.0;
    const ChannelFault f = only(found(r, slide), "length_unit", "q_elbow");
    CHECK_THAT(f.evidence, ContainsSubstring("q_elbow [mm]"));
  }
  SECTION("an encoder that wraps") {
    const double middle = 0.5 * (r.q.col(1).minCoeff() + r.q.col(1).maxCoeff());
    for (long i = 0; i < r.rows(); ++i)
      r.q(i, 1) = std::remainder(r.q(i, 1) - middle + kPi, 2.0 * kPi);
    const ChannelFault f = only(found(r, limits), "position_wrapped", "q_elbow");
    CHECK_THAT(f.evidence, ContainsSubstring("whole turn"));
  }
  SECTION("a turn and back is no wrap") {
    r.q(5000, 1) += 2.0 * kPi;
    const std::string all = names(found(r, limits));
    CHECK_THAT(all, ContainsSubstring("spike q_elbow") && !ContainsSubstring("position_wrapped"));
  }
  SECTION("a position beyond its limit") {
    r.q.col(1).array() += 3.5;
    only(found(r, limits), "position_beyond_limit", "q_elbow");
  }
  SECTION("millinewton metres") {
    r.tau.col(2) *= 1000.0;
    only(found(r, limits), "torque_unit", "tau_wrist");
  }
  SECTION("a torque beyond its limit") {
    r.tau.col(2) *= 60.0 / r.tau.col(2).cwiseAbs().maxCoeff();
    const ChannelFault f = only(found(r, limits), "torque_beyond_limit", "tau_wrist");
    CHECK(std::abs(f.value - 60.0) < 1e-9);
  }
}

}  // namespace diffnea::test::audit_limits_test
