/// Faults put into a clean clock, and the period of what repeats.

#include <algorithm>
#include <cmath>
#include <functional>
#include <support/audited_arm.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/random.hpp>
#include <diffnea/recording/audit.hpp>

using Catch::Matchers::ContainsSubstring;

namespace diffnea::test::audit_time_test {

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

TEST_CASE("audit: a slow log is not one in milliseconds", "[audit]") {
  Recording r = clean_arm(1).recording;  // 40 s, which as milliseconds would be nothing
  const auto rows = Eigen::seq(0, r.rows() - 1, 100);
  r.time = VecX<double>(r.time(rows));
  for (auto member : {&Recording::q, &Recording::qd, &Recording::qcmd, &Recording::tau})
    r.*member = RowMatX<double>((r.*member)(rows, Eigen::all));
  CHECK(std::ranges::count(found(r), "time_unit", &ChannelFault::fault) == 0);
}

TEST_CASE("audit: pauses that are cut out are no fault, rows that are interpolated are",
          "[audit]") {
  Recording r = clean_arm(1).recording;
  const long half = r.rows() / 2;
  r.time.tail(half).array() += 60.0;
  const ChannelFault pause = only(found(r), "time_gap", "time");
  CHECK(pause.severity == FaultSeverity::kNote);
  CHECK_THAT(pause.evidence, ContainsSubstring("1 pause") && ContainsSubstring("cut there"));
  Recording lossy = clean_arm(1).recording;
  std::vector<long> kept;  // two of twelve rows are lost
  for (long i = 0; i < lossy.rows(); ++i)
    if (i % 12 > 1) kept.push_back(i);
  lossy.time = VecX<double>(lossy.time(kept));
  for (auto member : {&Recording::q, &Recording::qd, &Recording::qcmd, &Recording::tau})
    lossy.*member = RowMatX<double>((lossy.*member)(kept, Eigen::all));
  const std::vector<ChannelFault> faults = found(lossy);
  INFO(names(faults));
  const auto gap = std::ranges::find(faults, "time_gap", &ChannelFault::fault);
  REQUIRE(gap != faults.end());
  CHECK(gap->severity == FaultSeverity::kFault);
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

}  // namespace diffnea::test::audit_time_test
