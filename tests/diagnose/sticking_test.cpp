/// Where a joint sticks: reversals, standstills, and what noise makes of both.

#include "diagnose/sticking.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/core/random.hpp>

namespace sticking_test {

using namespace diffnea;

namespace {

constexpr double kDt = 2e-3, kNoise = 1e-4;
constexpr long kStop = 150;  ///< row at which a joint turns back

/// A joint that turns back at `before` and, `still` seconds later, sets off at `after` [rad/s²].
VecX<double> reversal(double before, double after, double still, Rng& rng) {
  const long held = std::lround(still / kDt);
  VecX<double> q(2 * kStop + held);
  for (long i = 0; i < q.size(); ++i) {
    const long away = i < kStop ? i - kStop : std::max(0L, i - kStop - held);
    const double t = kDt * static_cast<double>(away);
    q[i] = 0.5 * (away < 0 ? before : after) * t * t + kNoise * rng.normal();
  }
  return q;
}

/// Of a joint that reaches 1.5 rad/s at 10 rad/s².
Standstill of_joint() {
  PreprocessPlan plan;
  plan.dt = kDt;
  plan.filter_hz = 13.0;
  return standstill(kNoise, 1.5, 10.0, plan);
}

/// Turns of `count` such reversals.
std::vector<Turn> many(double before, double after, double still, int count = 40) {
  Rng rng(1);
  std::vector<Turn> out;
  for (int k = 0; k < count; ++k)
    for (const Turn& t : find_turns(reversal(before, after, still, rng), of_joint()))
      out.push_back(t);
  return out;
}

long left_out(const StuckRows& of) {
  long out = 0;
  for (const auto& rows : of.rows) out += std::ranges::count(rows, true);
  return out;
}

}  // namespace

TEST_CASE("diagnose: a standstill of the filter's length is told from a reversal", "[diagnose]") {
  const Standstill still = of_joint();
  Rng rng(2);
  const VecX<double> turns = reversal(10.0, 10.0, 0.0, rng);
  const auto none = stands_still(find_turns(turns, still), still, turns.size(), false);
  CHECK(std::ranges::count(none, true) == 0);

  const VecX<double> q = reversal(10.0, 10.0, 0.08, rng);
  const auto sticks = stands_still(find_turns(q, still), still, q.size(), false);
  // A low-pass of 13 Hz, twice, mixes within a period of its cut-off.
  CHECK(static_cast<double>(still.margin) * kDt > 0.25 / 13.0);
  CHECK(static_cast<double>(still.margin) * kDt < 1.0 / 13.0);
  // All of it but for what noise takes at its ends, and what comes before and after within the
  // band, 13 ms to either side.
  for (long i = kStop - still.margin + 3; i <= kStop + 40 + still.margin - 3; ++i)
    CHECK(sticks[static_cast<std::size_t>(i)]);
  CHECK(std::ranges::count(sticks, true) <= 41 + 2 * (8 + still.margin));
}

TEST_CASE("diagnose: reversals of any acceleration rest as long as reversals do", "[diagnose]") {
  for (const auto& [before, after] : {std::pair{10.0, 10.0}, {3.0, 3.0}, {15.0, 4.0}}) {
    CAPTURE(before, after);
    const std::vector<Turn> turns = many(before, after, 0.0);
    CHECK(turns.size() >= 40);
    CHECK_FALSE(sticks_at_turns(turns));
  }
}

TEST_CASE("diagnose: standstills too short for one are told from many", "[diagnose]") {
  // A reversal at 10 rad/s² is within the band for 25 ms.
  const std::vector<Turn> turns = many(10.0, 10.0, 0.008);
  CHECK(sticks_at_turns(turns));
  CHECK_FALSE(sticks_at_turns({turns.begin(), turns.begin() + 3}));  // three tell nothing
  const Standstill still = of_joint();
  const auto some = stands_still({turns.front()}, still, 2 * kStop, false);
  const auto all = stands_still({turns.front()}, still, 2 * kStop, true);
  CHECK(std::ranges::count(some, true) == 0);
  CHECK(std::ranges::count(all, true) ==
        turns.front().last - turns.front().first + 1 + 2 * still.margin);
}

TEST_CASE("diagnose: turns are the longest windows within the band", "[diagnose]") {
  // Without noise, and without averaging: three rows of a standstill take no mean.
  VecX<double> q(41);
  for (long i = 0; i < q.size(); ++i) q[i] = static_cast<double>((i - 20) * (i - 20));
  const Standstill still{16.0, 3, 1000, 0};
  const std::vector<Turn> turns = find_turns(q, still);
  REQUIRE(turns.size() == 1);
  CHECK(turns[0].first == 16);  // (±4)² within 16
  CHECK(turns[0].last == 24);
  CHECK(turns[0].rest == 9.0 / 8.0);  // (±8)² within 64: four rows more to either side
}

TEST_CASE("diagnose: what passes slowly does not stand still", "[diagnose]") {
  // 3 mrad/s through noise of 1 mrad.
  PreprocessPlan plan;
  plan.dt = 0.01;
  plan.filter_hz = 5.0;
  const Standstill still = standstill(1e-3, 3e-3, 0.01, plan);
  const VecX<double> q = VecX<double>::LinSpaced(20000, 0.0, 20000 * 0.01 * 3e-3);
  CHECK(find_turns(q, still).size() <= 2);  // where it begins and ends, nothing is beyond
  CHECK(std::ranges::count(stands_still(find_turns(q, still), still, q.size(), false), true) == 0);
}

TEST_CASE("diagnose: a joint that stands still throughout does so in all rows", "[diagnose]") {
  Rng rng(3);
  VecX<double> q(3000);
  for (long i = 0; i < q.size(); ++i) q[i] = 0.7 + kNoise * rng.normal();
  const Standstill still = of_joint();
  const auto rows = stands_still(find_turns(q, still), still, q.size(), false);
  CHECK(std::ranges::count(rows, false) == 0);
  CHECK(find_turns(VecX<double>(), still).empty());
}

TEST_CASE("diagnose: who turns back all the time keeps the turns", "[diagnose]") {
  const Standstill still = of_joint();
  Rng rng(4);
  std::vector<VecX<double>> seldom, often;
  for (int k = 0; k < 10; ++k) {
    seldom.push_back(reversal(10.0, 10.0, 0.006, rng));
    // As many, but nothing of the way to and from them.
    often.push_back(seldom.back().segment(kStop - 20, 43));
  }
  const StuckRows few = stuck_rows(seldom, still, Turns::kLeftOut),
                  many_of_them = stuck_rows(often, still, Turns::kLeftOut);
  CHECK(few.everywhere);
  for (const auto& rows : few.rows) CHECK(std::ranges::count(rows, true) > still.margin);
  CHECK_FALSE(many_of_them.everywhere);
  CHECK(left_out(many_of_them) < 10 * 43 / 2);
}

TEST_CASE("diagnose: of turns that are kept, standstills are left out", "[diagnose]") {
  const Standstill still = of_joint();
  Rng rng(6);
  std::vector<VecX<double>> sticks;
  for (int k = 0; k < 40; ++k) sticks.push_back(reversal(10.0, 10.0, 0.006, rng));
  const StuckRows kept = stuck_rows(sticks, still, Turns::kKept);
  CHECK_FALSE(kept.everywhere);
  CHECK(left_out(kept) < left_out(stuck_rows(sticks, still, Turns::kLeftOut)));
}

TEST_CASE("diagnose: noise at a standstill does not turn back", "[diagnose]") {
  JointSeries s;
  s.dt = kDt;
  s.qd.resize(5000, 1);  // 10 s: 3 s at 1 Hz, then none
  Rng rng(5);
  for (long i = 0; i < s.qd.rows(); ++i)
    s.qd(i, 0) = (i < 1500 ? std::cos(2.0 * M_PI * kDt * static_cast<double>(i)) : 0.0) +
                 1e-3 * rng.normal();
  CHECK(turn_rate({s}, 0, 0.01) == 0.6);  // six within 10 s
}

}  // namespace sticking_test
