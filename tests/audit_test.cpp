/// Faults put into clean channels by the test's own code, several sizes and seeds each; nothing is
/// found where nothing is wrong.

#include "diffnea/recording/audit.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <support/data_folder.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/identify/source.hpp>
#include <diffnea/io/audit_result.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/world.hpp>
#include <diffnea/sim/mujoco_world.hpp>

using Catch::Matchers::ContainsSubstring;

namespace diffnea {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kJoints = 3;
constexpr double kPeriod = 8.0;

/// A joint's motion: a Fourier series with known derivatives.
struct Series {
  double center = 0.0, period = kPeriod;
  std::vector<double> a, b;

  /// Derivative of order 0, 1 or 2 at time t.
  double at(double t, int order) const {
    double sum = order == 0 ? center : 0.0;
    for (std::size_t k = 0; k < a.size(); ++k) {
      const double w = 2.0 * kPi * static_cast<double>(k + 1) / period;
      const double phase = w * t + 0.5 * kPi * order;
      sum += std::pow(w, order) * (a[k] * std::sin(phase) + b[k] * std::cos(phase));
    }
    return sum;
  }
};

struct Arm {
  std::vector<Series> motion;
  Recording recording;
};

/// Torque of an arm whose joints are coupled by gravity and inertia, with friction at each.
double torque(const Arm& arm, int j, double t) {
  double load = 0.0, acceleration = 0.0, angle = 0.0;
  for (int i = 0; i < kJoints; ++i) {
    angle += arm.motion[i].at(t, 0);
    if (i >= j) load += (5.0 - i) * std::sin(angle);
    acceleration +=
        (i == j ? 0.6 : 0.25 * std::cos(arm.motion[i].at(t, 0))) * arm.motion[i].at(t, 2);
  }
  const double v = arm.motion[j].at(t, 1);
  return load + acceleration + (1.0 + 0.3 * j) * std::tanh(v / 0.01) + 0.4 * v;
}

/// 40 s at 250 Hz; noise of q 2e-5 rad, of q̇ 2 mrad/s, of τ 0.05 N·m.
Arm clean_arm(unsigned seed, bool noise = true, double period = kPeriod) {
  Arm arm;
  Rng rng(seed + 7000);
  for (int j = 0; j < kJoints; ++j) {
    Series s;
    s.period = period;
    s.center = rng.uniform(-0.5, 0.5);
    for (int k = 1; k <= 6; ++k) {
      s.a.push_back(0.3 * rng.normal() / k);
      s.b.push_back(0.3 * rng.normal() / k);
    }
    arm.motion.push_back(s);
  }
  Recording& r = arm.recording;
  const long rows = 10'000;
  r.source = "arm.csv";
  r.joint_names = {"shoulder", "elbow", "wrist"};
  r.has_tau.assign(kJoints, true);
  r.info.torque_sampling = TorqueSampling::kInstant;
  r.time.resize(rows);
  r.q.resize(rows, kJoints);
  r.qd = r.qcmd = r.tau = r.q;
  const double scale = noise ? 1.0 : 0.0;
  for (long i = 0; i < rows; ++i) {
    const double t = 0.004 * static_cast<double>(i);
    r.time[i] = t;
    for (int j = 0; j < kJoints; ++j) {
      r.qcmd(i, j) = arm.motion[j].at(t, 0);
      r.q(i, j) = arm.motion[j].at(t, 0) + scale * 2e-5 * rng.normal();
      r.qd(i, j) = arm.motion[j].at(t, 1) + scale * 2e-3 * rng.normal();
      r.tau(i, j) = torque(arm, j, t) + scale * 0.05 * rng.normal();
    }
  }
  return arm;
}

std::vector<ChannelFault> found(const Recording& r, const AuditLimits& limits = {}) {
  return audit({r}, limits).faults;
}

std::string names(const std::vector<ChannelFault>& faults) {
  std::string out;
  for (const ChannelFault& f : faults) out += f.fault + " " + f.channel + ": " + f.evidence + "\n";
  return out;
}

/// The one fault there is, of the given name and channel.
ChannelFault only(const std::vector<ChannelFault>& faults, const std::string& fault,
                  const std::string& channel) {
  INFO(names(faults));
  REQUIRE(faults.size() == 1);
  CHECK(faults[0].fault == fault);
  CHECK(faults[0].channel == channel);
  CHECK(!faults[0].evidence.empty());
  const auto known = audit_fault_names();
  CHECK(std::ranges::any_of(known, [&](const auto& k) { return k.first == faults[0].fault; }));
  return faults[0];
}

/// Of a value with a standard error: 5 of them (12 checks of 5 σ fail by chance once in 10⁵ runs),
/// and a share for what is no noise.
void check_near(const ChannelFault& f, double value, double share = 0.0) {
  CAPTURE(f.value, f.std, value);
  CHECK(std::abs(f.value - value) < 5.0 * f.std + share * std::abs(value));
}

}  // namespace

