/// Ball, string and cup of the simulated model: how long the string is, and the holes that a search
/// for a policy finds in what a catch is.

#include <algorithm>
#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/core/random.hpp>
#include <diffnea/dynamics/cup_contact.hpp>
#include <diffnea/dynamics/string_route.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/model_simulator.hpp>

#include "support/swinging_wam.hpp"

namespace model_simulator_cup_test {

using namespace diffnea;
using namespace diffnea::test;

TEST_CASE("model simulator: the string is never longer than r, and its ball no further", "[sim]") {
  const Model model = read_model(kWam);
  ModelSimulator world({model}, model);
  const int ball = find_channel(world, "ball_x"), cup = find_channel(world, "cup_x");
  double most = 0.0;
  for (const Lanes& seen : run(world, {{0.5, 9.0}}, 2.0))
    most = std::max(most, (seen.col(0).segment(ball, 3) - seen.col(0).segment(cup, 3)).norm());
  CHECK(most < 0.4 + 1e-9);  // rounding: it is put back on the sphere
  CHECK(most > 0.4 - 1e-9);
}

TEST_CASE("model simulator: the cup moves with the arm where there is no ball", "[sim]") {
  const Model model = read_model(kWam);
  Model light = model, alone = model;
  light.ball->mass = 1e-9;
  alone.ball.reset();
  ModelSimulator with_ball({light}, model), without({alone}, model);
  const std::vector<Lanes> with = run(with_ball, {{0.4, 7.0}}, 1.5),
                           lone = run(without, {{0.4, 7.0}}, 1.5);
  const int cup = find_channel(with_ball, "cup_x"), lone_cup = find_channel(without, "cup_x");
  double apart = 0.0, way = 0.0;
  for (std::size_t k = 0; k < with.size(); ++k) {
    apart = std::max(apart, (with[k].middleRows(cup, 3) - lone[k].middleRows(lone_cup, 3)).norm());
    way = std::max(way, (lone[k].middleRows(lone_cup, 3) - lone[0].middleRows(lone_cup, 3)).norm());
  }
  CHECK(apart < 1e-6);  // a ball of 1 µg pulls with 1e-8 N
  CHECK(way > 0.1);     // 0.3 rad, a metre from the shoulder
}

TEST_CASE("model simulator: a string that lies around the cup is never longer", "[sim]") {
  Model model = read_model(kWam);
  const bool wraps = GENERATE(false, true);
  if (wraps) {
    model.effects.push_back({"string_wrap", "string", {{"size", 1.0, "1"}}});
    model.effects.push_back({"string_rebound", "string", {{"restitution", 0.1, "1"}}});
    model.effects.push_back({"string_folding", "string", {{"resistance", 0.01, "m/s"}}});
  }
  ModelSimulator world({model}, model);
  Rng rng(3);
  const int phase = find_channel(world, "phase"), ball = find_channel(world, "ball_x"),
            cup = find_channel(world, "cup_x"), axis = find_channel(world, "axis_x");
  double longest = 0.0;
  int bent_and_taut = 0;
  for (int round = 0; round < 6; ++round) {
    std::vector<Swing> swings;
    for (int l = 0; l < world.lanes(); ++l)
      swings.push_back({rng.uniform(0.3, 0.9), rng.uniform(5, 11)});
    for (const Lanes& seen : run(world, swings, 2.0))
      for (long l = 0; l < world.lanes(); ++l) {
        if (seen(phase, l) != double(BallPhase::kFree)) continue;
        const VecX<double> d = seen.col(l).segment(ball, 3) - seen.col(l).segment(cup, 3);
        const double height = d.dot(seen.col(l).segment(axis, 3)),
                     radius = std::sqrt(std::max(0.0, d.squaredNorm() - height * height));
        const StringRoute<double> route =
            route_around_cup<double>({height, radius}, {0.0, 0.0}, *model.cup, 1.0);
        const double length =
            route.used + std::hypot(height - route.edge.height, radius - route.edge.radius);
        longest = std::max(longest, length);
        bent_and_taut += route.used > 0.0 && length > model.ball->string->length - 1e-4;
      }
  }
  CAPTURE(wraps, longest, bent_and_taut);
  // The edge that a step begins with is the one that it ends with: 1 ms at 5 m/s, squared, over r.
  constexpr double kStep = 1e-4;
  CHECK((longest < model.ball->string->length + kStep) == wraps);
  if (wraps) CHECK(bent_and_taut > 20);
}

TEST_CASE("cup: caught from above alone, where the ball passes the rim", "[sim]") {
  const CupSpec cup{.inner_radius = 0.04, .wall = 0.003, .floor = 0.0145, .rim = 0.095};
  const double r = 0.02;
  constexpr double kRounding = 1e-15;
  using P = CupPosition<double>;
  CHECK(is_caught(P{0.097, 0.0}, P{0.094, 0.0}, cup, r));
  CHECK(is_caught(P{0.097, 0.0199}, P{0.094, 0.0199}, cup, r));
  CHECK_FALSE(is_caught(P{0.097, 0.0201}, P{0.094, 0.0201}, cup, r));  // rim
  CHECK_FALSE(is_caught(P{0.094, 0.0}, P{0.097, 0.0}, cup, r));        // from below
  CHECK_FALSE(is_caught(P{0.099, 0.0}, P{0.096, 0.0}, cup, r));        // hovers over it
  CHECK_FALSE(is_caught(P{0.097, 0.063}, P{0.094, 0.0}, cup, r));      // past the rim, sideways

  CHECK(std::abs(distance_to_cup(P{0.095 + 0.02, 0.04}, cup) - 0.02) < kRounding);  // over the rim
  CHECK(std::abs(distance_to_cup(P{0.05, 0.063}, cup) - 0.02) < kRounding);
  CHECK(std::abs(distance_to_cup(P{-0.4, 0.0}, cup) - 0.4) < kRounding);  // hangs
  CHECK(std::abs(distance_to_cup(P{0.095 + 0.003, 0.036}, cup) - 0.005) < kRounding);
  CHECK(distance_to_cup(P{0.2, 0.0}, cup) > r);
}

TEST_CASE("model simulator: what is not a catch is not taken for one", "[sim]") {
  const Model model = read_model(kWam);
  REQUIRE(model.cup);
  ModelSimulator world({model}, model);
  const int phase = find_channel(world, "phase"), ball = find_channel(world, "ball_x"),
            cup = find_channel(world, "cup_x"), axis = find_channel(world, "axis_x");
  const double rest = model.cup->floor + model.ball->radius;
  int caught = 0;
  for (unsigned seed = 0; seed < 7; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    std::vector<Swing> swings;
    for (int l = 0; l < world.lanes(); ++l)
      if (seed == 0)  // they throw the ball into the cup, then at its rim
        swings.push_back({0.365 - 6e-4 * l, 6.945});
      else
        swings.push_back({rng.uniform(0.2, 0.9), rng.uniform(4, 11)});
    VecX<double> before = VecX<double>::Zero(world.lanes());
    for (const Lanes& seen : run(world, swings, 2.5)) {
      for (long l = 0; l < world.lanes(); ++l) {
        const VecX<double> d = seen.col(l).segment(ball, 3) - seen.col(l).segment(cup, 3);
        const double height = d.dot(seen.col(l).segment(axis, 3));
        const double now = seen(phase, l);
        if (before[l] != 0.0) CHECK(now == before[l]);  // for good
        if (now == double(BallPhase::kCaptured)) {
          CHECK(std::abs(height - rest) < 1e-12);
          CHECK(std::abs(d.norm() - rest) < 1e-12);
        }
        if (now == double(BallPhase::kFree)) {
          // Free: neither in the cup, nor in anything else, nor under an upside-down one.
          const double radius = std::sqrt(std::max(0.0, d.squaredNorm() - height * height));
          CHECK(distance_to_cup(CupPosition<double>{height, radius}, *model.cup) >
                model.ball->radius - 5e-3);  // 1 ms at 5 m/s
          CHECK(seen(axis + 2, l) > 0.15);
        }
        before[l] = now;
      }
    }
    caught += static_cast<int>((before.array() == double(BallPhase::kCaptured)).count());
  }
  CHECK(caught > 0);
}

TEST_CASE("model simulator: an upside-down cup ends the episode", "[sim]") {
  const Model model = read_model(kWam);
  ModelSimulator world({model}, model);
  world.reset(starts(1));
  Lanes q = Lanes::Zero(4, world.lanes()), qd = q;
  for (int k = 0; k < 500; ++k) {
    q.col(0) = kHome;
    q(3, 0) += 2.2 * std::min(1.0, k / 400.0);
    world.step(q, qd);
  }
  CHECK(world.observe()(find_channel(world, "phase"), 0) == double(BallPhase::kUpsideDown));
}

}  // namespace model_simulator_cup_test
