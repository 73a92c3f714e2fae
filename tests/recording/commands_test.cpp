#include "diffnea/recording/commands.hpp"

#include <algorithm>
#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/recording/audit.hpp>

#include "recording/command_lag.hpp"
#include "recording/held_rows.hpp"

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;

namespace diffnea::commands_test {
namespace {

constexpr double kDt = 0.01, kSeconds = 30.0;
/// Steps, and a sum of sines, of which drives are asked.
enum class Motion { kSteps, kSines };

double command_at(double t, Motion motion) {
  if (motion == Motion::kSines)
    return 0.5 * std::sin(2.0 * t) + 0.2 * std::sin(5.3 * t + 1.0) + 0.1 * std::sin(9.1 * t);
  return 0.5 * std::sin(std::floor(t / 1.3) * 2.0);
}

/// A drive of first order with a delay, and the encoder's noise. One joint, no torque.
Recording driven(Motion motion, double time_constant, double delay, unsigned seed = 1) {
  Rng rng(seed);
  Recording r;
  r.source = "servo.csv";
  r.joint_names = {"servo"};
  r.has_tau = {false};
  const long rows = std::lround(kSeconds / kDt);
  r.time = VecX<double>::LinSpaced(rows, 0.0, kSeconds - kDt);
  r.q.resize(rows, 1);
  r.qcmd.resize(rows, 1);
  r.tau.setConstant(rows, 1, std::nan(""));
  double x = command_at(0.0, motion);
  for (long i = 0; i < rows; ++i) {
    r.qcmd(i, 0) = command_at(r.time[i], motion);
    r.q(i, 0) = x + 1e-4 * rng.normal();
    constexpr int kSteps = 20;
    for (int k = 0; k < kSteps; ++k)
      x += kDt / kSteps / time_constant *
           (command_at(r.time[i] + k * kDt / kSteps - delay, motion) - x);
  }
  return r;
}

const std::vector<JointDescription> kServo{{.name = "servo"}};

}  // namespace

TEST_CASE("commands: the lag of a drive is its delay and its time constant", "[recording]") {
  // Sines far below 1 / time constant come late by the sum of both.
  const Recording r = driven(Motion::kSines, 0.02, 0.04);
  const auto lag = detail::find_command_lag({r}, 0);
  REQUIRE(lag);
  CHECK_THAT(lag->seconds, WithinAbs(0.06, 0.005));
  CHECK_FALSE(lag->is_early(5.0));
}

TEST_CASE("commands: a drive that follows is not accused", "[recording]") {
  const Motion motion = GENERATE(Motion::kSteps, Motion::kSines);
  const double time_constant = GENERATE(0.01, 0.1), delay = GENERATE(0.0, 0.02);
  CAPTURE(motion, time_constant, delay);
  CHECK(find_early_responses(kServo, {driven(motion, time_constant, delay)}).empty());
  CHECK_NOTHROW(require_commands(kServo, {driven(motion, time_constant, delay)}));
}

TEST_CASE("commands: exchanged columns are refused", "[recording]") {
  const Motion motion = GENERATE(Motion::kSteps, Motion::kSines);
  CAPTURE(motion);
  Recording r = driven(motion, 0.05, 0.02);
  std::swap(r.q, r.qcmd);
  CHECK_THROWS_WITH(require_commands(kServo, {r}),
                    ContainsSubstring("q_servo moves ") && ContainsSubstring("before qcmd_servo") &&
                        ContainsSubstring("--map \"q_servo=qcmd_servo,qcmd_servo=q_servo\""));
  // Steps are in the command: what has them is no response.
  if (motion == Motion::kSteps)
    CHECK_THROWS_WITH(require_commands(kServo, {r}), ContainsSubstring("are exchanged;"));
}

TEST_CASE("commands: a command that is stamped after its response is refused", "[recording]") {
  Recording r = driven(Motion::kSines, 0.02, 0.01);
  const long late = 12;  // rows
  r.qcmd.bottomRows(r.rows() - late) = RowMatX<double>(r.qcmd.topRows(r.rows() - late));
  CHECK_THROWS_WITH(require_commands(kServo, {r}), ContainsSubstring("stamped too late"));
  const AuditReport report = audit({r});
  const auto fault = std::ranges::find(report.faults, "command_late", &ChannelFault::fault);
  REQUIRE(fault != report.faults.end());
  CHECK_THAT(fault->value, WithinAbs(0.03 - 0.12, 0.01));
}

TEST_CASE("commands: rows too far apart, and degrees, are refused", "[recording]") {
  Recording slow = driven(Motion::kSines, 0.02, 0.01);
  slow.time *= 100.0;  // 1 Hz
  CHECK_THROWS_WITH(require_commands(kServo, {slow}), ContainsSubstring("rows are 1 s apart"));
  Recording degrees = driven(Motion::kSines, 0.02, 0.01);
  degrees.q *= 57.3;
  degrees.qcmd *= 57.3;
  const std::vector<JointDescription> limited{{.name = "servo", .lower = -1.0, .upper = 1.0}};
  CHECK_THROWS_WITH(require_commands(limited, {degrees}), ContainsSubstring("`q_servo [deg]`"));
  degrees.q /= 57.3;
  CHECK_THROWS_WITH(require_commands(limited, {degrees}), ContainsSubstring("`qcmd_servo [deg]`"));
}

TEST_CASE("commands: a servo that rests where it turns is not clipped, one that is held is told",
          "[audit]") {
  constexpr double kFriction = 0.05, kStop = 0.5;  // [rad]; its drive follows at once
  const bool stops = GENERATE(false, true);
  Recording r = driven(Motion::kSines, 0.02, 0.0);
  double q = 0.0;
  for (long i = 0; i < r.rows(); ++i) {
    r.qcmd(i, 0) = std::sin(0.9 * r.time[i]) + 0.02 * std::sin(7.0 * r.time[i]);
    q = std::clamp(q, r.qcmd(i, 0) - kFriction, r.qcmd(i, 0) + kFriction);
    r.q(i, 0) = q = std::min(q, stops ? kStop : 2.0);
  }
  const AuditReport report = audit({r});
  const auto is = [&](const char* name) {
    return std::ranges::count(report.faults, name, &ChannelFault::fault);
  };
  CHECK(is("position_clipped") == 0);
  REQUIRE(is("held") == (stops ? 1 : 0));
  if (!stops) return;
  const ChannelFault& held = *std::ranges::find(report.faults, "held", &ChannelFault::fault);
  CHECK(held.severity == FaultSeverity::kNote);
  CHECK(held.channel == "q_servo");
  CHECK_THAT(held.value, WithinAbs(1.0 - kStop, 0.05));
  CHECK_THAT(held.evidence, ContainsSubstring("near 0.5 rad"));
}

TEST_CASE("commands: fingers that close on an object are held, though their command jumped",
          "[audit]") {
  constexpr double kFriction = 0.02, kObject = 0.3;
  Recording r = driven(Motion::kSteps, 0.05, 0.0);
  double q = 0.5;
  for (long i = 0; i < r.rows(); ++i) {
    const double phase = std::fmod(r.time[i], 6.0);  // closes, on an object every other time; opens
    r.qcmd(i, 0) = 0.6 - (phase < 3.0 ? 0.6 * std::min(phase / 0.4, 1.0)
                                      : 0.6 * std::max(0.0, 1.0 - (phase - 3.0) / 0.4));
    const double pull = r.qcmd(i, 0) - q, moves = std::abs(pull) - kFriction;
    if (moves > 0.0) q += 0.2 * std::copysign(moves, pull);
    if (std::fmod(r.time[i], 12.0) < 6.0) q = std::max(q, kObject);
    r.q(i, 0) = q;
  }
  const std::vector<detail::HeldRows> held = detail::find_held({r}, 0);
  REQUIRE(held.size() == 3);
  for (const detail::HeldRows& h : held) {
    CHECK_THAT(h.at, WithinAbs(kObject, 1e-6));
    CHECK_THAT(h.beyond, WithinAbs(-kObject, 0.02));
    CHECK(h.rows > 200);
    CHECK(h.rows < 350);
  }
}

TEST_CASE("commands: several drives under one stamp are a note, with their lags", "[audit]") {
  Recording r = driven(Motion::kSines, 0.02, 0.01), other = driven(Motion::kSines, 0.02, 0.03, 2);
  r.joint_names = {"pan", "lift"};
  r.has_tau = {false, false};
  for (auto member : {&Recording::q, &Recording::qcmd, &Recording::tau}) {
    RowMatX<double> both(r.rows(), 2);
    both << r.*member, other.*member;
    r.*member = both;
  }
  const AuditReport report = audit({r});
  const auto note = std::ranges::find(report.faults, "one_time_stamp", &ChannelFault::fault);
  REQUIRE(note != report.faults.end());
  CHECK(note->severity == FaultSeverity::kNote);
  CHECK_THAT(note->value, WithinAbs(kDt, 1e-12));
  CHECK_THAT(note->evidence, ContainsSubstring("(pan)") && ContainsSubstring("(lift)"));
  r.has_tau = {true, true};  // commands are not used then
  r.tau.setOnes();
  for (const ChannelFault& f : audit({r}).faults) CHECK(f.fault != "one_time_stamp");
}

TEST_CASE("commands: a missing torque is said, with what there is", "[recording]") {
  Recording r = driven(Motion::kSteps, 0.02, 0.01);
  r.extra.push_back({"load_raw", VecX<double>::Zero(r.rows())});
  CHECK(why_no_torque({r}) ==
        "no joint has a torque column (tau_JOINT), so there is no torque to explain; there are "
        "positions (q_) of servo; desired positions (qcmd_) of servo, to which "
        "`diffnea identify` and `diffnea diagnose` fit drives; extra channels load_raw");
  CHECK_THROWS_WITH(require_torque(kServo, {r}),
                    ContainsSubstring("servo.csv: no joint has a torque column"));
  Recording exchanged = r;
  std::swap(exchanged.q, exchanged.qcmd);
  CHECK_THROWS_WITH(require_torque(kServo, {exchanged}), ContainsSubstring("are exchanged;"));
  Recording by_torque = r;
  by_torque.taucmd = r.qcmd;
  CHECK_THAT(why_no_torque({by_torque}), !ContainsSubstring("taucmd_"));  // beside positions
  by_torque.qcmd.resize(0, 0);
  CHECK_THAT(why_no_torque({by_torque}),
             ContainsSubstring("if the drives give them: --map \"taucmd_servo=tau_servo\""));
  Recording measured = r;
  measured.has_tau = {true};
  CHECK_NOTHROW(require_torque(kServo, {measured}));
  CHECK(why_no_torque({r, measured}).empty());
  r.info.passive = {"servo"};
  CHECK(why_no_torque({r}).empty());
}

}  // namespace diffnea::commands_test