TEST_CASE("audit: nothing is found in clean channels", "[audit]") {
  const unsigned seed = GENERATE(range(0u, 40u));
  CAPTURE(seed);
  const Arm arm = clean_arm(seed);
  const AuditReport report = audit({arm.recording});
  INFO(names(report.faults));
  CHECK(report.faults.empty());
  REQUIRE(report.periods.size() == 1);
  CHECK(std::abs(report.periods[0].seconds - kPeriod) < 5.0 * report.periods[0].std + 1e-4);
}

TEST_CASE("audit: the false alarm rate is below 1 %", "[.][audit-study]") {
  int alarms = 0;
  for (unsigned seed = 1000; seed < 1400; ++seed) {
    const std::vector<ChannelFault> faults = found(clean_arm(seed).recording);
    if (faults.empty()) continue;
    ++alarms;
    UNSCOPED_INFO(seed << ": " << names(faults));
  }
  CHECK(alarms == 0);  // 0 of 400: below 0.75 % with 95 % confidence
}

TEST_CASE("audit: nothing is found without noise, nor without velocities", "[audit]") {
  const unsigned seed = GENERATE(range(0u, 5u));
  CAPTURE(seed);
  Recording r = clean_arm(seed, false).recording;
  CHECK(names(found(r)).empty());
  r.qd.resize(0, 0);
  const AuditReport report = audit({r});
  CHECK(names(report.faults).empty());
  CHECK(std::ranges::any_of(report.checks, [](const AuditCheck& c) {
    return !c.done && c.text.find("there is no column qd_") != std::string::npos;
  }));
}

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

TEST_CASE("audit: the same fault of many recordings is one", "[audit]") {
  std::vector<Recording> runs;
  for (unsigned seed = 0; seed < 4; ++seed) {
    runs.push_back(clean_arm(seed).recording);
    runs.back().run = static_cast<int>(seed);
    runs.back().source = "arm.csv run " + std::to_string(seed);
    if (seed > 0) runs.back().tau(900, 1) += 5.0 + seed;
  }
  const ChannelFault f = only(audit(runs).faults, "spike", "tau_elbow");
  CHECK(std::abs(f.value - 8.0) < 0.4);  // the noise of three rows
  CHECK_THAT(f.evidence, ContainsSubstring("in 3 of 4 recordings"));
  CHECK(f.source == "arm.csv run 3");
}

