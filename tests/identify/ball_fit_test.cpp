/// Fitting a ball on a string: what was put in comes out, within its standard errors.

#include <cmath>
#include <support/camera_ball.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/identify/ball_fit.hpp>

#include "identify/ball_cost.hpp"
#include "identify/ball_world.hpp"

namespace ball_fit_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;

namespace {

constexpr double kNoise = 1.5e-3;  // of the camera [m]

double angle(int joint, double t, int derivative) {
  const double w = joint == 0 ? 1.9 : joint == 1 ? 2.6 : 3.3, A = joint == 2 ? 0.8 : 0.35;
  const double phase = 0.4 * joint;
  switch (derivative) {
    case 0:
      return A * std::sin(w * t + phase);
    case 1:
      return A * w * std::cos(w * t + phase);
  }
  return -A * w * w * std::sin(w * t + phase);
}

/// The world that the recording comes from: pendulum equations with the anchor by finite motion of
/// the true model. Written here, with drag, so that the fit's own world is not asked.
Recording recorded(const Model& truth, double drag, double seconds, unsigned seed,
                   double shake = 1.0) {
  Rng rng(seed);
  Recording r;
  r.source = "made";
  for (const ModelLink& l : truth.links) r.joint_names.push_back(l.joint);
  const double dt = 2e-3;
  const long rows = std::lround(seconds / dt);
  r.time.resize(rows);
  r.q.resize(rows, 3);
  r.tau = RowMatX<double>::Constant(rows, 3, std::nan(""));
  r.has_tau.assign(3, false);
  r.ball = RowMatX<double>::Constant(rows, 3, std::nan(""));
  const Tree<double> tree = make_tree(truth);
  const StringSpec& s = *truth.ball->string;
  const auto anchor = [&](double t) {
    VecX<double> q(3), qd(3), qdd(3);
    for (int j = 0; j < 3; ++j) {
      q[j] = shake * angle(j, t, 0);
      qd[j] = shake * angle(j, t, 1);
      qdd[j] = shake * angle(j, t, 2);
    }
    LinkKinematics<double> kinematics;
    forward_kinematics<double, double>(tree, q, qd, qdd, kinematics);
    const FrameMotion<double> f =
        frame_motion(kinematics, 2, Pose<double>{Mat3<double>::identity(), s.p_LS});
    return std::array<Vec3<double>, 3>{f.X_WF.p, f.velocity, f.acceleration};
  };
  // Semi-implicit steps of 20 µs on a stiff spring-damper in place of the constraint would be
  // another choice; here the tension is eliminated and errors of length are pulled back.
  const auto a0 = anchor(0.0);
  Vec3<double> x = a0[0] + Vec3<double>{0, 0, -s.length}, v = a0[1];
  const Vec3<double> g{0, 0, -9.81};
  const int fine = 40;
  for (long k = 0; k < rows; ++k) {
    r.time[k] = static_cast<double>(k) * dt;
    for (int j = 0; j < 3; ++j) r.q(k, j) = shake * angle(j, r.time[k], 0);
    if (k % 5 == 0)
      r.ball.row(k) << x.x + kNoise * rng.normal(), x.y + kNoise * rng.normal(),
          x.z + kNoise * rng.normal();
    for (int i = 0; i < fine; ++i) {
      const double h = dt / fine;
      const auto at = anchor(r.time[k] + (i + 0.5) / fine * dt);
      const Vec3<double> mid = x + v * (0.5 * h), delta = mid - at[0], delta_d = v - at[1];
      const double excess = dot(delta, delta) - s.length * s.length;
      Vec3<double> a = g - v * drag;
      const double pull = (dot(delta, a - at[2]) + dot(delta_d, delta_d) + 2e4 * 0.5 * excess +
                           280.0 * dot(delta, delta_d)) /
                          dot(delta, delta);
      if (excess >= -1e-9 && pull > 0.0) a = a - delta * pull;
      v = v + a * h;
      x = mid + v * (0.5 * h);
    }
  }
  return r;
}

}  // namespace

TEST_CASE("ball fit: length, attachment and drag come out of a noisy recording", "[ball]") {
  const unsigned seed = GENERATE(range(0u, 3u));
  CAPTURE(seed);
  const Model truth = test::swinging_arm();
  Model nominal = truth;
  nominal.ball->string->length = 0.2;  // off by a factor of two
  nominal.ball->string->p_LS = {0.25, 0.0, 0.08};
  const Recording r = recorded(truth, 0.08, 20.0, seed);
  const BallFitOptions options;
  BallData data = make_ball_data(nominal, {r}, options);
  guess_string(data, nominal.ball->string->p_LS, nominal.ball->string->length);
  CHECK_THAT(nominal.ball->string->length, WithinAbs(0.40, 5e-3));
  const BallLayout layout = make_ball_layout(nominal, {{"linear_drag", "ball", {}}});
  const BallFit fit = fit_ball(nominal, layout, data, options);
  CAPTURE(fit.termination, fit.iterations, fit.p.transpose(), fit.sigma);
  CHECK(fit.converged);
  CHECK_THAT(fit.sigma, WithinAbs(kNoise, 0.05 * kNoise));
  const VecX<double> expected = (VecX<double>(5) << 0.40, 0.28, 0.02, 0.05, 0.08).finished();
  for (int k = 0; k < 5; ++k) {
    CAPTURE(layout.parameters[k].name, fit.p[k], expected[k], std::sqrt(fit.covariance(k, k)));
    CHECK(std::abs(fit.p[k] - expected[k]) < 4.0 * std::sqrt(fit.covariance(k, k)) + 2e-4);
    if (k < 4) CHECK(std::abs(fit.p[k] - expected[k]) < 2e-3);
  }
}

