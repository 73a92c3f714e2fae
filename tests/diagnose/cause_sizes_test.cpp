/// Sizes of causes, and whether they may be zero.

#include "diagnose/cause_sizes.hpp"

#include <catch2/catch_test_macros.hpp>

namespace diffnea::cause_sizes_test {
namespace {

CauseParameter between(double low, double high) {
  CauseParameter out;
  out.value = 0.5 * (low + high);
  out.std = (high - low) / 4.0;
  out.low = low;
  out.high = high;
  return out;
}

}  // namespace

TEST_CASE("may_be_nothing: zero in every interval of what a cause is proportional to",
          "[diagnose]") {
  Term spring;
  spring.linear = {0};
  const CauseParameter rest = between(80.0, 90.0);  // a shape: it says nothing of the size
  CHECK(may_be_nothing(spring, {between(-0.03, 0.03), rest}));
  CHECK_FALSE(may_be_nothing(spring, {between(0.01, 0.03), rest}));
  CHECK_FALSE(may_be_nothing(spring, {CauseParameter{}, rest}));  // not told at all

  Term friction;
  friction.linear = {0, 1};
  CHECK_FALSE(may_be_nothing(friction, {between(-1.0, 1.0), between(0.5, 1.0)}));
  CHECK(may_be_nothing(friction, {between(-1.0, 1.0), between(0.0, 1.0)}));
  CHECK(may_be_nothing(friction, {between(-1.0, 1.0), CauseParameter{}}));
}

}  // namespace diffnea::cause_sizes_test
