#include "recording/unwrapper.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

namespace diffnea::unwrapper_test {
namespace {

constexpr double kTurn = 6.283185307179586;
/// Whole turns of a few are subtracted and added.
constexpr double kRounding = 1e-12;

/// An accelerating wheel, and what an encoder from −π to π, or from 0 to 2π, makes of it.
Recording wheel(double from) {
  Recording r;
  r.source = "wheel.csv";
  r.joint_names = {"wheel"};
  r.has_tau = {false};
  r.time = VecX<double>::LinSpaced(1000, 0.0, 9.99);
  r.q = r.time.array().square();
  r.qcmd = r.q.array() + 0.1;
  for (RowMatX<double>* m : {&r.q, &r.qcmd})
    for (double& x : m->reshaped()) x -= kTurn * std::floor((x - from) / kTurn);
  r.tau.setZero(1000, 1);
  return r;
}

}  // namespace

TEST_CASE("unwrapper: a continuous joint goes on beyond a turn, in blocks of any size",
          "[recording]") {
  const double from = GENERATE(-0.5 * kTurn, 0.0);
  const long rows = GENERATE(1000, 7);
  CAPTURE(from, rows);
  const Recording all = wheel(from);
  detail::Unwrapper unwrapper({{.name = "wheel", .continuous = true}}, {all});
  double off = 0.0;
  for (long begin = 0; begin < all.rows(); begin += rows) {
    const long n = std::min(rows, all.rows() - begin);
    Recording block = all;
    block.time = all.time.segment(begin, n);
    block.q = RowMatX<double>(all.q.middleRows(begin, n));
    block.qcmd = RowMatX<double>(all.qcmd.middleRows(begin, n));
    unwrapper.apply(block);
    for (long i = 0; i < n; ++i) {
      const double q = block.time[i] * block.time[i];
      off = std::max({off, std::abs(block.q(i, 0) - q), std::abs(block.qcmd(i, 0) - q - 0.1)});
    }
  }
  CHECK(off < kRounding * 100.0);
  CHECK(unwrapper.note().find("q_wheel (" + std::to_string(from < 0.0 ? 16 : 15) + " times)") !=
        std::string::npos);
}

TEST_CASE("unwrapper: a joint with limits, and positions beyond a turn, stay as they are",
          "[recording]") {
  Recording limited = wheel(0.0), far = wheel(0.0);
  detail::Unwrapper({{.name = "wheel"}}, {limited}).apply(limited);
  CHECK(limited.q == wheel(0.0).q);
  far.q.array() *= 57.3;  // degrees that nobody named
  const RowMatX<double> before = far.q;
  detail::Unwrapper unwrapper({{.name = "wheel", .continuous = true}}, {far});
  unwrapper.apply(far);
  CHECK(far.q == before);
  CHECK(unwrapper.note().empty());
}

}  // namespace diffnea::unwrapper_test
