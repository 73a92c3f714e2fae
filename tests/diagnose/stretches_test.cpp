/// Where a motion that repeats has settled, and whether it repeats.

#include "diagnose/stretches.hpp"

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/core/random.hpp>

namespace stretches_test {

using namespace diffnea;
using Catch::Matchers::WithinAbs;

namespace {

constexpr double kStep = 0.01, kPeriod = 10.0, kNoise = 1e-4;

/// A joint that swings by 1 rad; its loop starts 0.2 rad behind and catches up.
/// @param catches_up  time constant [s]; 0: it is there from the start
JointSeries swinging(double seconds, double catches_up) {
  JointSeries s;
  s.dt = kStep;
  const long rows = std::lround(seconds / kStep);
  s.q.resize(rows, 1);
  Rng rng(1);
  for (long i = 0; i < rows; ++i) {
    const double t = kStep * static_cast<double>(i);
    s.q(i, 0) = std::sin(2.0 * M_PI * t / kPeriod) + kNoise * rng.normal();
    if (catches_up > 0.0) s.q(i, 0) -= 0.2 * std::exp(-t / catches_up);
  }
  s.qd = s.qdd = s.logged = s.q;
  return s;
}

JointSeries settled(double seconds, double catches_up) {
  JointSeries s = swinging(seconds, catches_up);
  const long from = settling_rows(kPeriod, s);
  for (RowMatX<double>* x : {&s.q, &s.qd, &s.qdd, &s.logged})
    *x = RowMatX<double>(x->bottomRows(x->rows() - from));
  return s;
}

}  // namespace

TEST_CASE("settling_rows: a loop that starts at rest is left out until it follows", "[diagnose]") {
  const double seconds = GENERATE(18.5, 20.0, 30.0, 41.0);
  CAPTURE(seconds);
  CHECK(settling_rows(kPeriod, swinging(seconds, 0.0)) == 0);
  // Over windows of 0.1 s, differences are five times what noise makes of them until the loop is
  // within 5 √2 noises: 0.2 exp(−t/τ) = 7.1e-4 after 5.6 τ = 1.69 s.
  const double end = kStep * static_cast<double>(settling_rows(kPeriod, swinging(seconds, 0.3)));
  CHECK_THAT(end, WithinAbs(1.69, 0.15));
}

TEST_CASE("repeats: two periods are enough once what settles is left out", "[diagnose]") {
  CHECK_FALSE(repeats(kPeriod, swinging(20.0, 0.3)));
  CHECK(repeats(kPeriod, settled(20.0, 0.3)));
  CHECK_FALSE(repeats(kPeriod, swinging(13.0, 0.0)));  // four seconds of ten have no other
  CHECK_FALSE(repeats(0.9 * kPeriod, swinging(20.0, 0.0)));
  CHECK_FALSE(repeats(0.0, swinging(20.0, 0.0)));
}

TEST_CASE("settling_rows: nothing is left out of less than two periods", "[diagnose]") {
  CHECK(settling_rows(kPeriod, swinging(16.0, 0.3)) == 0);
  CHECK(settling_rows(0.0, swinging(16.0, 0.3)) == 0);
}

}  // namespace stretches_test
