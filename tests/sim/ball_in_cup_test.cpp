/// The verdict on a ball and a cup, from trajectories made by hand: what counts as caught, and what
/// only looks so.

#include <cmath>
#include <functional>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/lie/so3.hpp>
#include <diffnea/sim/ball_in_cup.hpp>

namespace ball_in_cup_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;

namespace {

constexpr double kPeriod = 2e-3;
const CupSpec kCup{.inner_radius = 0.040, .wall = 0.003, .floor = 0.0145, .rim = 0.095};

struct Series {
  VecX<double> time;
  RowMatX<double> ball, cup, axis;
};

/// The ball at (ρ, 0, h) in the frame of a cup that moves and turns meanwhile.
Series series(double seconds, const std::function<std::pair<double, double>(double)>& rho_and_h) {
  const long rows = std::lround(seconds / kPeriod) + 1;
  Series out{VecX<double>(rows), RowMatX<double>(rows, 3), RowMatX<double>(rows, 3),
             RowMatX<double>(rows, 3)};
  for (long k = 0; k < rows; ++k) {
    const double t = static_cast<double>(k) * kPeriod;
    const auto [rho, h] = rho_and_h(t);
    const Mat3<double> R = rotation_about<double>({0.6, 0.8, 0}, 0.7 * std::sin(t));
    const Vec3<double> p{0.8 + 0.1 * std::cos(t), 0.2 * t, 1.5},
        m = R.col[2], b = p + R * Vec3<double>{rho, 0, h};
    out.time[k] = t;
    out.ball.row(k) << b.x, b.y, b.z;
    out.cup.row(k) << p.x, p.y, p.z;
    out.axis.row(k) << m.x, m.y, m.z;
  }
  return out;
}

BallVerdict judge(const Series& s, const SuccessOptions& o = {}) {
  const BallVerdict verdict = judge_ball(s.time, s.ball, s.cup, s.axis, kCup, o);
  CHECK(ball_in_cup(s.time, s.ball, s.cup, s.axis, kCup, o) ==
        (verdict.outcome == Outcome::kInCup));
  return verdict;
}

/// From hanging below over the rim to (ρ, h) at 1 s, where it stays.
std::pair<double, double> flight(double t, double rho, double h) {
  if (t >= 1.0) return {rho, h};
  return {0.3 * (1.0 - t) * (1.0 - t) + rho * t, -0.4 + 1.2 * t - 0.7 * t * t + (h - 0.1) * t};
}

}  // namespace

TEST_CASE("ball in cup: at rest on the floor, against the wall or bouncing it is in", "[cup]") {
  const double rho = GENERATE(0.0, 0.020, 0.0415);
  const BallVerdict v = judge(series(2.0, [&](double t) {
    const auto [r, h] = flight(t, rho, 0.0345);
    return std::pair{r, t > 1.0 ? h + 0.04 * std::abs(std::sin(20.0 * t)) * std::exp(1.0 - t) : h};
  }));
  CAPTURE(rho, v.text);
  CHECK(v.outcome == Outcome::kInCup);
  CHECK_THAT(v.text, ContainsSubstring("in the cup since"));
}

TEST_CASE("ball in cup: it has to stay there throughout the window, not longer", "[cup]") {
  const auto in_from = [](double t0) {
    return series(2.0, [=](double t) { return std::pair{0.0, t < t0 ? 0.2 : 0.0345}; });
  };
  CHECK(judge(in_from(1.5)).outcome == Outcome::kInCup);
  const BallVerdict late = judge(in_from(1.6));
  CHECK(late.outcome == Outcome::kLate);
  CHECK_THAT(late.text, ContainsSubstring("last 0.40 s only, expected 0.50 s"));
  CHECK(judge(in_from(1.6), {.window = 0.3}).outcome == Outcome::kInCup);
  // One sample over the rim within the window is one too many.
  Series hop = in_from(1.0);
  hop.ball.row(hop.time.size() - 100) += 0.1 * hop.axis.row(hop.time.size() - 100);
  CHECK(judge(hop).outcome == Outcome::kLate);
}

TEST_CASE("ball in cup: a ball that is parked on the rim is not in", "[cup]") {
  const double rho = GENERATE(0.030, 0.0415, 0.055);
  const BallVerdict v = judge(series(2.0, [&](double t) { return flight(t, rho, 0.108); }));
  CAPTURE(rho, v.text);
  CHECK(v.outcome == Outcome::kRim);
  CHECK_THAT(v.text, ContainsSubstring("on the rim: 108 mm high"));
}

TEST_CASE("ball in cup: between forearm and cup, or below the floor, it is beside", "[cup]") {
  struct Case {
    double rho, h;
  };
  const Case c =
      GENERATE(Case{0.063, 0.03}, Case{0.064, 0.08}, Case{0.0, 0.005}, Case{0.02, -0.02});
  const BallVerdict v = judge(series(2.0, [&](double) { return std::pair{c.rho, c.h}; }));
  CAPTURE(c.rho, c.h, v.text);
  CHECK(v.outcome == Outcome::kBeside);
  CHECK_THAT(v.text, ContainsSubstring("beside the cup"));
}

TEST_CASE("ball in cup: one that rolls off a second later was in, when the series is long enough",
          "[cup]") {
  const auto rolls = [](double t) {
    if (t < 2.0) return flight(t, 0.02, 0.0345);
    return std::pair{0.02 + 0.2 * (t - 2.0),
                     0.0345 + 0.5 * (t - 2.0) - 4.0 * (t - 2.0) * (t - 2.0)};
  };
  CHECK(judge(series(1.9, rolls)).outcome == Outcome::kInCup);
  const BallVerdict v = judge(series(3.0, rolls));
  CHECK(v.outcome == Outcome::kFellOut);
  CHECK_THAT(v.text, ContainsSubstring("fell out at 2.1"));  // ρ = 42 mm at 2.11 s
}

TEST_CASE("ball in cup: a miss says by how much", "[cup]") {
  const BallVerdict hanging = judge(series(2.0, [](double) { return std::pair{0.35, -0.2}; }));
  CHECK(hanging.outcome == Outcome::kMissed);
  CHECK_THAT(hanging.text, ContainsSubstring("never above the rim: 295 mm short"));
  const BallVerdict over = judge(series(2.0, [](double t) {
    return std::pair{0.071 + 0.3 * std::abs(t - 1.0), 0.12 - std::abs(t - 1.0)};
  }));
  CHECK(over.outcome == Outcome::kMissed);
  CHECK_THAT(over.text, ContainsSubstring("came down 79 mm off the axis"));
}

TEST_CASE("ball in cup: what is not finite is outside, what does not fit is refused", "[cup]") {
  Series s = series(2.0, [](double) { return std::pair{0.0, 0.0345}; });
  const auto judged = [&](const Series& x) {
    return judge_ball(x.time, x.ball, x.cup, x.axis, kCup);
  };
  Series gone = s;
  gone.ball.bottomRows(10).setConstant(std::nan(""));
  CHECK(judged(gone).outcome == Outcome::kFellOut);
  Series brief = series(0.4, [](double) { return std::pair{0.0, 0.0345}; });
  CHECK_THROWS_AS(judged(brief), DataError);
  CHECK_THROWS_WITH(judged(brief), ContainsSubstring("lasts 0.40 s, expected at least"));
  Series thin = s;
  thin.cup.conservativeResize(thin.cup.rows() - 1, 3);
  CHECK_THROWS_AS(judged(thin), ShapeError);
  s.axis.conservativeResize(s.axis.rows(), 2);
  CHECK_THROWS_AS(judged(s), ShapeError);
}

}  // namespace ball_in_cup_test
