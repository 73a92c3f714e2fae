#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/policy/gaussian.hpp>

#include "support/matrix_near.hpp"

namespace gaussian_test {

using namespace diffnea;
using Catch::Approx;
using test::MatrixNear;

namespace {

MatX<double> random_matrix(long rows, long cols, Rng& rng) {
  MatX<double> m(rows, cols);
  for (double& x : m.reshaped()) x = rng.normal();
  return m;
}

Gaussian random_gaussian(int d, Rng& rng) {
  const MatX<double> A = random_matrix(d, d + 3, rng);
  return {random_matrix(d, 1, rng), A * A.transpose()};
}

/// Inverses of random matrices of condition 10³ lose three digits: 1e-13, 10² of margin.
constexpr double kInverseTol = 1e-11;

}  // namespace

TEST_CASE("Gaussian: KL divergence and entropy equal the textbook's with explicit inverses",
          "[policy]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  Rng rng(seed);
  const int d = 1 + static_cast<int>(seed) % 7;
  const Gaussian a = random_gaussian(d, rng), b = random_gaussian(d, rng);
  const MatX<double> inverse = b.covariance.inverse();
  const VecX<double> shift = b.mean - a.mean;
  const double kl = 0.5 * ((inverse * a.covariance).trace() + shift.dot(inverse * shift) - d +
                           std::log(b.covariance.determinant() / a.covariance.determinant()));
  CHECK(kl_divergence(a, b) == Approx(kl).epsilon(kInverseTol));
  CHECK(a.entropy() ==
        Approx(0.5 *
               std::log((2.0 * std::numbers::pi * std::numbers::e * a.covariance).determinant()))
            .epsilon(kInverseTol)
            .margin(kInverseTol));
  CHECK(kl_divergence(a, a) < 1e-25);  // squares of rounding
}

TEST_CASE("Gaussian: a tiny KL divergence keeps its digits", "[policy]") {
  Gaussian a{VecX<double>::Zero(3), MatX<double>::Identity(3, 3)}, b = a;
  const double h = 1e-6;
  b.covariance *= 1.0 + h;
  // ½ d (1/(1+h) − 1 + log(1+h)) = ½ d (h²/2 − 2h³/3 + …)
  CHECK(kl_divergence(a, b) == Approx(1.5 * (h * h / 2 - 2 * h * h * h / 3)).epsilon(1e-8));
}

TEST_CASE("Gaussian: samples have its mean and covariance, the same for a seed", "[policy]") {
  Rng rng(3);
  const Gaussian g = random_gaussian(4, rng);
  Rng first(11), second(11);
  const int count = 100000;
  const RowMatX<double> x = g.sample(count, first);
  CHECK(x == g.sample(count, second));
  const VecX<double> mean = x.colwise().mean();
  const RowMatX<double> centred = x.rowwise() - mean.transpose();
  const double scale = g.covariance.diagonal().maxCoeff();
  const double kFiveSigma = 5.0 * std::sqrt(2.0 / count);  // of a variance's estimate
  CHECK_THAT(mean, MatrixNear(g.mean, kFiveSigma * std::sqrt(scale)));
  CHECK_THAT(MatX<double>(centred.transpose() * centred / count),
             MatrixNear(g.covariance, kFiveSigma * scale));
  CHECK_THAT(g.std(), MatrixNear(g.covariance.diagonal().cwiseSqrt(), 0.0));
}

TEST_CASE("Gaussian: conditioning equals the textbook's and hits an exact via-point", "[policy]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  Rng rng(seed);
  const int d = 6, m = 1 + static_cast<int>(seed) % 3;
  const Gaussian prior = random_gaussian(d, rng);
  const MatX<double> A = random_matrix(m, d, rng);
  const VecX<double> y = random_matrix(m, 1, rng);
  const MatX<double> root = random_matrix(m, m, rng), R = root * root.transpose();

  // Information form: Σ'⁻¹ = Σ⁻¹ + AᵀR⁻¹A, Σ'⁻¹μ' = Σ⁻¹μ + AᵀR⁻¹y.
  const MatX<double> before = prior.covariance.inverse(), noise = R.inverse();
  const MatX<double> covariance = (before + A.transpose() * noise * A).inverse();
  const VecX<double> mean = covariance * (before * prior.mean + A.transpose() * noise * y);
  const Gaussian g = conditioned(prior, A, y, R);
  const double kTol = 1e-8;  // inverses of two ill-conditioned matrices
  CHECK_THAT(g.mean, MatrixNear(mean, kTol * (1.0 + mean.norm())));
  CHECK_THAT(g.covariance, MatrixNear(covariance, kTol * covariance.norm()));

  const double exact = 1e-9;
  const Gaussian hit = conditioned(prior, A, y, exact * exact * MatX<double>::Identity(m, m));
  CHECK_THAT(A * hit.mean, MatrixNear(y, kTol));
  CHECK(Eigen::SelfAdjointEigenSolver<MatX<double>>(hit.covariance).eigenvalues()[0] >
        -1e-14 * prior.covariance.norm());
  CHECK(hit.covariance == hit.covariance.transpose());
}

TEST_CASE("Gaussian: thousands of via-points leave it positive definite", "[policy]") {
  Rng rng(5);
  Gaussian g = random_gaussian(5, rng);
  for (int i = 0; i < 2000; ++i) {
    g = conditioned(g, random_matrix(1, 5, rng), VecX<double>::Zero(1),
                    MatX<double>::Constant(1, 1, 1e-4));
    REQUIRE(std::isfinite(g.entropy()));
  }
}

TEST_CASE("Gaussian: singular covariances and wrong shapes are said, not computed with",
          "[policy]") {
  Gaussian good{VecX<double>::Zero(2), MatX<double>::Identity(2, 2)}, singular = good, nan = good;
  singular.covariance(1, 1) = 0.0;
  nan.covariance(0, 0) = std::nan("");
  Rng rng(1);
  for (const Gaussian& bad : {singular, nan}) {
    CHECK_THROWS_AS(bad.entropy(), Error);
    CHECK_THROWS_AS(bad.sample(1, rng), Error);
    CHECK(kl_divergence(good, bad) == std::numeric_limits<double>::infinity());
    CHECK(kl_divergence(bad, good) == std::numeric_limits<double>::infinity());
  }
  const Gaussian larger{VecX<double>::Zero(3), MatX<double>::Identity(3, 3)};
  CHECK_THROWS_AS(kl_divergence(good, larger), ShapeError);
  CHECK_THROWS_AS(kl_divergence(good, {VecX<double>::Zero(2), MatX<double>::Identity(3, 2)}),
                  ShapeError);
  CHECK_THROWS_AS(conditioned(good, MatX<double>::Identity(1, 3), VecX<double>::Zero(1),
                              MatX<double>::Identity(1, 1)),
                  ShapeError);
}

}  // namespace gaussian_test
