#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/policy/promp.hpp>

#include "support/matrix_near.hpp"

namespace promp_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using test::MatrixNear;

namespace {

/// Features are of order 1, their slopes of order 10: rounding, with 10² of margin.
constexpr double kRoundingTol = 1e-13;

PrompSpec spec_of(int bases, double width, bool returns) {
  PrompSpec s;
  s.joints = {"a", "b"};
  s.bases = bases;
  s.held_first = s.held_last = bases >= 6 ? 2 : 0;
  s.width = width;
  s.returns = returns;
  return s;
}

VecX<double> features(const Promp& promp, double time, bool velocity = false) {
  VecX<double> phi, phi_d;
  promp.features(time, phi, phi_d);
  return velocity ? phi_d : phi;
}

}  // namespace

TEST_CASE("ProMP: starts at zero and at rest, ends at rest, comes home if asked to", "[policy]") {
  const int bases = GENERATE(2, 5, 9, 30);
  const double width = GENERATE(0.01, 0.5, 1.0, 3.0);
  const bool returns = GENERATE(false, true);
  CAPTURE(bases, width, returns);
  const PrompSpec spec = spec_of(bases, width, returns);
  const Promp promp(spec);
  REQUIRE(promp.size() == 2 * promp.parameters_per_joint());
  const VecX<double> zero = VecX<double>::Zero(promp.parameters_per_joint());
  CHECK(features(promp, 0.0) == zero);
  CHECK(features(promp, 0.0, true) == zero);
  // Just before the end, the slope is its limit's, not set to zero.
  const double before = std::nextafter(spec.duration, 0.0);
  const double kSteepTol = 1e-10 / (width * width);  // narrow bases bend by 1/σ² in one ulp
  CHECK_THAT(features(promp, before, true), MatrixNear(zero, kSteepTol));
  for (const double after : {spec.duration, spec.duration + 0.3, 1e9}) {
    CHECK(features(promp, after, true) == zero);
    CHECK(features(promp, after) == features(promp, spec.duration));
  }
  if (returns)
    CHECK_THAT(features(promp, spec.duration), MatrixNear(zero, kRoundingTol));
  else if (spec.held_last == 0)  // the last basis has its centre there
    CHECK(features(promp, spec.duration).maxCoeff() == features(promp, spec.duration)[bases - 1]);
}

TEST_CASE("ProMP: nothing but the cubic of the ends is subtracted", "[policy]") {
  PrompSpec spec = spec_of(9, 1.0, true);
  spec.held_first = spec.held_last = 0;
  // Normalised bases sum to 1, so that corrected ones sum to 1 less the cubic with p = 1 at both
  // ends, which is 1; without the return to the cubic from 0 to 1.
  const Promp home(spec);
  spec.returns = false;
  const Promp away(spec);
  for (double s = 0.0; s <= 1.0; s += 0.05) {
    CAPTURE(s);
    CHECK(std::abs(features(home, s * spec.duration).sum()) < kRoundingTol);
    CHECK(std::abs(features(away, s * spec.duration).sum() - s * s * (3.0 - 2.0 * s)) <
          kRoundingTol);
  }
  // Far from the ends the middle basis is the normalised Gaussian itself: its value at its centre.
  double sum = 0.0;
  for (int b = -4; b <= 4; ++b) sum += std::exp(-0.5 * b * b);
  const double at_ends = 2e-3;  // ¼ of the middle basis' slope there: 32 exp(−8)/Σ
  CHECK(std::abs(features(home, 0.5 * spec.duration)[4] - 1.0 / sum) < at_ends);
}

TEST_CASE("ProMP: velocities are the derivative of positions in time", "[policy]") {
  const int bases = GENERATE(2, 9, 15);
  const bool returns = GENERATE(false, true);
  const double duration = GENERATE(0.4, 1.5, 10.0);
  CAPTURE(bases, returns, duration);
  PrompSpec spec = spec_of(bases, 1.0, returns);
  spec.duration = duration;
  const Promp promp(spec);
  // Step h·T: rounding 1e-16/1e-5 = 1e-11 and third derivatives of 1e3 × 1e-10 = 1e-7, over T.
  const double h = 1e-5 * duration, kCentralDifferenceTol = 1e-6 / duration;
  for (int i = 1; i < 50; ++i) {
    const double t = i / 50.0 * duration;
    const VecX<double> central = (features(promp, t + h) - features(promp, t - h)) / (2.0 * h);
    CHECK_THAT(features(promp, t, true), MatrixNear(central, kCentralDifferenceTol));
  }
}

TEST_CASE("ProMP: twice the duration is the same path at half the speed", "[policy]") {
  PrompSpec spec = spec_of(9, 1.0, true);
  const Promp fast(spec);
  spec.duration *= 2.0;
  const Promp slow(spec);
  Rng rng(1);
  VecX<double> theta(fast.size());
  for (double& x : theta) x = rng.normal();
  const VecX<double> times = VecX<double>::LinSpaced(101, 0.0, fast.spec().duration);
  RowMatX<double> q, qd, slow_q, slow_qd;
  fast.motion(theta, times, q, qd);
  slow.motion(theta, 2.0 * times, slow_q, slow_qd);
  CHECK_THAT(slow_q, MatrixNear(q, kRoundingTol));
  CHECK_THAT(2.0 * slow_qd, MatrixNear(qd, 1e2 * kRoundingTol));
  CHECK(qd.cwiseAbs().maxCoeff() > 1.0);
}

TEST_CASE("ProMP: a motion is the sum of its joint's features", "[policy]") {
  const Promp promp(spec_of(9, 1.0, true));
  const int p = promp.parameters_per_joint();
  VecX<double> theta = VecX<double>::Zero(promp.size());
  theta[p + 2] = 0.7;  // of joint b
  RowMatX<double> q, qd;
  const VecX<double> times = VecX<double>::LinSpaced(20, 0.0, 2.0);
  promp.motion(theta, times, q, qd);
  CHECK(q.col(0).isZero(0.0));
  for (long i = 0; i < times.size(); ++i) {
    CHECK(std::abs(q(i, 1) - 0.7 * features(promp, times[i])[2]) < kRoundingTol);
    CHECK(std::abs(qd(i, 1) - 0.7 * features(promp, times[i], true)[2]) < kRoundingTol);
  }
  CHECK_THROWS_AS(promp.motion(theta.head(3), times, q, qd), ShapeError);
}

TEST_CASE("ProMP: what makes no primitive is refused by name", "[policy]") {
  const PrompSpec good = spec_of(9, 1.0, true);
  const auto refused = [&](auto change, const char* word) {
    PrompSpec spec = good;
    change(spec);
    CHECK_THROWS_WITH(Promp(spec), ContainsSubstring(word));
  };
  refused([](PrompSpec& s) { s.joints.clear(); }, "no joint");
  refused([](PrompSpec& s) { s.joints = {"a", "a"}; }, "'a' is named twice");
  refused([](PrompSpec& s) { s.bases = 1; }, "at least 2");
  refused([](PrompSpec& s) { s.held_first = 7; }, "held");
  refused([](PrompSpec& s) { s.held_last = -1; }, "held");
  refused([](PrompSpec& s) { s.width = 0.0; }, "width");
  refused([](PrompSpec& s) { s.duration = std::nan(""); }, "duration");
  refused([](PrompSpec& s) { s.hold = -1.0; }, "hold");
  CHECK_THROWS_WITH(features(Promp(good), -0.1), ContainsSubstring("expected 0 or later"));
}

}  // namespace promp_test