TEST_CASE("audit: the clock", "[audit]") {
  const unsigned seed = GENERATE(range(0u, 6u));
  CAPTURE(seed);
  const Arm arm = clean_arm(seed);
  Recording r = arm.recording;
  Rng rng(seed);
  /// Takes rows out, or moves the time at which rows are sampled, and samples anew.
  const auto resample = [&](const std::function<double(double)>& clock) {
    for (long i = 0; i < r.rows(); ++i) {
      const double t = clock(r.time[i]);
      for (int j = 0; j < kJoints; ++j) {
        r.q(i, j) += arm.motion[j].at(t, 0) - arm.motion[j].at(r.time[i], 0);
        r.qd(i, j) += arm.motion[j].at(t, 1) - arm.motion[j].at(r.time[i], 1);
        r.tau(i, j) += torque(arm, j, t) - torque(arm, j, r.time[i]);
      }
      r.time[i] = t;
    }
  };
  SECTION("missing rows") {
    const long missing = GENERATE(3, 50, 500);
    resample([&](double t) { return t < 15.0 ? t : t + 0.004 * static_cast<double>(missing); });
    const ChannelFault f = only(found(r), "time_gap", "time");
    CHECK(std::abs(f.value - 0.004 * static_cast<double>(missing + 1)) < 1e-9);
  }
  SECTION("one row that is missing is none") {
    resample([&](double t) { return t < 15.0 ? t : t + 0.004; });
    CHECK(names(found(r)).empty());
  }
  SECTION("jitter of the samples") {
    const double size = GENERATE(0.0004, 0.001);
    resample([&](double t) { return t + size * rng.uniform(-0.5, 0.5); });
    const ChannelFault f = only(found(r), "time_jitter", "time");
    // Difference of two uniform numbers of width `size`.
    CHECK(std::abs(f.value / (size / std::sqrt(6.0)) - 1.0) < 0.05);
    CHECK(f.severity == FaultSeverity::kNote);
  }
  SECTION("jitter of 1 % of the interval is none") {
    resample([&](double t) { return t + 4e-5 * rng.uniform(-1.0, 1.0); });
    CHECK(names(found(r)).empty());
  }
  SECTION("another rate") {
    const double change = GENERATE(0.005, 0.25, -0.1);
    resample([&](double t) { return t < 18.0 ? t : 18.0 + (1.0 + change) * (t - 18.0); });
    const std::vector<ChannelFault> faults = found(r);
    INFO(names(faults));
    REQUIRE(!faults.empty());
    CHECK(faults[0].fault == "time_rate_change");
    // The split falls between two of 40 blocks, so that one block mixes both rates.
    CHECK(std::abs(faults[0].value / change - 1.0) < 0.08);
  }
}

TEST_CASE("audit: a time in milliseconds", "[audit]") {
  Recording r = clean_arm(1).recording;
  r.time *= 1000.0;
  const std::vector<ChannelFault> faults = found(r);
  CHECK(std::ranges::count(faults, "time_unit", &ChannelFault::fault) == 1);
  r.time /= 25.0;  // every 0.16 s
  CHECK(std::ranges::count(found(r), "time_unit", &ChannelFault::fault) == 0);
}

TEST_CASE("audit: rows that are not listed are of the kind that is", "[audit]") {
  ReadReport reading;
  reading.rows = 100;
  reading.quarantined = 40;
  reading.quarantined_rows = {{3, "time repeats (0)"}, {5, "time repeats (0.1)"}};
  AuditReport report;
  add_reading(reading, report);
  REQUIRE(report.faults.size() == 1);
  CHECK(report.faults[0].fault == "repeated_time");
  CHECK(report.faults[0].value == 40.0);
}

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
    r.q.col(1) = r.q.col(1).cwiseMin(limit);
    const std::vector<ChannelFault> faults = found(r);
    INFO(names(faults));
    CHECK(std::ranges::any_of(faults, [](const ChannelFault& f) {
      return f.fault == "position_clipped" && f.channel == "q_elbow";
    }));
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

TEST_CASE("audit: friction tells the sign of a torque and whose it is", "[audit]") {
  const unsigned seed = GENERATE(range(0u, 6u));
  CAPTURE(seed);
  Recording r = clean_arm(seed).recording;
  SECTION("sign") {
    const int j = GENERATE(0, 1, 2);
    r.tau.col(j) *= -1.0;
    const ChannelFault f = only(found(r), "torque_sign", "tau_" + r.joint_names[j]);
    // The friction of the joint, with the wrong sign; the black box takes a tenth of it.
    check_near(f, -(1.0 + 0.3 * j), 0.1);
  }
  SECTION("swapped") {
    r.tau.col(0).swap(r.tau.col(1));
    only(found(r), "torque_swapped", "tau_shoulder");
  }
}

