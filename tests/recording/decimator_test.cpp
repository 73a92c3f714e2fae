#include "diffnea/recording/decimator.hpp"

#include <cmath>
#include <numbers>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>

using Catch::Matchers::WithinAbs;

namespace diffnea::decimator_test {
namespace {

constexpr double kPi = std::numbers::pi;

RowMatX<double> random_rows(unsigned seed, long rows, long columns) {
  Rng rng(seed);
  RowMatX<double> out(rows, columns);
  for (long i = 0; i < out.size(); ++i) out.data()[i] = rng.normal();
  return out;
}

}  // namespace

TEST_CASE("decimator: its coefficients are scipy's, symmetric, and sum to 1", "[recording]") {
  // scipy 1.17: firwin(243, 25, window=('kaiser', kaiser_beta(60)), fs=1000) at 0, ±1, ±10, ±50,
  // ±121
  const Decimator d({.rate_hz = 1000.0, .factor = 20});
  REQUIRE(d.coefficients().size() == 243);
  const std::pair<int, double> expected[] = {{0, 0.05002436154406379},
                                             {1, 0.049810178942000426},
                                             {10, 0.031293095109783446},
                                             {50, 0.004038429886485855},
                                             {121, 8.394278589931985e-06}};
  for (const auto& [k, h] : expected) {
    // A ratio of Bessel functions of 5.65, each to a few units in the last place.
    CHECK_THAT(d.coefficients()[121 + k], WithinAbs(h, 1e-15));
    CHECK(d.coefficients()[121 + k] == d.coefficients()[121 - k]);
  }
  CHECK_THAT(d.response(0.0), WithinAbs(1.0, 1e-14));
}

TEST_CASE("decimator: passes and stops to the promised ripple", "[recording]") {
  const int factor = GENERATE(2, 5, 20, 50);
  const double attenuation = GENERATE(40.0, 60.0, 90.0);
  CAPTURE(factor, attenuation);
  const double out_hz = 1000.0 / factor;
  const Decimator d({.rate_hz = 1000.0, .factor = factor, .attenuation_db = attenuation});
  // Kaiser's formula for the order is a fit, up to 3 dB off at 90 dB.
  const double ripple = 1.5 * std::pow(10.0, -attenuation / 20.0);
  for (double hz = 0.0; hz < 0.35 * out_hz; hz += 0.01 * out_hz)
    CHECK_THAT(d.response(hz), WithinAbs(1.0, ripple));
  for (double hz = 0.65 * out_hz; hz < 500.0; hz += 0.013 * out_hz) CHECK(d.response(hz) < ripple);
}

TEST_CASE("decimator: a line and a sine come out at their centres, without any phase",
          "[recording]") {
  Decimator d({.rate_hz = 1000.0, .factor = 20});
  const double hz = 10.0;
  RowMatX<double> rows(2000, 3);
  for (long i = 0; i < rows.rows(); ++i)
    rows.row(i) << static_cast<double>(i),
        std::sin(2.0 * kPi * hz * static_cast<double>(i) / 1000.0), 1.0;
  const RowMatX<double> out = d.push(rows);
  REQUIRE(out.rows() == (2000 - 243) / 20 + 1);
  for (long k = 0; k < out.rows(); ++k) {
    const double center = static_cast<double>(d.center(k));
    CHECK_THAT(out(k, 0), WithinAbs(center, 1e-10));
    CHECK_THAT(out(k, 1),
               WithinAbs(d.response(hz) * std::sin(2.0 * kPi * hz * center / 1000.0), 1e-12));
    CHECK_THAT(out(k, 2), WithinAbs(1.0, 1e-14));
  }
}

TEST_CASE("decimator: blocks of any size give the rows of the whole, bit by bit", "[recording]") {
  const long block = GENERATE(1L, 3L, 64L, 243L, 1000L);
  const int factor = GENERATE(1, 7, 20);
  CAPTURE(block, factor);
  const DecimatorOptions options{
      .rate_hz = 1000.0, .factor = factor, .pass_hz = factor == 1 ? 50.0 : 0.0};
  const RowMatX<double> rows = random_rows(1, 1500, 4);
  const RowMatX<double> whole = Decimator(options).push(rows);
  Decimator d(options);
  for (int pass = 0; pass < 2; ++pass) {  // the second after reset()
    long at = 0;
    for (long i = 0; i < rows.rows(); i += block) {
      const RowMatX<double> out = d.push(rows.middleRows(i, std::min(block, rows.rows() - i)));
      for (long k = 0; k < out.rows(); ++k) REQUIRE(out.row(k) == whole.row(at + k));
      at += out.rows();
    }
    CHECK(at == whole.rows());
    d.reset();
  }
}

TEST_CASE("decimator: noise_gain is the share of white noise that is left", "[recording]") {
  Decimator d({.rate_hz = 1000.0, .factor = 10});
  const RowMatX<double> out = d.push(random_rows(3, 200'000, 1));
  const double variance = out.col(0).squaredNorm() / static_cast<double>(out.rows());
  // 20 000 nearly independent values: the variance is known to 1 %.
  CHECK(std::abs(variance / d.noise_gain() - 1.0) < 0.04);
}

TEST_CASE("decimator: factor 1 without a pass band copies", "[recording]") {
  const RowMatX<double> rows = random_rows(2, 10, 3);
  Decimator d({.rate_hz = 100.0, .factor = 1});
  CHECK(d.push(rows) == rows);
  CHECK(d.half_length() == 0);
}

TEST_CASE("decimator: bands that make no sense are refused", "[recording]") {
  CHECK_THROWS_AS(Decimator({.rate_hz = 100.0, .factor = 0}), DataError);
  CHECK_THROWS_AS(Decimator({.rate_hz = 100.0, .factor = 2, .pass_hz = 30.0, .stop_hz = 20.0}),
                  DataError);
  CHECK_THROWS_AS(Decimator({.rate_hz = 100.0, .factor = 2, .pass_hz = 30.0, .stop_hz = 60.0}),
                  DataError);
  // Some 10^8 rows: refused before memory is taken.
  CHECK_THROWS_AS(Decimator({.rate_hz = 1e5, .factor = 1, .pass_hz = 3e-3}), DataError);
  CHECK_THROWS_AS(Decimator({.rate_hz = 1e5, .factor = 1, .pass_hz = 1e-30}), DataError);
  Decimator d({.rate_hz = 1000.0, .factor = 20});
  d.push(random_rows(1, 10, 3));
  CHECK_THROWS_AS(d.push(random_rows(1, 10, 4)), ShapeError);
}

}  // namespace diffnea::decimator_test
