/// Where a joint sticks, against a plain search over all windows.

#include <algorithm>
#include <cmath>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/core/random.hpp>

#include "diagnose/sticking.hpp"

using namespace diffnea;

namespace {

constexpr double kDt = 2e-3, kNoise = 1e-4;

/// A reversal at 10 rad/s², and one at which the joint stands still for `still` seconds.
VecX<double> positions(double still) {
  const long rows = 500, stop = 250, held = std::lround(still / kDt);
  Rng rng(1);
  VecX<double> q(rows);
  for (long i = 0; i < rows; ++i) {
    const long from = i < stop ? stop - i : std::max(0L, i - stop - held);
    const double t = kDt * static_cast<double>(from);
    q[i] = 5.0 * t * t + kNoise * rng.normal();
  }
  return q;
}

Standstill of_joint() { return standstill(kNoise, 1.5, 10.0, 13.0, kDt); }

}  // namespace

TEST_CASE("diagnose: a standstill is told from a reversal", "[diagnose]") {
  const std::vector<bool> turns = stands_still(positions(0.0), of_joint());
  CHECK(std::ranges::count(turns, true) == 0);

  const VecX<double> q = positions(0.08);
  const std::vector<bool> sticks = stands_still(q, of_joint());
  // All of it, and what comes before and after within the band: 11 ms to either side.
  for (long i = 250; i <= 290; ++i) CHECK(sticks[static_cast<std::size_t>(i)]);
  CHECK(std::ranges::count(sticks, true) <= 41 + 2 * 6);
}

TEST_CASE("diagnose: standstills are those of all windows", "[diagnose]") {
  Rng rng(2);
  VecX<double> walk(400);
  double at = 0.0;
  for (long i = 0; i < walk.size(); ++i) walk[i] = at += rng.uniform() < 0.3 ? rng.normal() : 0.0;
  for (const Standstill still : {Standstill{0.0, 5}, Standstill{1.0, 8}, Standstill{2.5, 30}}) {
    std::vector<bool> expected(400, false);
    for (long i = 0; i + still.rows <= walk.size(); ++i) {
      const auto window = walk.segment(i, still.rows);
      if (window.maxCoeff() - window.minCoeff() > still.band) continue;
      for (long k = i; k < i + still.rows; ++k) expected[static_cast<std::size_t>(k)] = true;
    }
    CAPTURE(still.band, still.rows);
    CHECK(std::ranges::count(expected, true) > 0);
    CHECK(std::ranges::count(expected, false) > 0);
    CHECK(stands_still(walk, still) == expected);
  }
}

TEST_CASE("diagnose: a joint that hardly ever moves faster than noise does not stick",
          "[diagnose]") {
  // 3 mrad/s through noise of 1 mrad: a band of 6 mrad takes 2 s, the window is longer.
  const Standstill still = standstill(1e-3, 3e-3, 0.01, 5.0, 0.01);
  CHECK(static_cast<double>(still.rows) * 0.01 > 2.0);
  const VecX<double> q = VecX<double>::LinSpaced(2000, 0.0, 2000 * 0.01 * 3e-3);
  CHECK(std::ranges::count(stands_still(q, still), true) == 0);
}
