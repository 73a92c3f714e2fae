#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>
#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_all.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/model/physical.hpp>

namespace physical_test {

using namespace diffnea;
using Catch::Approx;

namespace {

/// Inverse maps go through an eigenvalue or Cholesky decomposition of numbers of order 1: rounding
/// leaves 1e-14 (observed), 10² of margin.
constexpr double kRoundTripTol = 1e-12;
/// Central difference with h = 1e-6 on values of order 10: truncation and rounding leave 1e-8.
constexpr double kCentralDifferenceTol = 1e-6;

/// A body made of point masses: consistent by construction, whatever the formulas say.
SpatialInertia<double> cloud_of_points(Rng& rng, int points) {
  SpatialInertia<double> body{0.0, {0, 0, 0}, {}};
  for (int i = 0; i < points; ++i) {
    const double m = rng.uniform(0.1, 1.0);
    const Vec3<double> p{rng.normal(), rng.normal(), rng.normal()};
    const Sym3<double> I{m * (p.y * p.y + p.z * p.z), -m * p.x * p.y, -m * p.x * p.z,
                         m * (p.x * p.x + p.z * p.z), -m * p.y * p.z, m * (p.x * p.x + p.y * p.y)};
    body = body + SpatialInertia<double>{m, p * m, I};
  }
  return body;
}

void check_equal(const Theta<double>& a, const Theta<double>& b, double tolerance) {
  for (int k = 0; k < kThetaSize; ++k) {
    CAPTURE(k);
    CHECK(a[k] == Approx(b[k]).epsilon(tolerance).margin(tolerance));
  }
}

}  // namespace

TEST_CASE("physical: both coordinates come back to a cloud of point masses", "[model]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  Rng rng(seed);
  const Theta<double> theta = cloud_of_points(rng, 6).theta();
  check_equal(theta_from_virtual(virtual_from_theta(theta)), theta, kRoundTripTol);
  check_equal(theta_from_log_cholesky(log_cholesky_from_theta(theta)), theta, kRoundTripTol);
}

TEST_CASE("physical: any coordinates reach a consistent body only", "[model]") {
  const unsigned seed = GENERATE(range(0u, 50u));
  CAPTURE(seed);
  Rng rng(seed);
  Theta<double> phi;
  for (double& x : phi) x = rng.normal();
  for (const Theta<double>& theta : {theta_from_virtual(phi), theta_from_log_cholesky(phi)}) {
    const auto body = SpatialInertia<double>::from_theta(theta);
    const double size = body.I.xx + body.I.yy + body.I.zz + body.m;
    CHECK(body.m > 0.0);
    CHECK(triangle_margin(body) > -kRoundTripTol * size);
    CHECK(smallest_pseudo_inertia_eigenvalue(theta) > -kRoundTripTol * size);
  }
}

TEST_CASE("physical: the Jacobian is the central difference", "[model]") {
  const auto form = GENERATE(InertiaCoordinates::kVirtual, InertiaCoordinates::kLogCholesky);
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  Rng rng(seed);
  Theta<double> phi;
  for (double& x : phi) x = 0.5 * rng.normal();
  const ThetaJacobian at = theta_with_jacobian(form, phi);
  const double h = 1e-6;
  for (int l = 0; l < kThetaSize; ++l) {
    Theta<double> plus = phi, minus = phi;
    plus[l] += h;
    minus[l] -= h;
    const Theta<double> a = theta_with_jacobian(form, plus).theta;
    const Theta<double> b = theta_with_jacobian(form, minus).theta;
    for (int k = 0; k < kThetaSize; ++k) {
      CAPTURE(k, l);
      CHECK(at.jacobian(k, l) == Approx((a[k] - b[k]) / (2 * h))
                                     .epsilon(kCentralDifferenceTol)
                                     .margin(kCentralDifferenceTol));
    }
  }
}

TEST_CASE("physical: a solid box has its textbook inertia", "[model]") {
  // m = 3, sides 0.2, 0.4, 0.6 about the centre; the frame's origin in one corner.
  const double m = 3, a = 0.2, b = 0.4, c = 0.6;
  const Sym3<double> I_com{m / 12 * (b * b + c * c), 0, 0,
                           m / 12 * (a * a + c * c), 0, m / 12 * (a * a + b * b)};
  const auto body = inertia_from_com<double>(m, {a / 2, b / 2, c / 2}, I_com);
  CHECK(body.I.xx == Approx(m / 3 * (b * b + c * c)));
  CHECK(body.I.xy == Approx(-m * a * b / 4));
  const Theta<double> phi = virtual_from_theta(body.theta());
  CHECK(phi[0] * phi[0] == Approx(m * c * c / 12));  // principal second moments, largest first
  CHECK(phi[2] * phi[2] == Approx(m * a * a / 12));
}

TEST_CASE("physical: impossible bodies are refused with the number that is wrong", "[model]") {
  const auto body = inertia_from_com<double>(1.0, {0, 0, 0}, {0.1, 0, 0, 0.1, 0, 0.5});
  CHECK(triangle_margin(body) == Approx(-0.3));
  CHECK_THROWS_AS(virtual_from_theta(body.theta()), ModelError);
  CHECK_THROWS_AS(log_cholesky_from_theta(body.theta()), ModelError);
  Theta<double> negative_mass = body.theta();
  negative_mass[0] = -1.0;
  CHECK_THROWS_AS(virtual_from_theta(negative_mass), ModelError);
}

}  // namespace physical_test
