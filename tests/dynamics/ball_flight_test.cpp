/// A ball on a string against a pendulum in angles, free flight, and bodies under constraints.

#include <cmath>
#include <support/jet_jacobian.hpp>
#include <support/matrix_near.hpp>
#include <support/random_arm.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/ball_flight.hpp>
#include <diffnea/dynamics/constrained_bodies.hpp>
#include <diffnea/dynamics/constraints.hpp>
#include <diffnea/dynamics/integrators.hpp>
#include <diffnea/dynamics/string_particle.hpp>
#include <diffnea/effects/bounce.hpp>

namespace ball_flight_test {

using namespace diffnea;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using Anchor = AnchorMotion<double>;
using State = ParticleState<double>;

namespace {

const Vec3<double> kGravity{0, 0, -9.81};
const Vec3<double> kZero{0, 0, 0};

double norm(const Vec3<double>& v) { return std::sqrt(dot(v, v)); }

/// A string of length r on an anchor that moves as A sin ωt: accelerations up to A ω².
struct Swing {
  double r = 0.4;
  Vec3<double> amplitude = kZero;
  double omega = 1.0;

  bool has_string() const { return true; }
  double length() const { return r; }
  Anchor anchor(double t) const {
    const double s = std::sin(omega * t), c = std::cos(omega * t);
    return {amplitude * s, amplitude * (omega * c), amplitude * (-omega * omega * s)};
  }
  Vec3<double> acceleration(const BallSample<double>&) const { return kGravity; }
};
using Ball = BallFlight<double, Swing>;

}  // namespace

TEST_CASE("string: a taut one on a shaken anchor is the pendulum of that angle", "[string]") {
  const double r = 0.4;
  const Swing swing{r, {0.05, 0, 0.03}, 6.0};
  Ball ball(swing, {.step = 1e-3});
  const double angle = 0.7;
  ball.start(0.0, {Vec3<double>{std::sin(angle), 0, -std::cos(angle)} * r, swing.anchor(0.0).v});
  // θ̈ = [(g − a)·across]/r, with the rest of the anchor's first velocity along the circle lost.
  Eigen::Vector2d z{angle, 0.0};
  RungeKutta4<Eigen::Vector2d> solver;
  const double h = 1e-4;
  double worst = 0.0;
  for (int k = 0; k < 20000; ++k) {
    solver.step(
        [&](double share, const Eigen::Vector2d& s, Eigen::Vector2d& ds) {
          const Vec3<double> a = kGravity - swing.anchor((k + share) * h).a;
          ds = {s[1], (a.x * std::cos(s[0]) + a.z * std::sin(s[0])) / r};
        },
        h, z);
    if ((k + 1) % 100 != 0) continue;
    ball.run_until((k + 1) * h);
    REQUIRE(ball.taut());
    const Vec3<double> expected =
        swing.anchor((k + 1) * h).x + Vec3<double>{std::sin(z[0]), 0, -std::cos(z[0])} * r;
    worst = std::max(worst, norm(ball.state().x - expected));
  }
  CHECK(worst < 1e-8);  // [m]; two Runge–Kuttas, steps of 1 and 0.1 ms (observed 1e-10)
}

TEST_CASE("string: a slack one lets the ball fly a parabola", "[string]") {
  const Swing swing;
  Ball ball(swing);
  const Vec3<double> x{0.05, 0.02, -0.1}, v{0.3, -0.2, 1.0};
  ball.start(0.0, {x, v});
  ball.run_until(0.25);
  CHECK_FALSE(ball.taut());
  const Vec3<double> expected = x + v * 0.25 + kGravity * (0.5 * 0.25 * 0.25);
  CHECK_THAT(norm(ball.state().x - expected), WithinAbs(0.0, 1e-13));
  CHECK(ball.impacts() == 0);
}

TEST_CASE("string: a ball dropped beside its anchor loses what it has along the string",
          "[string]") {
  // Released at the anchor's height at half the length: falls √(r² − r²/4), then the string is
  // taut.
  const double r = 0.4, depth = std::sqrt(0.75) * r, share = GENERATE(0.0, 0.6);
  const Swing swing{r};
  Ball ball(swing, {.step = 1e-3, .restitution = share});
  ball.start(0.0, {{0.5 * r, 0, 0}, kZero});
  const double fall = std::sqrt(2 * depth / 9.81), speed = 9.81 * fall;
  ball.run_until(fall + 1e-9);
  CHECK(ball.impacts() == 1);
  const Vec3<double> u{0.5, 0, -std::sqrt(0.75)};
  CHECK_THAT(dot(ball.state().v, u), WithinAbs(-share * speed * std::sqrt(0.75), 1e-6));
  CHECK_THAT(dot(ball.state().v, Vec3<double>{std::sqrt(0.75), 0, 0.5}),
             WithinAbs(-0.5 * speed, 1e-6));
  CHECK_THAT(ball.lost_energy(), WithinRel(0.5 * 0.75 * speed * speed * (1 - share * share), 1e-6));
}

TEST_CASE("string: its length holds over 10 s of hard shaking with slack phases", "[string]") {
  const double r = 0.4;
  const Swing swing{r, {0.1, 0.06, 0.22}, 7.0};
  REQUIRE(norm(swing.amplitude) * swing.omega * swing.omega > 10.0);  // [m/s²]
  Ball ball(swing, {.step = 1e-3});
  ball.start(0.0, {{0.3, 0.0, -0.2}, kZero});
  double longest = 0.0, slack = 0.0;
  const double h = 1e-3;
  for (int k = 1; k <= 10000; ++k) {
    ball.run_until(k * h);
    longest = std::max(longest, norm(ball.state().x - swing.anchor(k * h).x) - r);
    if (!ball.taut()) slack += h;
  }
  CAPTURE(slack, ball.impacts(), longest);
  CHECK(slack > 0.5);  // [s]: the case is not a pendulum alone
  CHECK(ball.impacts() > 3);
  CHECK(longest < 1e-9);  // [m]; asked for: 1e-4
}

TEST_CASE("string: energy of a swing on a resting anchor", "[string]") {
  // Large swings with slack phases: energy changes by impacts alone.
  const double r = 0.4;
  const Swing swing{r};
  Ball ball(swing, {.step = 1e-3, .restitution = 1.0});
  const double speed = 4.0;  // too fast to stay below, too slow for a full turn: √(5 g r) = 4.43
  ball.start(0.0, {{0, 0, -r}, {speed, 0, 0}});
  const auto energy = [&](const State& s) { return 0.5 * dot(s.v, s.v) - dot(kGravity, s.x); };
  const double before = energy(ball.state());
  double slack = 0.0;
  for (int k = 1; k <= 1000; ++k) {
    ball.run_until(k * 1e-2);
    if (!ball.taut()) slack += 1e-2;
  }
  CAPTURE(slack, ball.impacts(), ball.lost_energy());
  CHECK(slack > 0.3);
  CHECK(ball.impacts() > 0);
  // 1 ms, fourth order, 10 s, of ½v² = 8 m²/s² (observed 6e-10).
  CHECK_THAT(energy(ball.state()) + ball.lost_energy(), WithinAbs(before, 1e-7));
}

TEST_CASE("string: the hard form's acceleration is that of bodies under a constraint", "[string]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  Rng rng(seed);
  const double r = 0.4;
  const Vec3<double> u = test::random_unit(rng);
  const Anchor anchor{test::random_vec3(rng), test::random_vec3(rng), test::random_vec3(rng, 5.0)};
  const double beyond = seed % 3 == 0 ? -0.01 : seed % 3 == 1 ? 0.0 : 1e-4;
  const State ball{anchor.x + u * (r + beyond), test::random_vec3(rng)};
  const StringSmoothing smoothing{.softness = Softness::kHard};

  const std::vector<FreeBody<double>> bodies{{BodyKind::kPrescribed, {}}, particle(0.024)};
  std::vector<BodyState<double>> states(2);
  states[0] = {{Mat3<double>::identity(), anchor.x}, {kZero, anchor.v}};
  states[1] = {{Mat3<double>::identity(), ball.x}, {kZero, ball.v}};
  std::vector<ConstraintRow<double>> rows;
  append_rows(String<double>{{kZero, kZero, r}}, "string", {0, 1}, states, rows);
  if (beyond == 0.0 && rows[0].g < 0.0) return;  // rounding put it inside
  const Twist<double> driven{kZero, anchor.a};
  const auto expected = constrained_acceleration<double>(
      bodies, states, {{kZero, kZero}, {kZero, kZero}}, {driven, driven}, rows, kGravity,
      Stabilisation::within(smoothing.settle));
  const Vec3<double> found = string_acceleration(ball, anchor, kGravity, r, smoothing);
  CHECK_THAT(norm(found - expected.Vd[1].linear),
             WithinAbs(0.0, 1e-9 * (1.0 + norm(expected.Vd[1].linear))));
}

TEST_CASE("string: the soft form tends to the hard one as it sharpens", "[string]") {
  const double r = 0.4;
  const Anchor anchor{kZero, {0.1, 0, 0}, {1, 0.5, 0}};
  for (const double beyond : {-0.02, 0.02}) {
    const State ball{Vec3<double>{0.6, 0, -0.8} * (r + beyond), {0.3, 0.2, 0.1}};
    const double hard = string_pull(ball, anchor, kGravity, r, {.softness = Softness::kHard});
    double last = 1e9;
    for (const double sharpness : {1.0, 4.0, 16.0}) {
      const double soft =
          string_pull(ball, anchor, kGravity, r, {.pull = sharpness, .switching = 500 * sharpness});
      CHECK(std::abs(soft - hard) <= last);
      last = std::abs(soft - hard);
    }
    CHECK(last < 1e-6 * (1.0 + hard));
  }
}

TEST_CASE("string: the soft form differentiates through slack phases", "[string]") {
  // Length, anchor, position, velocity: slack and taut.
  const auto acceleration = [](const auto& x) {
    using T = typename std::decay_t<decltype(x)>::Scalar;
    const ParticleState<T> ball{{T(0.24), x[4], T(-0.32)}, {x[5], T(0.2), x[6]}};
    const AnchorMotion<T> anchor{
        {x[1], x[2], x[3]}, {T(0.1), T(0.0), T(0.0)}, {T(1.0), T(0.5), T(0.0)}};
    const Vec3<T> g{T(0.0), T(0.0), T(-9.81)};
    return VecX<T>(to_eigen(string_acceleration(ball, anchor, g, x[0], {})));
  };
  for (const double length : {0.39, 0.4005, 0.403}) {
    CAPTURE(length);
    VecX<double> x(7);
    x << length, 0.001, -0.002, 0.0, 0.01, 0.3, -0.1;
    const MatX<double> jets = test::jet_jacobian(x, acceleration);
    REQUIRE(jets.col(0).norm() > 0.0);
    // h = 1e-7 against a sharpness of 1e3/m: curvature leaves 1e-8, rounding 1e-8 of the largest.
    CHECK_THAT(jets, test::MatrixNear(test::central_jacobian(x, 1e-7, acceleration),
                                      1e-6 * jets.cwiseAbs().maxCoeff()));
  }
}

TEST_CASE("string: a ball that leaves its sphere slowly does not stop time", "[string]") {
  // Hardly led inward, and outward at less than rest_speed: it comes back to the sphere at once.
  struct Counted : Swing {
    mutable long calls = 0;
    Vec3<double> acceleration(const BallSample<double>&) const {
      if (++calls > 100000) throw Error("time stands still");
      return {0, 0, -0.1};
    }
  };
  const Counted swing;
  BallFlight<double, Counted> ball(swing, {.step = 1e-3});
  ball.start(0.0, {{0, 0, 0.4 - 1e-10}, {0, 0, 5e-4}});
  ball.run_until(0.1);
  CHECK_FALSE(ball.taut());
  CHECK_THAT(ball.state().x.z, WithinAbs(0.4 - 0.5 * 0.1 * 0.01, 1e-6));
  CHECK(swing.calls < 2000);  // 100 steps and one switch: 600
}

TEST_CASE("string: the end of a phase is found to rounding, in few steps where it is smooth",
          "[string]") {
  const double after = 2e-3, at = GENERATE(1e-9, 3e-4, 1e-3, 1.9e-3);
  const auto found = [&](const auto& f) {
    int calls = 0;
    const auto counted = [&](double t) {
      ++calls;
      return f(t);
    };
    const double t = detail::first_above(counted, f(0.0), f(after), after);
    CHECK(f(t) > 0.0);
    CHECK_THAT(t, WithinAbs(at, 2e-15));  // 2^-40 of the step
    return calls;
  };
  CAPTURE(at);
  CHECK(found([&](double t) { return t - at; }) <= 10);
  CHECK(found([&](double t) { return (t - at) * (1.0 + 100.0 * t); }) <= 10);
  // A jump, and a value that is 0 to rounding before: as many as halvings, and one.
  CHECK(found([&](double t) { return t > at ? 1.0 : -1e-12; }) <= 41);
  CHECK(found([&](double t) { return t > at ? 1.0 : 0.0; }) <= 41);
}

TEST_CASE("string: what cannot be is refused", "[string]") {
  const Swing none{0.0}, swing;
  CHECK_THROWS_AS(Ball(none), ModelError);
  Ball ball(swing);
  ball.start(1.0, {{0, 0, -0.4}, kZero});
  CHECK_THROWS_AS(ball.run_until(0.5), Error);
}

namespace {

/// The same with Jets: length, where the anchor is, linear drag; first state and all are
/// parameters.
template <class T>
struct Dragged {
  T r, drag;
  Vec3<T> offset;