TEST_CASE("audit: the stated period is held against the motion", "[audit]") {
  const unsigned seed = GENERATE(range(0u, 6u));
  CAPTURE(seed);
  Recording r = clean_arm(seed).recording;
  for (const double right : {kPeriod, 2.0 * kPeriod}) {
    r.info.period = right;
    CHECK(names(found(r)).empty());
  }
  for (const double wrong : {7.5, 8.1, 10.0}) {
    r.info.period = wrong;
    const ChannelFault f = only(found(r), "period", "time");
    CHECK(f.value == wrong);
    CHECK_THAT(f.evidence, ContainsSubstring("repeat every 8"));
  }
  r.info.period = 30.0;  // once and a bit: cannot be checked, and that is said
  const AuditReport report = audit({r});
  CHECK(report.faults.empty());
  CHECK(std::ranges::any_of(
      report.checks, [](const AuditCheck& c) { return c.name == "stated period" && !c.done; }));
}

TEST_CASE("audit: two periods are enough, less are not", "[audit]") {
  const long period = static_cast<long>(kPeriod / 0.004);
  const auto first = [](long rows) {
    Recording r = clean_arm(3).recording;
    for (auto member : {&Recording::q, &Recording::qd, &Recording::qcmd, &Recording::tau})
      r.*member = RowMatX<double>((r.*member).topRows(rows));
    r.time = VecX<double>(r.time.head(rows));
    return r;
  };
  for (const long rows : {2 * period, 2 * period + 1}) {
    const Period found = detect_period(first(rows));
    CAPTURE(rows, found.seconds, found.std);
    CHECK(std::abs(found.seconds - kPeriod) < 5.0 * found.std + 1e-4);
    CHECK(std::abs(found.repeats - 2.0) < 2e-3);
  }
  CHECK(detect_period(first(2 * period - period / 50)).seconds == 0.0);
}

TEST_CASE("audit: a motion that does not repeat has no period", "[audit]") {
  Recording r = clean_arm(3).recording;
  for (long i = 0; i < r.rows(); ++i)
    for (int j = 0; j < kJoints; ++j) r.q(i, j) = std::sin(0.02 * std::pow(r.time[i], 2) + j);
  CHECK(detect_period(r).seconds == 0.0);
}

TEST_CASE("audit: recordings that are too short or still are no error", "[audit]") {
  Recording r = clean_arm(0).recording;
  SECTION("short") {
    for (auto member : {&Recording::q, &Recording::qd, &Recording::qcmd, &Recording::tau})
      r.*member = RowMatX<double>((r.*member).topRows(6));
    r.time = VecX<double>(r.time.head(6));
  }
  SECTION("still") {
    for (auto member : {&Recording::q, &Recording::qcmd}) (r.*member).setConstant(0.2);
    r.qd.setZero();
  }
  const AuditReport report = audit({r});
  INFO(names(report.faults));
  CHECK(report.faults.empty());
  CHECK(std::ranges::any_of(report.checks, [](const AuditCheck& c) { return !c.done; }));
}

TEST_CASE("audit: no recording, or of other joints, is refused", "[audit]") {
  CHECK_THROWS_AS(audit({}), DataError);
  Recording other = clean_arm(1).recording;
  other.joint_names[1] = "knee";
  CHECK_THROWS_AS(audit({clean_arm(0).recording, other}), DataError);
}

TEST_CASE("audit: simulated recordings are clean", "[audit]") {
  const unsigned seed = GENERATE(range(0u, 6u));
  const char* const robot = GENERATE("wam4", "furuta", "cart_pole");
  CAPTURE(seed, robot);
  const WorldSpec world = parse_world(std::string("mujoco:") + robot);
  const Model nominal = read_model(world.mjcf);
  FourierOptions motion;
  motion.duration = 20.0;
  motion.seed = seed;
  RecordOptions options;
  options.seed = seed + 1;
  options.period = motion.period;
  const SimulatedRecording s =
      record_in_mujoco(read_mjcf(world.mjcf), perturbed(nominal, surrogate_a(), seed), nominal,
                       random_fourier(nominal, motion), options);
  REQUIRE(s.failure.empty());
  const AuditReport report = audit({s.recording}, {.joints = describe_joints(nominal)});
  INFO(names(report.faults));
  CHECK((report.faults.empty() || s.saturated > 0));
}

