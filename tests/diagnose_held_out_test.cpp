/// What few held-out rows tell.

#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>

#include "diagnose/held_out.hpp"

using namespace diffnea;

TEST_CASE("HeldOut: one block of held-out rows is no interval", "[diagnose]") {
  const test::SwingingEvidence evidence(20.0);
  const HeldOut held_out(*evidence, {}, 0);
  const long second = std::lround(1.0 / evidence->step());
  const auto worth = [&](long from, long instants) {  // a quarter of the mean square is left
    VecX<double> before = VecX<double>::Zero(evidence->rows());
    before.segment(from, instants).setOnes();
    return held_out.compare(before, 0.5 * before);
  };
  const HeldOutChange little = worth(0, second / 2);
  CHECK(little.before == 1.0);
  CHECK(little.after == 0.25);
  CHECK(little.low <= 0.0);
  CHECK_FALSE(little.helps());
  CHECK(worth(0, 4 * second).helps());  // the same in eight blocks of half a second
}

TEST_CASE("HeldOut: a recording of fewer blocks is refused, with what is needed", "[diagnose]") {
  const test::SwingingEvidence enough(20.0), few(2.5);  // less the filter's ends
  require_blocks(*enough, "enough.csv");
  CHECK_THROWS_WITH(require_blocks(*few, "few.csv"),
                    Catch::Matchers::ContainsSubstring("few.csv: diagnose: ") &&
                        Catch::Matchers::ContainsSubstring(" s or more"));
}