  bool has_string() const { return true; }
  T length() const { return r; }
  AnchorMotion<T> anchor(const T& t) const {
    using std::cos;
    using std::sin;
    const double w = 5.0;
    const Vec3<T> A = Vec3<T>{T(0.1), T(0.05), T(0.2)};
    const T s = sin(t * w), c = cos(t * w);
    return {offset + A * s, A * (c * w), A * (s * (-w * w))};
  }
  Vec3<T> acceleration(const BallSample<T>& x) const {
    return kGravity.cast<T>() - x.ball.v * drag;
  }
};

}  // namespace

TEST_CASE("string: derivatives hold across becoming slack and taut", "[string]") {
  const double until = GENERATE(0.3, 0.9, 1.6);
  const auto end = [until](const auto& x) {
    using T = typename std::decay_t<decltype(x)>::Scalar;
    const Dragged<T> world{x[0], x[1], {x[2], x[3], T(0.0)}};
    BallFlight<T, Dragged<T>> ball(world, {.step = 1e-3});
    ball.start(0.0, {{T(0.25), x[4], T(-0.1)}, {x[5], T(0.2), x[6]}});
    ball.run_until(until);
    VecX<T> out(6);
    out << to_eigen(ball.state().x), to_eigen(ball.state().v);
    return out;
  };
  VecX<double> x(7);
  x << 0.4, 0.1, 0.01, -0.02, 0.05, 0.3, -0.1;
  const Dragged<double> world{x[0], x[1], {x[2], x[3], 0.0}};
  BallFlight<double, Dragged<double>> ball(world, {.step = 1e-3});
  ball.start(0.0, {{0.25, x[4], -0.1}, {x[5], 0.2, x[6]}});
  ball.run_until(until);
  CAPTURE(until, ball.impacts(), ball.taut());
  if (until > 1.0) REQUIRE(ball.impacts() >= 1);
  const MatX<double> jets = test::jet_jacobian(x, end);
  // h = 1e-6; the steps of 1 ms are cut by the switches, whose errors of 1e-12 it divides.
  CHECK_THAT(jets, test::MatrixNear(test::central_jacobian(x, 1e-6, end),
                                    1e-5 * (1.0 + jets.cwiseAbs().maxCoeff())));
}

namespace {

/// A ball over a table, without a string: restitution, friction, height.
template <class T>
struct Table {
  std::array<T, 3> p;
  double radius = 0.02;
  mutable long calls = 0;