TEST_CASE("ball fit: slack phases do not break it", "[ball]") {
  const Model truth = test::swinging_arm();
  const Recording r = recorded(truth, 0.05, 12.0, 7, 1.9);
  Model nominal = truth;
  nominal.ball->string->length = 0.41;
  nominal.ball->string->p_LS = {0.275, 0.02, 0.05};
  BallFitOptions options;
  options.window = 1.0;
  BallData data = make_ball_data(nominal, {r}, options);
  const BallLayout layout = make_ball_layout(nominal, {{"linear_drag", "ball", {}}});
  const BallFit fit = fit_ball(nominal, layout, data, options);
  CAPTURE(fit.termination, fit.iterations, fit.p.transpose(), fit.sigma);
  CHECK_THAT(fit.p[0], WithinAbs(0.40, 2e-3));
  CHECK_THAT(fit.p[1], WithinAbs(0.28, 2e-3));
}

TEST_CASE("ball fit: without gravity, every effect's first order is known", "[ball]") {
  Model model = test::swinging_arm();
  model.gravity = {0, 0, 0};
  const double length = model.ball->string->length, pace = 2.0;  // [rad/s]
  const Vec3<double> knot{0.1, -0.2, 1.0};
  model.ball->string->p_LS = {0, 0, 0};
  BallData data;
  data.hands.emplace_back(Pose<double>{Mat3<double>::identity(), knot});
  BallWindow circle;
  circle.taut = true;
  for (int k = 0; k <= 60; ++k) {
    const double at = 0.05 * pace * k;
    circle.time.push_back(0.05 * k);
    circle.seen.push_back(knot + Vec3<double>{length * std::cos(at), length * std::sin(at), 0});
  }
  circle.state = {circle.seen.front(), {0, length * pace, 0}};
  data.windows.push_back(circle);
  int tried = 0;
  for (const EffectInfo& i : catalogue()) {
    if (!acts_on_ball(i) || i.port == Port::kBallImpact) continue;  // no plane is there to hit
    for (const std::string& where : places(i, model)) {
      CAPTURE(i.name, where);
      ++tried;
      const BallLayout layout = make_ball_layout(model, {{i.name, where, {}}}, false);
      const BallLinearisation at =
          linearise_ball(model, layout, layout.values(), data, 1e-3, BallFitOptions{});
      CHECK(at.R.allFinite());
      CHECK(at.norms.allFinite());
      CHECK(at.chi2 < 1e-6);  // of the circle: within 0.1 µm
    }
  }
  CHECK(tried > 10);
}

TEST_CASE("ball fit: an anchor's motion has the derivatives of the time it is asked at", "[ball]") {
  const Model model = test::swinging_arm();
  const BallData data = make_ball_data(model, {recorded(model, 0.0, 3.0, 1)}, {});
  const BallLayout layout = make_ball_layout(model, {});
  std::vector<JetD> p;
  for (const BallParameter& parameter : layout.parameters) p.emplace_back(parameter.value);
  const BallWorld<JetD> world(model, layout, data.hands.front(), p);
  for (const JetD& time : {JetD(1.5), JetD(1.5, 2), JetD(1.5, 3), JetD(1.5), JetD(1.6, 3)}) {
    const AnchorMotion<JetD> kept = world.anchor(time),
                             fresh = data.hands.front().anchor(time, world.p_LS);
    CHECK(kept.x.y.a == fresh.x.y.a);
    CHECK(kept.x.y.v == fresh.x.y.v);
    CHECK(kept.v.y.v == fresh.v.y.v);
  }
}

TEST_CASE("ball fit: a ball that is never taut is refused", "[ball]") {
  Model model = test::swinging_arm();
  Recording r = recorded(model, 0.0, 3.0, 1);
  Rng rng(3);
  for (long k = 0; k < r.rows(); ++k)
    for (int c = 0; c < 3; ++c)
      if (!std::isnan(r.ball(k, c))) r.ball(k, c) = 2.0 * rng.normal();
  BallData data = make_ball_data(model, {r}, {});
  CHECK_THROWS_WITH(guess_string(data, model.ball->string->p_LS, model.ball->string->length),
                    ContainsSubstring("nowhere taut"));
}

TEST_CASE(
    "ball fit: fast motions, whose string is slack again and again, are followed to the noise",
    "[ball]") {
  const Model model = test::swinging_arm();
  const BallFitOptions options;
  int fits = 0, followed = 0;
  for (const double shake : {1.5, 2.0})
    for (const unsigned seed : {20u, 21u, 22u, 23u}) {
      const Recording r = test::record_swing(
          model, {.seed = seed, .noise = kNoise, .shake = shake, .pace = 2.0});
      for (const bool held_out : {false, true}) {
        BallData data = make_ball_data(model, {r}, options);
        BallLayout layout = make_ball_layout(model, {});
        if (held_out)  // the states alone
          for (BallParameter& p : layout.parameters) p.fixed = true;
        else
          layout.parameters[0].value = 0.39;
        const BallFit fit = fit_ball(model, layout, data, options);
        CHECK_THAT(fit.p[0], WithinAbs(0.4, 5e-4));
        bool to_the_noise = fit.converged;
        for (const BallWindow& w : data.windows) {
          const VecX<double> left =
              ball_window_errors(model, layout, fit.p, data, w, options.flight);
          // 600 numbers a window: ± 3 % of the noise, and what an impact makes of 0.2 ms.
          to_the_noise = to_the_noise &&
                         left.norm() / std::sqrt(static_cast<double>(left.size())) < 1.2 * kNoise;
        }
        ++fits;
        followed += to_the_noise;
      }
    }
  // After an impact a window has many minima: one fit of sixteen ends in another one.
  CHECK(fits == 16);
  CHECK(followed >= 15);
}

}  // namespace ball_fit_test
