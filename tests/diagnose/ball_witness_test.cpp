/// When the error of a ball's path is large, and when a note says so.

#include "diagnose/ball_witness.hpp"

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

namespace diffnea::ball_witness_test {
namespace {

using Catch::Matchers::ContainsSubstring;

/// Windows of 2 s at 100 Hz, each with its error along every axis. [m]
BallSeries windows(const std::vector<double>& errors) {
  BallSeries out;
  for (std::size_t w = 0; w < errors.size(); ++w)
    for (int k = 0; k < 200; ++k) {
      const double sign = k % 2 ? 1.0 : -1.0, e = sign * errors[w];
      out.run.push_back(0);
      out.window.push_back(static_cast<int>(w));
      out.time.push_back(2.0 * static_cast<double>(w) + 0.01 * k);
      out.measured.push_back({e, e, e});
      out.extended.push_back({0, 0, 0});
    }
  return out;
}

}  // namespace

TEST_CASE("ball: a few windows that hold what is left are named", "[diagnose]") {
  const std::string note =
      held_by_few_windows(windows({0.0015, 0.0014, 0.09, 0.0016, 0.05, 0.0015, 0.0016}));
  CHECK_THAT(note, ContainsSubstring("2 of 7 windows (4 to 5.99 s, 8 to 9.99 s) hold 99.8 %") &&
                       ContainsSubstring("the others fit to 1.5") && ContainsSubstring("touch"));

  BallSeries two = windows({0.0015, 0.0014, 0.0016, 0.0015, 0.05, 0.0016});
  for (std::size_t k = 600; k < two.run.size(); ++k) two.run[k] = 1;
  CHECK_THAT(held_by_few_windows(two), ContainsSubstring("(8 to 9.99 s of run 1)"));
}

TEST_CASE("ball: an error that every window has is no matter of windows", "[diagnose]") {
  CHECK(held_by_few_windows(windows({0.02, 0.03, 0.04, 0.025, 0.03})).empty());
  CHECK(held_by_few_windows(windows({0.002, 0.03, 0.04, 0.03, 0.002})).empty());  // most of them
  CHECK(held_by_few_windows(windows({0.0015, 0.05, 0.0015})).empty());            // too few to say
  CHECK(held_by_few_windows(windows({})).empty());
  CHECK(held_by_few_windows(windows({0.0015, 0.0014, NAN, 0.0016, 0.05, 0.0015})).empty());
}

}  // namespace diffnea::ball_witness_test