  bool has_string() const { return false; }
  T length() const { return T(0.0); }
  AnchorMotion<T> anchor(const T&) const { return {}; }
  Vec3<T> acceleration(const BallSample<T>&) const {
    ++calls;
    return kGravity.cast<T>();
  }
  T clearance(const ParticleState<T>& s) const { return Bounce().clearance(s, radius, p.data()); }
  void bounce(ParticleState<T>& s, Vec3<T>& spin) const {
    Bounce().bounce(p.data(), radius, s, spin);
  }
};

}  // namespace

TEST_CASE("bounce: each height is e² times the one before, at its time", "[bounce]") {
  const double e = GENERATE(0.9, 0.6), table = 0.3, drop = 0.5, g = 9.81;
  const Table<double> world{{e, 0.0, table}};
  BallFlight<double, Table<double>> ball(world, {.step = 7e-3});
  ball.start(0.0, {{0, 0, table + world.radius + drop}, {0.4, 0, 0}});
  double hit = std::sqrt(2 * drop / g), speed = g * hit, height = drop;
  for (int k = 1; k <= 4; ++k) {
    CAPTURE(e, k);
    ball.run_until(hit - 1e-6);
    CHECK(ball.impacts() == k - 1);
    ball.run_until(hit + 1e-6);
    CHECK(ball.impacts() == k);
    speed *= e;
    height *= e * e;
    ball.run_until(hit + speed / g);
    // Parabolas are exact for Runge–Kutta; a switch is found within h/2⁴⁰ = 6e-15 s.
    CHECK_THAT(ball.state().x.z - table - world.radius, WithinAbs(height, 1e-10));
    CHECK_THAT(ball.state().v.z, WithinAbs(0.0, 1e-9));
    CHECK_THAT(ball.state().x.x, WithinAbs(0.4 * (hit + speed / g), 1e-10));
    hit += 2 * speed / g;
  }
}

TEST_CASE("bounce: what friction does to velocity and spin", "[bounce]") {
  const bool slides = GENERATE(true, false);
  const double e = 0.8, mu = slides ? 0.1 : 2.0, r = 0.02;
  const Table<double> world{{e, mu, 0.0}, r};
  BallFlight<double, Table<double>> ball(world);
  const Vec3<double> v{3.0, -1.0, -2.0}, spin{20, 60, -40};
  ball.start(0.0, {{0, 0, r}, v}, false, spin);
  ball.run_until(1e-9);
  REQUIRE(ball.impacts() == 1);
  const Vec3<double> after = ball.state().v, turned = ball.sample().spin, n{0, 0, 1};
  const double tol = 1e-6;  // smoothing of |u| at 1 µm/s, gravity for 1 ns
  CHECK_THAT(after.z, WithinAbs(-e * v.z, tol));
  const auto contact = [&](const Vec3<double>& velocity, const Vec3<double>& omega) {
    Vec3<double> u = velocity + cross(omega, n * -r);
    u.z = 0.0;
    return u;
  };
  // Friction acts at the point of contact: angular momentum about it stays, (2/3) r² ω + r n × v.
  const auto momentum = [&](const Vec3<double>& velocity, const Vec3<double>& omega) {
    return omega * (2.0 / 3.0 * r * r) + cross(n * r, velocity);
  };
  CHECK_THAT(norm(momentum(after, turned) - momentum(v, spin)), WithinAbs(0.0, 1e-9));
  const Vec3<double> before = contact(v, spin), lost = after - v;
  if (slides) {
    const Vec3<double> tangential{lost.x, lost.y, 0};
    CHECK_THAT(norm(tangential), WithinAbs(mu * (1 + e) * -v.z, tol));
    CHECK_THAT(dot(tangential, before), WithinAbs(-norm(tangential) * norm(before), tol));
    CHECK(dot(contact(after, turned), before) > 0.0);  // still the same way
  } else {
    CHECK_THAT(norm(contact(after, turned)), WithinAbs(0.0, tol));  // rolls
  }
}

TEST_CASE("bounce: derivatives hold across bounces", "[bounce]") {
  const double friction = GENERATE(0.05, 1.5);  // slides, grips
  const auto end = [](const auto& x) {
    using T = typename std::decay_t<decltype(x)>::Scalar;
    const Table<T> world{{x[0], x[1], x[2]}};
    BallFlight<T, Table<T>> ball(world, {.step = 5e-3});
    ball.start(0.0, {{T(0.0), T(0.0), x[3]}, {x[4], T(0.3), T(0.0)}}, false,
               Vec3<T>{T(10.0), x[5], T(0.0)});
    ball.run_until(0.9);
    VecX<T> out(9);
    out << to_eigen(ball.state().x), to_eigen(ball.state().v), to_eigen(ball.sample().spin);
    return out;
  };
  VecX<double> x(6);
  x << 0.85, friction, 0.1, 0.55, 2.0, 30.0;
  const Table<double> world{{x[0], x[1], x[2]}};
  BallFlight<double, Table<double>> ball(world, {.step = 5e-3});
  ball.start(0.0, {{0, 0, x[3]}, {x[4], 0.3, 0}}, false, {10, x[5], 0});
  ball.run_until(0.9);
  REQUIRE(ball.impacts() == 2);
  const MatX<double> jets = test::jet_jacobian(x, end);
  CHECK(std::abs(jets(2, 0)) > 0.1);  // restitution moves the ball
  CHECK(std::abs(jets(2, 2)) > 0.1);  // so does the table's height
  // h = 1e-6: switches are found to 1e-14 s, times 10 m/s; over h, 1e-7. Of spins, 1.5/r more.
  CHECK_THAT(jets, test::MatrixNear(test::central_jacobian(x, 1e-6, end),
                                    1e-6 * (1.0 + jets.cwiseAbs().maxCoeff())));
}

TEST_CASE("bounce: a ball that comes to rest does not stop time", "[bounce]") {
  const double e = GENERATE(0.0, 0.5, 0.9);
  const Table<double> world{{e, 0.2, 0.0}};
  BallFlight<double, Table<double>> ball(world, {.step = 1e-2});
  ball.start(0.0, {{0, 0, 0.3}, {1.0, 0, 0}});
  ball.run_until(20.0);
  CAPTURE(e, world.calls, ball.impacts());
  CHECK_THAT(ball.state().x.z, WithinAbs(world.radius, 1e-4));
  CHECK(std::abs(ball.state().v.z) < 0.03);
  CHECK(world.calls < 2'000'000);  // 20 s of hops of 4 ms with 40 halvings each: 0.9e6
}

}  // namespace ball_flight_test
