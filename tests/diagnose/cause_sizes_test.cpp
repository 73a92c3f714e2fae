/// Sizes of causes, and whether they may be zero.

#include "diagnose/cause_sizes.hpp"

#include <cmath>
#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

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

  // Without a damping, too, a link swings on its spring.
  const test::SwingingEvidence evidence(20.0);
  const std::vector<Candidate> gears =
      make_candidates(evidence.model, evidence.model, {"joint_elasticity@elbow"}, {0}, false);
  Term gear = term_at(gears[0], 0, gears[0].grid.front());
  gear.linear = {1};
  CHECK_FALSE(may_be_nothing(gear, {between(80.0, 90.0), between(0.0, 1.0)}));
}

TEST_CASE("of_robot: what swings behind its encoder has a damping from none on", "[diagnose]") {
  const test::SwingingEvidence evidence(20.0);
  const std::vector<Candidate> candidates =
      make_candidates(evidence.model, evidence.model, {"joint_elasticity@elbow"}, {0}, false);
  Term spring = term_at(candidates[0], 0, candidates[0].grid.front());
  const double stiffness = 100.0, ratio = 0.25,
               damping = 2.0 * ratio * std::sqrt(stiffness * candidates[0].swings);
  const auto reported = [&](double side) {
    spring.effect.parameters = {stiffness, damping, 0.01, 1.0, side};
    return of_robot(candidates[0], spring,
                    {{"stiffness", "N*m/rad", stiffness, 1.0, 98.0, 102.0},
                     {"damping", "N*m*s/rad", damping, 0.1 * damping, 0.8 * damping, 1.2 * damping},
                     {"motor_inertia", "kg*m^2", 0.01}});
  };
  const std::vector<CauseParameter> motor = reported(1.0), link = reported(0.0);
  CHECK(motor[1].low == 0.0);
  CHECK(motor[1].high == 1.2 * damping);
  // By one standard deviation its resonance moves by half of its width.
  CHECK_THAT(motor[0].std, Catch::Matchers::WithinRel(stiffness * std::hypot(0.01, ratio), 1e-12));
  CHECK(motor[0].low < 65.0);
  CHECK(motor[0].high > 155.0);
  CHECK(std::isnan(motor[2].std));
  CHECK(link[0].low == 98.0);
  CHECK(link[1].low == 0.8 * damping);
}

}  // namespace diffnea::cause_sizes_test
