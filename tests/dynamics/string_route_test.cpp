/// The way of a string around the cup that it is tied below.

#include <array>
#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/core/pack.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/dynamics/ball_flight.hpp>
#include <diffnea/dynamics/string_route.hpp>

namespace string_route_test {

using namespace diffnea;

namespace {

constexpr CupSpec kCup{.inner_radius = 0.04, .wall = 0.003, .floor = 0.0145, .rim = 0.095};
constexpr double kSide = 0.043, kFloor = 0.0115;
using P = CupPosition<double>;

double distance(const P& a, const P& b) {
  return std::hypot(a.height - b.height, a.radius - b.radius);
}
double length(const P& ball, const P& knot, double size = 1.0) {
  const StringRoute<double> r = route_around_cup(ball, knot, kCup, size);
  return r.used + distance(r.edge, ball);
}

/// Whether a segment meets the inside of the cup as a solid body.
bool meets(const P& a, const P& b) {
  constexpr int kParts = 400;
  constexpr double kSkin = 1e-9;
  for (int i = 0; i <= kParts; ++i) {
    const double s = double(i) / kParts, h = a.height + s * (b.height - a.height),
                 r = a.radius + s * (b.radius - a.radius);
    if (r < kSide - kSkin && h > kFloor + kSkin && h < kCup.rim - kSkin) return true;
  }
  return false;
}
/// The shortest way of those over no, one or both edges that do not pass through the cup.
double shortest(const P& ball, const P& knot) {
  const P floor{kFloor, kSide}, rim{kCup.rim, kSide};
  double best = INFINITY;
  if (!meets(knot, ball)) best = distance(knot, ball);
  if (!meets(floor, ball)) best = std::min(best, distance(knot, floor) + distance(floor, ball));
  return std::min(best, distance(knot, floor) + distance(floor, rim) + distance(rim, ball));
}

}  // namespace

TEST_CASE("string route: the shortest way that does not pass through the cup", "[dynamics]") {
  Rng rng(1);
  int straight = 0, over_floor = 0, over_rim = 0;
  for (int k = 0; k < 4000; ++k) {
    const P knot{rng.uniform(-0.005, 0.005), rng.uniform(-0.005, 0.005)};
    const P ball{rng.uniform(-0.4, 0.4), rng.uniform(0.0, 0.4)};
    if (ball.radius < kSide && ball.height > kFloor && ball.height < kCup.rim) continue;  // in it
    if (ball.radius < kSide && ball.height > 0.0 && ball.height <= kFloor) continue;
    CAPTURE(k, ball.height, ball.radius, knot.height, knot.radius);
    const StringRoute<double> r = route_around_cup(ball, knot, kCup, 1.0);
    ++(r.used == 0.0 ? straight : r.edge.height < 0.05 ? over_floor : over_rim);
    CHECK(std::abs(length(ball, knot) - shortest(ball, knot)) < 2e-6);  // kLeast of the cup
  }
  CHECK(std::min({straight, over_floor, over_rim}) > 100);
}

TEST_CASE("string route: its length is smooth in the ball's place and in the size", "[dynamics]") {
  const P knot{0.002, 0.003};
  // Along a circle over the cup, from beside it to the axis: no jump of length or direction.
  double before = 0.0, slope_before = 0.0;
  constexpr double kStep = 1e-3;
  for (int k = 0; k < 1500; ++k) {
    const double angle = k * kStep;
    const double now = length({0.3 * std::sin(angle), 0.3 * std::cos(angle)}, knot);
    const double slope = (now - before) / kStep;
    if (k > 0) CHECK(std::abs(now - before) < 0.3 * kStep);
    if (k > 1) CHECK(std::abs(slope - slope_before) < 3.0 * kStep);  // curvature 0.3/0.1 at most
    before = now;
    slope_before = slope;
  }
  const P ball{0.3, 0.1};
  CHECK(std::abs(length(ball, knot, 0.0) - distance(ball, knot)) < 1e-6);
  CHECK(length(ball, knot, 0.5) > distance(ball, knot) + 1e-3);
  CHECK(length(ball, knot, 1.0) > length(ball, knot, 0.5));
}

TEST_CASE("string route: derivatives, also at size 0, and packs", "[dynamics]") {
  const P knot{-0.001, 0.004};
  for (const double size : {0.0, 0.6, 1.0})
    for (const P& ball : {P{0.3, 0.1}, P{0.35, 0.02}, P{0.02, 0.35}, P{-0.3, 0.1}}) {
      using J = JetD;
      const StringRoute<J> r =
          route_around_cup<J>({J(ball.height, 0), J(ball.radius, 1)},
                              {J(knot.height), J(knot.radius)}, kCup, J(size, 2));
      using std::sqrt;
      const J dh = r.edge.height - J(ball.height, 0), dr = r.edge.radius - J(ball.radius, 1);
      const J l = r.used + sqrt(dh * dh + dr * dr);
      constexpr double kStep = 1e-7;
      CAPTURE(size, ball.height, ball.radius);
      CHECK(std::abs(l.v[0] - (length({ball.height + kStep, ball.radius}, knot, size) - l.a) /
                                  kStep) < 1e-5);
      CHECK(std::abs(l.v[1] - (length({ball.height, ball.radius + kStep}, knot, size) - l.a) /
                                  kStep) < 1e-5);
      CHECK(std::abs(l.v[2] - (length(ball, knot, size + kStep) - l.a) / kStep) < 1e-5);
      if (ball.height > 0.2) CHECK(l.v[2] > 1e-3);
      const StringRoute<double> of_double = route_around_cup(ball, knot, kCup, size);
      const StringRoute<Pack> of_pack =
          route_around_cup<Pack>({Pack(ball.height), Pack(ball.radius)},
                                 {Pack(knot.height), Pack(knot.radius)}, kCup, Pack(size));
      CHECK(double(of_pack.used[0]) == of_double.used);
      CHECK(double(of_pack.edge.height[0]) == of_double.edge.height);
      CHECK(double(of_pack.edge.radius[0]) == of_double.edge.radius);
    }
}

namespace {

/// A cup that stands still, the string tied at its origin; no gravity.
struct OverTheCup {
  double r = 0.4, e = 0.0;

