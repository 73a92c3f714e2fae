#include "diffnea/recording/refresh.hpp"

#include <cmath>

#include <catch2/catch_test_macros.hpp>

namespace diffnea::refresh_test {

namespace {

/// A sine on a grid, of which the sensor has a new value every so many rows.
Recording slow(int every, double step) {
  Recording r;
  r.joint_names = {"one"};
  r.has_tau = {true};
  constexpr long kRows = 400;
  r.time = VecX<double>::LinSpaced(kRows, 0.0, 0.399);
  r.q = r.tau = RowMatX<double>::Zero(kRows, 1);
  for (long k = 0; k < kRows; ++k) {
    const double t = 0.001 * static_cast<double>(k - k % every);
    r.q(k, 0) = std::round(std::sin(9.0 * t) / step) * step;
    r.tau(k, 0) = r.q(k, 0);
  }
  return r;
}

}  // namespace

TEST_CASE("refresh: a sensor that is slower than the log is told from a coarse one",
          "[recording]") {
  CHECK(refresh_rows({slow(4, 1e-4)}) == std::vector<int>{4});
  CHECK(refresh_rows({slow(4, 1e-4)}, &Recording::tau) == std::vector<int>{4});
  CHECK(refresh_rows({slow(1, 1e-4)}) == std::vector<int>{1});
  // Values stay for several rows, and then move by one step of the grid.
  CHECK(refresh_rows({slow(1, 5e-2)}) == std::vector<int>{1});
}

TEST_CASE("refresh: the step of an encoder, by a log of few digits and fast motion",
          "[recording]") {
  const double step = 2.0 * 3.14159265358979 / 4096.0;
  VecX<double> q(600), changes(599);
  for (long k = 0; k < q.size(); ++k) {
    const double ticks = std::round(1.2 * std::sin(0.02 * static_cast<double>(k)) / step);
    q[k] = std::round(1e5 * ticks * step) * 1e-5;
    if (k > 0) changes[k - 1] = q[k] - q[k - 1];
  }
  const double found = quantisation_step({q.begin(), q.end()}, {changes.begin(), changes.end()});
  CHECK(std::abs(found - step) < 1e-3 * step);
}

TEST_CASE("refresh: between two new values lies the line through them", "[recording]") {
  VecX<double> channel(8);
  channel << 1.0, 1.0, 3.0, 3.0, 7.0, 7.0, 9.0, 9.0;
  VecX<double> filled = channel;
  fill_stale(filled, 2);
  VecX<double> expected(8);
  expected << 1.0, 2.0, 3.0, 5.0, 7.0, 8.0, 9.0, 10.0;
  CHECK(filled == expected);
  fill_stale(channel, 1);
  CHECK(channel[1] == 1.0);
}

}  // namespace diffnea::refresh_test
