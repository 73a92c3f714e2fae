/// identify() of a ball without a string: drag, lift, and what it bounces off.

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/identify.hpp>

#include "support/ball_fits.hpp"

namespace ball_identify_flight_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

struct Table {
  double restitution = 0.9, height = 0.0;
  unsigned seed = 1;
};
/// Balls of radius 20 mm dropped over a smooth table, parabola by parabola: at each bounce the
/// velocity down becomes e times as much up. 100 Hz; 1.2 s each, before bounces at e = 0.75 end.
Recording record_bounces(const Table& table) {
  constexpr double kStep = 1e-2, kGravity = 9.81, kRadius = 0.02;
  constexpr long kDrops = 12, kRows = 120, kPause = 40;
  Rng rng(table.seed);
  Recording r;
  r.source = "bounces";
  r.time.resize(kDrops * (kRows + kPause));
  r.q.resize(r.rows(), 0);
  r.tau.resize(r.rows(), 0);
  r.ball = RowMatX<double>::Constant(r.rows(), 3, std::numeric_limits<double>::quiet_NaN());
  for (long k = 0; k < r.rows(); ++k) r.time[k] = static_cast<double>(k) * kStep;
  for (long drop = 0; drop < kDrops; ++drop) {
    const double vx = rng.uniform(-1.0, 1.0), vy = rng.uniform(-1.0, 1.0);
    double begin = 0.0, z = rng.uniform(0.2, 0.5), v = rng.uniform(-0.5, 0.5);  // of a parabola
    for (long k = 0; k < kRows; ++k) {
      const double t = static_cast<double>(k) * kStep;
      for (;;) {  // to the plane in (v + √(v² + 2 g z))/g
        const double fast = std::sqrt(v * v + 2.0 * kGravity * z), takes = (v + fast) / kGravity;
        if (begin + takes > t) break;
        begin += takes;
        z = 0.0;
        v = table.restitution * fast;
      }
      const double s = t - begin;
      const double height = table.height + kRadius + z + v * s - 0.5 * kGravity * s * s;
      r.ball.row(drop * (kRows + kPause) + k) << vx * t + kNoise * rng.normal(),
          vy * t + kNoise * rng.normal(), height + kNoise * rng.normal();
    }
  }
  return r;
}

}  // namespace

TEST_CASE("identify a ball: drag and lift of one in flight, without any joint", "[ball]") {
  IdentifyOptions options;
  options.choice.effects = {"quadratic_drag", "magnus"};
  // C_M ρ A r/m of a table tennis ball
  const double per_unit = 1.2 * M_PI * std::pow(0.02, 3) / 2.7e-3;
  const FlightsOptions o{.lift = 0.3 * per_unit, .seed = 1};
  FlightsOptions other = o;
  other.seed = 2;
  const IdentifyResult result =
      identify(test::flying_ball(), {record_flights(o)}, {record_flights(other)}, options);
  const ParameterEstimate &drag = find(result, "ball.quadratic_drag.drag"),
                          &lift = find(result, "ball.magnus.magnus");
  CAPTURE(drag.value, drag.std, lift.value, lift.std);
  CHECK(std::abs(drag.value - o.drag) < kSigmas * drag.std);
  CHECK(std::abs(lift.value - 0.3) < kSigmas * lift.std);
  CHECK(drag.std < 0.01);
  CHECK(lift.std < 0.01);
  CHECK_THAT(result.errors.front().test, WithinRel(kNoise, 0.06));
  CHECK(result.ball->flagged.empty());
  CHECK_FALSE(result.ball->has_string);
}

TEST_CASE("identify a ball: spins of the wrong sign are flagged, and lift is right", "[ball]") {
  IdentifyOptions options;
  options.choice.effects = {"quadratic_drag", "magnus"};
  const double per_unit = 1.2 * M_PI * std::pow(0.02, 3) / 2.7e-3;
  std::vector<double> wrong;
  const Recording r = record_flights(
      {.flights = 60, .lift = 0.3 * per_unit, .false_spins = 0.2, .seed = 3}, &wrong);
  REQUIRE(wrong.size() > 5);
  const IdentifyResult result = identify(test::flying_ball(), {r}, {}, options);
  const ParameterEstimate& lift = find(result, "ball.magnus.magnus");
  CAPTURE(lift.value, lift.std, wrong.size());
  CHECK(std::abs(lift.value - 0.3) < kSigmas * lift.std + 0.01);
  std::vector<double> named;
  for (const BallFlag& f : result.ball->flagged)
    if (f.channel == "spin") named.push_back(f.time);
  std::ranges::sort(named);
  std::size_t found = 0;
  for (const double t : wrong)
    found += std::ranges::any_of(named, [&](double n) { return std::abs(n - t) < 0.02; });
  CAPTURE(found, named.size());
  CHECK(found + 1 >= wrong.size());  // a spin along the flight shows no lift
  CHECK(named.size() <= found + 2);  // and none but those, or nearly
}

TEST_CASE("identify a ball: restitution and height of a table that it bounces off", "[ball]") {
  const Table table = GENERATE(Table{0.9, 0.0, 1}, Table{0.75, 0.0, 2}, Table{0.9, 0.76, 3});
  IdentifyOptions options;
  options.choice.effects = {"bounce"};
  const IdentifyResult result = identify(test::flying_ball(), {record_bounces(table)}, {}, options);
  const ParameterEstimate &e = find(result, "ball.bounce.restitution"),
                          &height = find(result, "ball.bounce.height"),
                          &friction = find(result, "ball.bounce.friction");
  CAPTURE(table.restitution, table.height, e.value, e.std, height.value, height.std, friction.value,
          result.summary.termination, result.ball->sigma, result.ball->rows());
  CHECK(e.std < 2e-3);
  CHECK_THAT(e.value, WithinAbs(table.restitution, kSigmas * e.std));
  CHECK_THAT(height.value, WithinAbs(table.height, kSigmas * height.std));
  CHECK(friction.value < 2e-3);
  CHECK_THAT(result.errors.front().train, WithinRel(kNoise, 0.05));
}

TEST_CASE("identify a ball: lift asks for a recorded spin", "[ball]") {
  IdentifyOptions options;
  options.choice.effects = {"quadratic_drag", "magnus"};
  const Recording spinning = record_flights({.flights = 10, .seed = 4});
  Recording blind = record_flights({.flights = 10, .seed = 5});
  blind.spin.resize(0, 0);
  const auto refused = ContainsSubstring("flights-5: magnus needs the ball's spin");
  CHECK_THROWS_AS(identify(test::flying_ball(), {blind}, {}, options), DataError);
  CHECK_THROWS_WITH(identify(test::flying_ball(), {blind}, {}, options), refused);
  CHECK_THROWS_WITH(identify(test::flying_ball(), {spinning}, {blind}, options), refused);
}

}  // namespace ball_identify_flight_test
