#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>
#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/policy/ereps.hpp>

#include "support/matrix_near.hpp"

namespace ereps_test {

using namespace diffnea;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;
using test::MatrixNear;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Bounds are met up to the resolution of the bisections.
constexpr double kBoundTol = 1e-9;

VecX<double> random_vector(long n, Rng& rng) {
  VecX<double> x(n);
  for (double& v : x) v = rng.normal();
  return x;
}

/// Rewards of every kind that a task may give: smooth, with ties, in jumps, with outliers, −∞.
VecX<double> rewards_of_kind(unsigned kind, long n, Rng& rng) {
  VecX<double> r = random_vector(n, rng);
  switch (kind % 8) {
    case 1:
      r = r.array().round();
      break;  // ties
    case 2:
      r = 1e-200 * r;
      break;  // tiny
    case 3:
      r = 1e300 * r;
      break;  // huge
    case 4:
      r[0] = -1e12;
      break;  // an outlier
    case 5:
      r = r.array() + 1e9;
      break;  // a large offset
    case 6:
      r.tail(n / 2).setConstant(-kInfinity);
      break;  // failures
    case 7:
      r = (10.0 * r).array().exp();
      break;  // one above all others
    default:
      break;
  }
  return r;
}

/// Σ w log(M w), apart from the library's.
double divergence_from_uniform(const VecX<double>& weights, const VecX<double>& rewards) {
  const double M = static_cast<double>((rewards.array() > -kInfinity).count());
  double sum = 0.0;
  for (const double w : weights)
    if (w > 0.0) sum += w * std::log(M * w);
  return sum;
}

Gaussian unit(int d, double std = 0.5) {
  return {VecX<double>::Zero(d), std * std * MatX<double>::Identity(d, d)};
}

double least_eigenvalue(const Gaussian& g) {
  return Eigen::SelfAdjointEigenSolver<MatX<double>>(g.covariance).eigenvalues()[0];
}

}  // namespace

TEST_CASE("eREPS: the dual's slope is its derivative", "[policy]") {
  Rng rng(1);
  VecX<double> rewards = random_vector(40, rng);
  rewards[7] = -kInfinity;
  for (const double eta : {0.05, 0.3, 1.0, 20.0}) {
    CAPTURE(eta);
    double slope = 0.0;
    ereps_dual(rewards, 0.5, eta, &slope);
    const double h = 1e-5 * eta;
    const double central =
        (ereps_dual(rewards, 0.5, eta + h) - ereps_dual(rewards, 0.5, eta - h)) / (2.0 * h);
    constexpr double kCentralDifferenceTol = 1e-8;  // 1e-10 of curvature, 1e-16/(1e-5 × 0.05)
    CHECK(slope == Approx(central).margin(kCentralDifferenceTol));
  }
}

TEST_CASE("eREPS: weights meet the bound and the dual is least there", "[policy]") {
  const unsigned seed = GENERATE(range(0u, 200u));
  CAPTURE(seed);
  Rng rng(seed);
  const long n = 2 + static_cast<long>(rng.uniform() * 80.0);
  const double epsilon = std::pow(10.0, rng.uniform(-6.0, 0.5));
  const VecX<double> rewards = rewards_of_kind(seed, n, rng);
  CAPTURE(n, epsilon, rewards.transpose());
  const Reweighting w = reweight(rewards, epsilon);
  constexpr double kSumTol = 1e-14;  // rounding of 80 weights
  CHECK(w.weights.sum() == Approx(1.0).epsilon(kSumTol));
  CHECK(w.weights.minCoeff() >= 0.0);
  CHECK(w.kl <= epsilon * (1.0 + kBoundTol));
  CHECK(divergence_from_uniform(w.weights, rewards) == Approx(w.kl).margin(1e-13));
  CHECK(w.effective_samples == Approx(1.0 / w.weights.squaredNorm()));
  CHECK((std::isfinite(w.eta) && w.eta > 0.0));
  for (long i = 0; i < n; ++i) {
    if (rewards[i] == -kInfinity) CHECK(w.weights[i] == 0.0);
    for (long k = 0; k < n; ++k)
      if (rewards[i] > rewards[k]) REQUIRE(w.weights[i] >= w.weights[k]);
  }
  if (seed % 8 == 3) return;  // the dual of 1e300 overflows on the grid
  const double least = ereps_dual(rewards, epsilon, w.eta);
  const double largest =
      rewards.array().abs().isFinite().select(rewards.array().abs(), 0.0).maxCoeff();
  // Where taking the best alone is within the bound, the dual falls towards 0 for good.
  const double from = w.kl < epsilon * (1.0 - kBoundTol) ? 0.0 : -12.0;
  for (double x = from; x <= 12.0; x += 0.05)
    CHECK(ereps_dual(rewards, epsilon, w.eta * std::exp(x)) >= least - 1e-14 * (largest + w.eta));
}

