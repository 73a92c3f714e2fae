#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/record.hpp>

namespace diffnea::next_experiment_test {
namespace {

constexpr double kLag = 0.008;  ///< [s]

/// A double pendulum whose shoulder's drive lags.
struct LaggingArm {
  Model nominal = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  Model truth = nominal;

  LaggingArm() {
    truth.effects.push_back({"actuator_lag", "shoulder", {{"time_constant", kLag, "s"}}});
  }

  Recording record(const Trajectory& motion, std::uint64_t seed) const {
    RecordOptions options;
    options.period = 10.0;
    options.seed = seed;
    return record_model(truth, nominal, motion, options).recording;
  }
  Recording slow(std::uint64_t seed) const {
    FourierOptions motion;
    motion.seed = seed;
    motion.duration = 40.0;
    return record(random_fourier(nominal, motion), seed);
  }
};

/// √(Σ q̈²/Σ q̇²): the angular frequency of a harmonic motion. [rad/s]
double frequency(const Trajectory& t, long joint) {
  return t.qdd.col(joint).norm() / t.qd.col(joint).norm();
}

}  // namespace

TEST_CASE("next experiment: lag and delay, one in slow motion, are told apart by a fast one",
          "[diagnose][excite]") {
  const LaggingArm arm;
  DiagnoseOptions options;
  options.effects = {"actuator_lag", "actuator_delay"};
  const std::vector<Recording> test{arm.slow(2)};
  const Finding slow = diagnose(arm.nominal, {arm.slow(1)}, test, options);
  REQUIRE(slow.verdict == Verdict::kClass);
  REQUIRE(slow.next_experiment);
  const NextExperiment& next = *slow.next_experiment;
  REQUIRE(next.pairs.size() == 1);
  CHECK(std::abs(next.pairs[0].delta_bic) < 10.0);
  CHECK(next.expected_delta_bic > 10.0);
  CHECK(next.expected_delta_bic == next.pairs[0].expected_delta_bic);
  CHECK_THAT(next.sentence, Catch::Matchers::ContainsSubstring("Hz: expected ΔBIC between"));
  CHECK(next.trajectory == kNextExperimentFile);
  // Slow motion has its power below 0.5 Hz.
  REQUIRE(next.motion.joint_names.front() == "shoulder");
  constexpr double kOneHertz = 6.28;  // [rad/s]
  CHECK(frequency(next.motion, 0) > 2.0 * kOneHertz);

  const Finding fast = diagnose(arm.nominal, {arm.record(next.motion, 3)}, test, options);
  CHECK(fast.verdict == Verdict::kNamed);
  REQUIRE(fast.causes.size() == 1);
  CHECK(fast.causes[0].effect == "actuator_lag");
  CHECK_FALSE(fast.next_experiment);  // nothing is left to tell apart
}

}  // namespace diffnea::next_experiment_test
