/// Diagnoses of drives: numbers of the description that a log refutes, beside what is lacked.

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/diagnose/diagnose.hpp>

#include "support/servo_bench.hpp"

namespace diffnea::motion_diagnosis_test {
namespace {

constexpr test::SprungServo kBench;

/// The bench's description, with a gain of its drive.
Model described(double gain) {
  Model out = test::servo_bench(kBench.mass, kBench.length, kBench.inertia,
                                {{"armature", "servo", {{"armature", kBench.rotor, "kg*m^2"}}}});
  out.links[1].servo = ServoGains{gain, kBench.damping};
  return out;
}

Finding diagnosed(const Model& model) {
  test::SprungServo faster = kBench;
  faster.rate = 2.7;
  DiagnoseOptions options;
  options.effects = {"joint_spring"};
  return diagnose(model, {kBench.record(10.0)}, {faster.record(6.0)}, options);
}

}  // namespace

TEST_CASE("diagnose: a drive's gain that the log refutes is named, with what was described",
          "[diagnose]") {
  const Finding wrong = diagnosed(described(0.7 * kBench.stiffness));
  REQUIRE_FALSE(wrong.drives.empty());
  const RefutedNumber& gain = wrong.drives.front();
  CAPTURE(wrong.sentence, gain.name, gain.value, gain.std);
  CHECK(gain.name == "servo.position_servo.stiffness");
  CHECK(gain.described == 0.7 * kBench.stiffness);
  CHECK(std::abs(gain.value - kBench.stiffness) < 3.0 * gain.std);
  CHECK(gain.moves >
        10.0);  // σ: no smaller than what a simulation with the described gain is off by
  CHECK(wrong.joints.front().described > 10.0 * wrong.joints.front().base);
  CHECK_THAT(wrong.sentence, Catch::Matchers::ContainsSubstring(
                                 "The drives differ from the description: stiffness at servo"));
}

TEST_CASE("diagnose: drives that are those of the description are not said to differ",
          "[diagnose]") {
  const Finding right = diagnosed(described(kBench.stiffness));
  CAPTURE(right.sentence);
  CHECK(right.drives.empty());
  CHECK(right.joints.front().described < 1.5 * right.joints.front().base);
}

TEST_CASE("diagnose: what is beyond noise, and below a percent of the motion, is no unknown cause",
          "[diagnose]") {
  const bool large = GENERATE(false, true);
  const auto recorded = [&](test::SprungServo bench, double rate, double seconds) {
    bench.rate = rate;
    Recording r = bench.record(seconds);
    for (double& q : r.q.reshaped())  // graduation of the encoder; the motion is 0.5 rad rms
      q += (large ? 2e-2 : 2e-3) * std::sin(17.0 * q);
    return r;
  };
  DiagnoseOptions options;
  options.effects = {"joint_spring"};
  const Finding f = diagnose(described(kBench.stiffness), {recorded(kBench, 2.0, 10.0)},
                             {recorded(kBench, 2.7, 6.0)}, options);
  CAPTURE(f.sentence, f.gain.after);
  CHECK(f.gain.after > 2.0);  // times the noise
  CHECK(f.verdict == (large ? Verdict::kUnknown : Verdict::kNone));
}

}  // namespace diffnea::motion_diagnosis_test