TEST_CASE("eREPS: the bound is used where the rewards allow it", "[policy]") {
  Rng rng(4);
  const VecX<double> rewards = random_vector(60, rng);
  for (const double epsilon : {1e-8, 1e-3, 0.5, 3.0}) {
    CAPTURE(epsilon);
    CHECK(reweight(rewards, epsilon).kl == Approx(epsilon).epsilon(kBoundTol));
    // Weights do not depend on the unit or the zero of rewards.
    const Reweighting a = reweight(rewards, epsilon), b = reweight(1e6 * rewards, epsilon);
    CHECK_THAT(b.weights, MatrixNear(a.weights, 1e-12));
    CHECK(b.eta == Approx(1e6 * a.eta));
  }
}

TEST_CASE("eREPS: weights of ties, of one sample and of the best alone", "[policy]") {
  for (const double reward : {0.0, -3.0, 1e300}) {
    const Reweighting ties = reweight(VecX<double>::Constant(5, reward), 0.5);
    CHECK(ties.weights == VecX<double>::Constant(5, 0.2));
    CHECK(ties.kl == 0.0);
    CHECK((std::isfinite(ties.eta) && ties.eta > 0.0));
  }
  CHECK(reweight(VecX<double>::Constant(1, -2.0), 0.5).weights[0] == 1.0);
  CHECK(reweight(Eigen::Vector3d(-kInfinity, 2.0, -kInfinity), 0.5).weights[1] == 1.0);
  // log(3/2) < 0.5: the two best alone are within the bound.
  const Reweighting two = reweight(Eigen::Vector3d(1.0, 1.0, 0.0), 0.5);
  CHECK_THAT(two.weights, MatrixNear(Eigen::Vector3d(0.5, 0.5, 0.0), 1e-15));
}

TEST_CASE("eREPS: rewards that say nothing are refused", "[policy]") {
  CHECK_THROWS_WITH(reweight(Eigen::Vector2d(0.0, std::nan("")), 0.5),
                    ContainsSubstring("reward 1 is NaN"));
  CHECK_THROWS_WITH(reweight(Eigen::Vector2d(kInfinity, 0.0), 0.5),
                    ContainsSubstring("reward 0 is +inf"));
  CHECK_THROWS_AS(reweight(VecX<double>::Constant(3, -kInfinity), 0.5), DataError);
  CHECK_THROWS_AS(reweight(VecX<double>(), 0.5), DataError);
  CHECK_THROWS_AS(reweight(Eigen::Vector2d(0.0, 1.0), 0.0), Error);
}

TEST_CASE("eREPS: every update keeps its bound, on any rewards and few samples", "[policy]") {
  const unsigned seed = GENERATE(range(0u, 200u));
  CAPTURE(seed);
  Rng rng(seed);
  const int d = 1 + static_cast<int>(rng.uniform() * 12.0);
  const int n = 2 + static_cast<int>(rng.uniform() * 40.0);  // often fewer than d
  const double kappa = std::pow(10.0, rng.uniform(-4.0, 1.0));
  const double least_std = seed % 3 == 0 ? 0.0 : 0.05;
  Gaussian policy = unit(d);
  CAPTURE(d, n, kappa);
  for (int i = 0; i < 5; ++i) {
    const RowMatX<double> theta = policy.sample(n, rng);
    const Reweighting w = reweight(rewards_of_kind(seed + i, n, rng), 0.5);
    double kl = -1.0;
    const Gaussian next = bounded_update(policy, theta, w.weights, kappa, least_std, &kl);
    CHECK(kl == kl_divergence(policy, next));
    CHECK(kl <= kappa * (1.0 + kBoundTol));
    CHECK(std::isfinite(next.entropy()));
    CHECK(least_eigenvalue(next) >= least_std * least_std * (1.0 - kBoundTol));
    policy = next;
  }
}

