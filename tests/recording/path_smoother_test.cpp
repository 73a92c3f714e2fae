#include "recording/path_smoother.hpp"

#include <cmath>
#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include "core/decompositions.hpp"

namespace diffnea::path_smoother_test {

using detail::PathSmoother;

namespace {

/// The smoother's least-squares problem written out: of each row q, q̇ dt, q̈ dt²/2, q⃛ dt³/6.
struct Dense {
  Dense(double cutoff, double rate, long rows) : states(4 * rows), A(5 * rows - 4, 4 * rows) {
    const double h = 2.0 * M_PI * cutoff / rate;
    const auto over = [](int n, int k) {
      return std::tgamma(n + 1) / std::tgamma(k + 1) / std::tgamma(n - k + 1);
    };
    MatX<double> F(4, 4), covariance(4, 4);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        F(i, j) = j < i ? 0.0 : over(j, i);
        covariance(i, j) = std::pow(h, 8) / 36.0 * over(3, i) * over(3, j) / (7 - i - j);
      }
    const MatX<double> L = covariance.llt().matrixL();
    const MatX<double> W = L.inverse();
    A.setZero();
    for (long k = 0; k < rows; ++k) {
      A(k, 4 * k) = 1.0;
      if (k + 1 == rows) break;
      A.block(rows + 4 * k, 4 * k, 4, 4) = -W * F;
      A.block(rows + 4 * k, 4 * k + 4, 4, 4) = W;
    }
  }
  long states;
  MatX<double> A;
};

}  // namespace

TEST_CASE("path: the smoother solves its least-squares problem, errors at the ends included",
          "[recording]") {
  constexpr double kCutoff = 8.0, kRate = 50.0;
  const long rows = GENERATE(5L, 12L, 40L);
  const Dense dense(kCutoff, kRate, rows);
  Rng rng(3);
  RowMatX<double> y(rows, 1), q, qd, qdd;
  for (long k = 0; k < rows; ++k) y(k, 0) = rng.normal();
  const PathSmoother smoother(kCutoff, kRate);
  smoother.smooth(y, q, qd, qdd);
  VecX<double> right = VecX<double>::Zero(dense.A.rows());
  right.head(rows) = y.col(0);
  const VecX<double> z = dense.A.colPivHouseholderQr().solve(right);
  const MatX<double> covariance = (dense.A.transpose() * dense.A).inverse();
  const VecX<double> variance = smoother.acceleration_variance(rows);
  for (long k = 0; k < rows; ++k) {
    CAPTURE(rows, k);
    CHECK_THAT(q(k, 0), Catch::Matchers::WithinAbs(z[4 * k], 1e-8));
    CHECK_THAT(qd(k, 0), Catch::Matchers::WithinAbs(z[4 * k + 1] * kRate, 1e-6));
    CHECK_THAT(qdd(k, 0), Catch::Matchers::WithinAbs(z[4 * k + 2] * 2.0 * kRate * kRate, 1e-4));
    CHECK_THAT(variance[k],
               Catch::Matchers::WithinRel(
                   covariance(4 * k + 2, 4 * k + 2) * 4.0 * std::pow(kRate, 4), 1e-6));
  }
}

TEST_CASE("path: a cubic passes unchanged up to its ends", "[recording]") {
  const double rate = GENERATE(50.0, 1000.0, 20000.0);  // the last one far above the cut-off
  const PathSmoother smoother(5.0, rate);
  const long rows = static_cast<long>(2.0 * rate);
  RowMatX<double> y(rows, 1), q, qd, qdd;
  const auto at = [&](long k) { return static_cast<double>(k) / rate; };
  for (long k = 0; k < rows; ++k) {
    const double t = at(k);
    y(k, 0) = 0.3 + t - 2.0 * t * t + 0.5 * t * t * t;
  }
  smoother.smooth(y, q, qd, qdd);
  double position = 0.0, velocity = 0.0, acceleration = 0.0;
  for (long k = 0; k < rows; ++k) {
    const double t = at(k);
    position = std::max(position, std::abs(q(k, 0) - y(k, 0)));
    velocity = std::max(velocity, std::abs(qd(k, 0) - (1.0 - 4.0 * t + 1.5 * t * t)));
    acceleration = std::max(acceleration, std::abs(qdd(k, 0) - (-4.0 + 3.0 * t)));
  }
  // Rounding of positions, 1e-16, by (rate/cut-off)^4 and, of accelerations, by rate² at most.
  CAPTURE(rate);
  CHECK(position < 1e-6);
  CHECK(velocity < 1e-4);
  CHECK(acceleration < 1e-2);
}

TEST_CASE("path: away from its ends a sine keeps its phase and takes the gain 1/(1 + (f/f_c)^8)",
          "[recording]") {
  constexpr double kCutoff = 10.0, kRate = 1000.0;
  const double share = GENERATE(0.3, 0.67, 1.0, 1.5);
  const double w = 2.0 * M_PI * share * kCutoff;
  RowMatX<double> y(4000, 1), q, qd, qdd;
  for (long k = 0; k < y.rows(); ++k) y(k, 0) = std::sin(w * static_cast<double>(k) / kRate);
  PathSmoother(kCutoff, kRate).smooth(y, q, qd, qdd);
  const double gain = 1.0 / (1.0 + std::pow(share, 8));
  for (long k = 1500; k < 2500; ++k) {
    REQUIRE_THAT(q(k, 0), Catch::Matchers::WithinAbs(gain * y(k, 0), 2e-4));
    REQUIRE_THAT(qdd(k, 0), Catch::Matchers::WithinAbs(-gain * w * w * y(k, 0), 2e-4 * w * w));
  }
}

TEST_CASE("path: what it cannot smooth is refused", "[recording]") {
  CHECK_THROWS_AS(PathSmoother(25.0, 50.0), DataError);
  CHECK_THROWS_AS(PathSmoother(0.0, 50.0), DataError);
  CHECK_THROWS_AS(PathSmoother(std::nan(""), 50.0), DataError);
  RowMatX<double> q, qd, qdd;
  CHECK_THROWS_AS(PathSmoother(5.0, 50.0).smooth(RowMatX<double>::Zero(4, 1), q, qd, qdd),
                  DataError);
}

}  // namespace diffnea::path_smoother_test
