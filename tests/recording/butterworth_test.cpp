#include "diffnea/recording/butterworth.hpp"

#include <cmath>
#include <numbers>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/core/error.hpp>

using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace diffnea::butterworth_test {
namespace {

/// Two ways to order the same recursion: scipy's own filtfilt and sosfiltfilt differ by 1e-14 here.
constexpr double kScipyTol = 1e-12;
constexpr double kPi = std::numbers::pi;

}  // namespace

TEST_CASE("butterworth: both ways it gives scipy's numbers, ends included", "[recording]") {
  // scipy 1.17: sosfiltfilt(butter(order, hz, fs=100, output='sos'), x),
  // x[k] = ((7k² + 3k) mod 23)/10 − 1, k = 0 … 39; its default extension is ours.
  struct Case {
    int order;
    double hz;
    double y[6];  // at k = 0, 1, 7, 20, 38, 39
  };
  const Case c = GENERATE(Case{4,
                               8.0,
                               {-1.004588058640951, -0.699162530675091, 0.4493110729529899,
                                -0.04009745212516779, -0.7176261375281161, -1.0205181393829135}},
                          Case{3,
                               8.0,
                               {-1.000647870373165, -0.7049763960965996, 0.44454524907876386,
                                -0.03372121902199281, -0.7133346929214445, -1.0051387127079783}},
                          Case{2,
                               1.0,
                               {-1.3041374081825794, -1.24516872508925, -0.9167499450147002,
                                -0.4373744999823609, -0.2709547506357514, -0.2714780302128673}});
  CAPTURE(c.order, c.hz);
  RowMatX<double> x(40, 2);
  for (int k = 0; k < 40; ++k) {
    x(k, 0) = ((7 * k * k + 3 * k) % 23) / 10.0 - 1.0;
    x(k, 1) = 5.0 - 2.0 * x(k, 0);  // columns do not mix, the filter is linear and keeps constants
  }
  Butterworth(c.order, c.hz, 100.0).filter_both_ways(x);
  const int at[] = {0, 1, 7, 20, 38, 39};
  for (int i = 0; i < 6; ++i) {
    CHECK_THAT(x(at[i], 0), WithinAbs(c.y[i], kScipyTol));
    CHECK_THAT(x(at[i], 1), WithinAbs(5.0 - 2.0 * c.y[i], kScipyTol));
  }
}

TEST_CASE("butterworth: a sine keeps its phase and takes the gain 1/(1 + (w/w_c)^2n)",
          "[recording]") {
  const int order = GENERATE(1, 2, 3, 4, 7);
  const double hz = GENERATE(2.0, 10.0, 25.0);
  CAPTURE(order, hz);
  const double rate = 500.0, cutoff = 10.0;
  const Butterworth filter(order, cutoff, rate);
  // The bilinear transform bends frequencies: w → tan(π f/rate).
  const double ratio = std::tan(kPi * hz / rate) / std::tan(kPi * cutoff / rate);
  const double gain = 1.0 / (1.0 + std::pow(ratio, 2.0 * order));
  CHECK_THAT(filter.response(hz), WithinRel(gain, 1e-9));
  RowMatX<double> x(4000, 1);
  const auto sine = [&](long k) {
    return std::sin(2.0 * kPi * hz * static_cast<double>(k) / rate + 0.3);
  };
  for (long k = 0; k < x.rows(); ++k) x(k, 0) = sine(k);
  filter.filter_both_ways(x);
  for (long k = 1800; k < 2200; ++k) CHECK_THAT(x(k, 0), WithinAbs(gain * sine(k), 1e-9));
}

TEST_CASE("butterworth: an impulse has faded to the share that memory() promises", "[recording]") {
  const double share = GENERATE(1e-3, 1e-9);
  const Butterworth filter(4, 5.0, 1000.0);
  RowMatX<double> x = RowMatX<double>::Zero(12001, 1);
  x(6000, 0) = 1.0;
  filter.filter_both_ways(x);
  const long memory = filter.memory(share);
  CAPTURE(share, memory);
  // Poles come in pairs of two directions: a factor of the order of 10 stands before the decay.
  CHECK(x.col(0).tail(6000 - memory).cwiseAbs().maxCoeff() < 10.0 * share * x(6000, 0));
  CHECK(std::abs(x(6000 + memory, 0) - x(6000 - memory, 0)) < 1e-14);
}

TEST_CASE("butterworth: a line passes unchanged, a short series too", "[recording]") {
  const long rows = GENERATE(1L, 2L, 5L, 300L);
  RowMatX<double> x(rows, 1);
  for (long k = 0; k < rows; ++k) x(k, 0) = 3.0 - 0.25 * static_cast<double>(k);
  const RowMatX<double> before = x;
  Butterworth(4, 10.0, 100.0).filter_both_ways(x);
  // Point reflection continues a line; only the settled start of the recursion bends its far ends.
  // Rounding leaves 5e-14 in the middle of a long one. What is shorter than the filter's memory
  // keeps its size: 0.46 is the most observed, of two rows.
  const double tolerance = rows == 300 ? 1e-12 : rows == 1 ? 0.0 : 0.5;
  CHECK(std::abs(x(rows / 2, 0) - before(rows / 2, 0)) <= tolerance);
  CHECK(x.allFinite());
}

TEST_CASE("butterworth: a cut-off that the rate cannot hold is refused", "[recording]") {
  CHECK_THROWS_AS(Butterworth(4, 50.0, 100.0), DataError);
  CHECK_THROWS_AS(Butterworth(4, 0.0, 100.0), DataError);
  CHECK_THROWS_AS(Butterworth(0, 1.0, 100.0), DataError);
  CHECK_THROWS_AS(Butterworth(4, std::nan(""), 100.0), DataError);
}

}  // namespace diffnea::butterworth_test
