/// Errors beyond the signals' noise, whatever they depend on.

#include <cmath>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/diagnose/diagnose.hpp>

#include "support/rod.hpp"

namespace diffnea {
namespace {

/// A torque of 0.5 N·m beside the rod's that wanders within a quarter of a second, as a hose that
/// whips or a liquid that sloshes: no function of the motion.
Recording disturbed(unsigned seed) {
  constexpr double kStays = 0.984, kSize = 0.5;
  Rng rng(seed + 10);
  double wanders = 0.0;
  return test::rod_recording(seed, [&](double, double qd, double) {
    wanders = kStays * wanders + kSize * std::sqrt(1.0 - kStays * kStays) * rng.normal();
    return test::kRodFriction * std::tanh(qd / 0.02) + wanders;
  });
}

}  // namespace

TEST_CASE("diagnose: a disturbance that no sensor makes is never noise", "[diagnose]") {
  const Finding f = diagnose(test::rod(), {disturbed(1)}, {disturbed(2)});
  CHECK(f.verdict == Verdict::kUnknown);
  REQUIRE_FALSE(f.witness.empty());
  CHECK(f.witness.front().form == WitnessForm::kExcess);
  CHECK(f.witness.front().share > 0.9);
}

}  // namespace diffnea