TEST_CASE("eREPS: an update is the paper's with some lambda, on the bound or free", "[policy]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  Rng rng(seed);
  const int d = 4, n = 60;
  const Gaussian old = unit(d);
  const RowMatX<double> theta = old.sample(n, rng);
  const VecX<double> w = reweight(-(theta.array() - 0.5).square().rowwise().sum(), 0.5).weights;
  // As printed in CORRECTIONS.md, Σw = 1.
  const auto paper = [&](double lambda) {
    Gaussian g{(theta.transpose() * w + lambda * old.mean) / (1.0 + lambda),
               lambda * old.covariance};
    for (long i = 0; i < n; ++i) {
      const VecX<double> x = theta.row(i).transpose() - g.mean;
      g.covariance += w[i] * x * x.transpose();
    }
    const VecX<double> moved = g.mean - old.mean;
    g.covariance = (g.covariance + lambda * moved * moved.transpose()) / (1.0 + lambda);
    return g;
  };
  constexpr double kTol = 1e-9;  // of the bisection, through a slope of order 1
  double kl = 0.0;
  const Gaussian free = bounded_update(old, theta, w, 1e6, 0.0, &kl);
  CHECK_THAT(free.mean, MatrixNear(paper(0.0).mean, kTol));
  CHECK_THAT(free.covariance, MatrixNear(paper(0.0).covariance, kTol));
  const double kappa = 0.3 * kl;
  const Gaussian bound = bounded_update(old, theta, w, kappa, 0.0, &kl);
  CHECK(kl == Approx(kappa).epsilon(kBoundTol));
  // λ from the mean's share of the way.
  const double share = (bound.mean - old.mean).norm() / (free.mean - old.mean).norm();
  const Gaussian same = paper(1.0 / share - 1.0);
  CHECK_THAT(bound.mean, MatrixNear(same.mean, kTol));
  CHECK_THAT(bound.covariance, MatrixNear(same.covariance, kTol));
}

TEST_CASE("eREPS: a floor above the old deviation neither raises it nor breaks the bound",
          "[policy]") {
  Rng rng(2);
  Gaussian old = unit(3);
  old.covariance(2, 2) = 1e-6;  // std 1e-3
  const RowMatX<double> theta = old.sample(20, rng);
  const VecX<double> w = VecX<double>::Constant(20, 0.05);
  double kl = -1.0;
  const Gaussian next = bounded_update(old, theta, w, 0.01, 0.1, &kl);
  CHECK(kl <= 0.01);
  CHECK(least_eigenvalue(next) >= 1e-6 * (1.0 - kBoundTol));
}

TEST_CASE("eREPS: finds the top of a tilted quadratic in ten dimensions", "[policy]") {
  const unsigned seed = GENERATE(range(0u, 5u));
  CAPTURE(seed);
  const int d = 10;
  Rng rng(100 + seed);
  const VecX<double> top = random_vector(d, rng);
  MatX<double> A(d, d);
  for (double& x : A.reshaped()) x = rng.normal();
  A = 0.3 * A + 3.0 * MatX<double>::Identity(d, d);
  ErepsOptions options;
  options.iterations = 300;
  Ereps search(unit(d), options, seed);
  while (!search.done()) {
    const RowMatX<double>& theta = search.ask();
    const RowMatX<double> off = (theta.rowwise() - top.transpose()) * A.transpose();
    search.tell(-off.rowwise().squaredNorm());
    CHECK(search.history().back().kl_samples <= options.epsilon * (1.0 + kBoundTol));
    CHECK(search.history().back().kl_update <= options.kappa * (1.0 + kBoundTol));
  }
  CHECK(search.stop_reason() == "every standard deviation is below 0.02");
  // Within what the last deviations leave.
  CHECK((search.policy().mean - top).cwiseAbs().maxCoeff() < 5.0 * options.stop_std);
  CHECK((search.best() - top).cwiseAbs().maxCoeff() < 5.0 * options.stop_std);
  CHECK(search.history().back().largest_std < options.stop_std);
}

namespace {

VecX<double> hills(const RowMatX<double>& theta) {
  return theta.array().cos().rowwise().sum() + theta.col(0).array();
}

}  // namespace