  bool has_string() const { return true; }
  double length() const { return r; }
  AnchorMotion<double> anchor(double) const { return {}; }
  double rebound() const { return e; }
  FreeString<double> string(double, const Vec3<double>& x) const {
    const double radius = std::hypot(x.x, x.y);
    const StringRoute<double> route =
        route_around_cup<double>({x.z, radius}, {0.0, 0.0}, kCup, 1.0);
    if (route.used == 0.0) return {{}, r};
    AnchorMotion<double> edge{};
    edge.x = {route.edge.radius * x.x / radius, route.edge.radius * x.y / radius,
              route.edge.height};
    return {edge, r - route.used};
  }
  Vec3<double> acceleration(const BallSample<double>&) const { return {0, 0, 0}; }
};

}  // namespace

TEST_CASE("ball flight: a taut string swings around floor and rim without loss", "[string]") {
  const OverTheCup world;
  BallFlight<double, OverTheCup> flight(world, {.step = 1e-3});
  flight.start(0.0, {{0.4, 0.0, 0.0}, {0.0, 0.0, 2.0}}, true);
  REQUIRE(flight.taut());
  double most = 0.0;
  bool over = false;
  for (int k = 1; k < 400; ++k) {
    flight.run_until(k * 1e-3);
    const Vec3<double>& x = flight.state().x;
    if (x.x < 0.02) break;
    over = over || x.x < kSide;
    most = std::max(most, std::abs(length({x.z, x.x}, {0.0, 0.0}) - 0.4));
    CHECK(flight.taut());
    CHECK(std::abs(std::sqrt(dot(flight.state().v, flight.state().v)) - 2.0) < 1e-3);
  }
  CHECK(over);
  CHECK(most < 3e-6);
  CHECK(flight.impacts() <= 1);  // the start
}

TEST_CASE("ball flight: becoming taut throws the ball back", "[string]") {
  const double e = GENERATE(0.0, 0.15, 0.6);
  const OverTheCup world{.e = e};
  BallFlight<double, OverTheCup> flight(world, {.step = 1e-3});
  flight.start(0.0, {{0.0, 0.0, -0.3}, {0.0, 0.0, -1.0}});
  flight.run_until(0.15);
  CHECK(std::abs(flight.state().v.z - e) < 1e-9);
}

}  // namespace string_route_test