TEST_CASE("audit: measured recordings hold what is known of them", "[audit][data]") {
  const std::filesystem::path folder = test::data_folder();
  const auto audited = [&](const char* file) { return audit_files({folder / file}); };
  const auto find = [](const AuditReport& report, const std::string& fault,
                       const std::string& channel) -> const ChannelFault* {
    const auto it = std::ranges::find_if(report.faults, [&](const ChannelFault& f) {
      return f.fault == fault && f.channel == channel;
    });
    return it == report.faults.end() ? nullptr : &*it;
  };
  const auto severe = [](const AuditReport& report) {
    return std::ranges::count(report.faults, FaultSeverity::kFault, &ChannelFault::severity);
  };
  SECTION("the Panda's velocities are filtered, and rows repeat") {
    // 4.8 to 5.8 ms by a separate computation (numpy, another low-pass, 1 to 8 Hz).
    const AuditReport report = audited("panda/exciting.csv");
    for (int j = 1; j <= 7; ++j) {
      const ChannelFault* lag =
          find(report, "velocity_filter_lag", "qd_panda_joint" + std::to_string(j));
      REQUIRE(lag != nullptr);
      CHECK(lag->value > 4.5e-3);
      CHECK(lag->value < 6.1e-3);
    }
    CHECK(std::ranges::count(report.faults, "stuck_samples", &ChannelFault::fault) > 0);
    CHECK(severe(report) == 0);
  }
  SECTION("the double pendulum's drives difference backward at 500 Hz") {
    for (const char* file : {"double_pendulum/record_00.csv", "double_pendulum/record_12.csv"})
      for (const char* channel : {"qd_shoulder", "qd_elbow"}) {
        const AuditReport report = audited(file);
        const ChannelFault* lag = find(report, "velocity_filter_lag", channel);
        REQUIRE(lag != nullptr);
        CHECK(std::abs(lag->value - 1e-3) < 5.0 * lag->std + 2e-5);
        CHECK_THAT(lag->evidence, ContainsSubstring("backward difference"));
        CHECK(severe(report) == 0);
      }
  }
  SECTION("EMPS is clean and repeats") {
    for (const char* file : {"emps/train.csv", "emps/test.csv"}) {
      const AuditReport report = audited(file);
      CHECK(names(report.faults).empty());
      CHECK(std::abs(report.periods[0].seconds - 6.24) < 1e-3);
    }
  }
  SECTION("UR10e: rows of garbage, the clock's jitter") {
    const AuditReport report = audited("ur10e/id_50s_15harm_loaded_mass_unstated.csv");
    const ChannelFault* garbage = find(report, "impossible_rows", "time");
    REQUIRE(garbage != nullptr);
    CHECK(garbage->value == 3.0);
    CHECK(find(report, "time_jitter", "time") != nullptr);
  }
  SECTION("a free pendulum has no torque") {
    const AuditReport report = audited("pendulum_free_swing/free_swing.csv");
    CHECK(find(report, "dead_channel", "tau_pendulum") != nullptr);
    CHECK(report.faults.size() == 1);
  }
}

TEST_CASE("audit: a ball alone is looked at, and the joints' checks say that there are none",
          "[recording]") {
  Recording r;
  constexpr long kRows = 2000;
  r.time = VecX<double>::LinSpaced(kRows, 0.0, 0.008 * (kRows - 1));
  r.q.resize(kRows, 0);
  r.tau.resize(kRows, 0);
  r.ball.resize(kRows, 3);
  for (long i = 0; i < kRows; ++i)
    r.ball.row(i) << std::sin(3.0 * r.time[i]), std::cos(2.0 * r.time[i]),
        1.0 + std::sin(r.time[i]);
  r.ball.middleRows(300, 50).setConstant(std::numeric_limits<double>::quiet_NaN());  // hidden
  CHECK(audit({r}).faults.empty());
  r.ball(1000, 2) += 5.0;
  const AuditReport report = audit({r});
  REQUIRE(report.faults.size() == 1);
  CHECK(report.faults[0].fault == "spike");
  CHECK(report.faults[0].where == "ball");
  CHECK(report.faults[0].channel == "ball_z");
}

}  // namespace diffnea
