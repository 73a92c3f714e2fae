/// Faults put into clean channels by the test's own code, several sizes and seeds each; nothing is
/// found where nothing is wrong.

#include "diffnea/recording/audit.hpp"

#include <algorithm>
#include <cmath>
#include <support/audited_arm.hpp>
#include <support/data_folder.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/identify/source.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/runs/audit_result.hpp>
#include <diffnea/sim/mujoco_world.hpp>
#include <diffnea/worlds/world.hpp>

using Catch::Matchers::ContainsSubstring;

namespace diffnea::test::audit_test {

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
  for (const ChannelFault& fault : report.faults) {
    CAPTURE(fault.fault, fault.where, s.saturated);
    CHECK(fault.fault == "torque_clipped");
    CHECK(s.saturated > 0);
  }
}

TEST_CASE("audit: measured recordings hold what is known of them", "[audit][data]") {
  const std::filesystem::path folder = data_folder();
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

}  // namespace diffnea::test::audit_test