TEST_CASE("eREPS: a search that goes on from what was saved is the same bit for bit", "[policy]") {
  const ErepsOptions options{.samples = 15, .iterations = 20};
  Ereps whole(unit(4), options, 7), first(unit(4), options, 7);
  while (!whole.done()) whole.tell(hills(whole.ask()));
  for (int i = 0; i < 8; ++i) first.tell(hills(first.ask()));
  first.ask();  // and was thrown away
  Ereps second(unit(4, 0.9), options, 7);
  second.restore(first.policy(), first.best(), first.history());
  while (!second.done()) second.tell(hills(second.ask()));
  CHECK(second.iteration() == 20);
  CHECK(second.stop_reason() == "20 iterations are done");
  CHECK(second.policy().mean == whole.policy().mean);
  CHECK(second.policy().covariance == whole.policy().covariance);
  CHECK(second.best() == whole.best());
  CHECK(second.history().back().reward_best == whole.history().back().reward_best);
  CHECK(second.history().back().eta == whole.history().back().eta);

  Ereps other(unit(4), options, 8);
  CHECK(other.ask() != Ereps(unit(4), options, 7).ask());
}

TEST_CASE("eREPS: the best sample so far is remembered with its reward", "[policy]") {
  const ErepsOptions options{.samples = 10};
  Ereps search(unit(3), options, 1);
  CHECK(search.best().size() == 0);
  double best = -kInfinity;
  for (int i = 0; i < 10; ++i) {
    VecX<double> rewards = hills(search.ask());
    rewards[i] = -kInfinity;
    const VecX<double> finite = (rewards.array() > -kInfinity).select(rewards, 0.0);
    best = std::max(best, rewards.maxCoeff());
    search.tell(rewards);
    CHECK(search.history().back().reward_best == best);
    CHECK(search.history().back().reward_mean == Approx(finite.sum() / 9.0));
    CHECK(search.history().back().iteration == i + 1);
    CHECK(hills(search.best().transpose())[0] == Approx(best));
  }
}

TEST_CASE("eREPS: a reward that is NaN is named and changes nothing", "[policy]") {
  const ErepsOptions options{.samples = 10};
  Ereps search(unit(2), options, 1), untouched(unit(2), options, 1);
  for (Ereps* s : {&search, &untouched}) s->tell(hills(s->ask()));
  VecX<double> rewards = hills(search.ask());
  char first_parameter[32];
  std::snprintf(first_parameter, sizeof first_parameter, "parameters: %.6g", search.ask()(6, 0));
  rewards[6] = std::nan("");
  CHECK_THROWS_WITH(search.tell(rewards), ContainsSubstring("iteration 2, sample 6") &&
                                              ContainsSubstring("NaN") &&
                                              ContainsSubstring(first_parameter));
  CHECK_THROWS_AS(search.tell(VecX<double>::Constant(10, -kInfinity)), DataError);
  CHECK_THROWS_AS(search.tell(VecX<double>::Constant(10, kInfinity)), DataError);
  CHECK_THROWS_AS(search.tell(VecX<double>::Zero(9)), ShapeError);
  CHECK(search.iteration() == 1);
  for (Ereps* s : {&search, &untouched}) s->tell(hills(s->ask()));
  CHECK(search.policy().covariance == untouched.policy().covariance);
}

TEST_CASE("eREPS: options and states that make no sense are refused", "[policy]") {
  const auto with = [](auto change) {
    ErepsOptions o;
    change(o);
    return Ereps(unit(2), o, 1);
  };
  CHECK_THROWS_AS(with([](ErepsOptions& o) { o.samples = 1; }), Error);
  CHECK_THROWS_AS(with([](ErepsOptions& o) { o.epsilon = 0.0; }), Error);
  CHECK_THROWS_AS(with([](ErepsOptions& o) { o.kappa = std::nan(""); }), Error);
  CHECK_THROWS_AS(with([](ErepsOptions& o) { o.iterations = 0; }), Error);
  CHECK_THROWS_AS(with([](ErepsOptions& o) { o.least_std = -1.0; }), Error);
  CHECK_THROWS_AS(Ereps(unit(2, 0.0), {}, 1), Error);
  CHECK_THROWS_AS(Ereps({VecX<double>::Zero(2), MatX<double>::Identity(3, 3)}, {}, 1), ShapeError);
  Ereps search(unit(2), {}, 1);
  CHECK_THROWS_AS(search.restore(unit(3), {}, {}), ShapeError);
  CHECK_THROWS_AS(search.restore(unit(2), VecX<double>::Zero(2), {}), ShapeError);
  CHECK_THROWS_AS(search.restore(unit(2), VecX<double>::Zero(2), {ErepsIteration{}}), Error);
  CHECK_THROWS_AS(
      bounded_update(unit(2), RowMatX<double>::Zero(3, 2), VecX<double>::Ones(3), 0.5, 0.0), Error);
}

}  // namespace ereps_test
