/// Exponentials and logarithms of rotations and poses, against Eigen's.

#include <array>
#include <cmath>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>

#include <Eigen/Geometry>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_all.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/core/dual.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/lie/se3.hpp>

#include "support/matrix_near.hpp"

namespace exp_test {

using namespace diffnea;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using test::MatrixNear;

namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double kPi = std::numbers::pi;
/// Some hundred products of numbers of order 1 … 10; observed: 3e-15.
constexpr double kRoundingTol = 1e-13;
/// The matrix exponential of Eigen scales and squares: observed 2e-14 at |ω| = 6.
constexpr double kMatrixExponentialTol = 1e-12;
/// Central difference, h = 1e-6 on values of order 1: truncation and rounding leave 2e-10.
constexpr double kCentralDifferenceTol = 1e-8;

/// From nothing to more than a turn; on both sides of the limits between series and closed forms.
constexpr std::array<double, 15> kAngles{0.0, 1e-300, 1e-160, 1e-9, 1e-4, 0.1,        0.31, 0.32,
                                         0.9, 1.0,    1.1,    2.0,  3.0,  kPi - 1e-6, 6.0};

Vec3<double> random_direction(Rng& rng) {
  const Vec3<double> v{rng.normal(), rng.normal(), rng.normal()};
  return v * (1.0 / std::sqrt(dot(v, v)));
}

Twist<double> random_twist(Rng& rng, double angle) {
  return {random_direction(rng) * angle, {rng.normal(), rng.normal(), rng.normal()}};
}

Eigen::Matrix3d skewed(const Vec3<double>& w) { return to_eigen(skew(w)); }

Eigen::Matrix4d homogeneous(const Pose<double>& X) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.topLeftCorner<3, 3>() = to_eigen(X.R);
  out.topRightCorner<3, 1>() = to_eigen(X.p);
  return out;
}

Eigen::Matrix4d twist_matrix(const Twist<double>& V) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Zero();
  out.topLeftCorner<3, 3>() = skewed(V.angular);
  out.topRightCorner<3, 1>() = to_eigen(V.linear);
  return out;
}

/// ad_V in columns, by the library's bracket with unit twists; `map` is linear.
template <class Map>
Matrix6 matrix_of(const Map& map) {
  Matrix6 out;
  for (int k = 0; k < 6; ++k) {
    Eigen::Matrix<double, 6, 1> e = Eigen::Matrix<double, 6, 1>::Unit(k);
    const Twist<double> U = map(Twist<double>{{e[0], e[1], e[2]}, {e[3], e[4], e[5]}});
    out.col(k) << to_eigen(U.angular), to_eigen(U.linear);
  }
  return out;
}

/// Twelve numbers of a pose.
template <class T>
std::array<T, 12> numbers(const Pose<T>& X) {
  std::array<T, 12> out;
  for (int j = 0; j < 4; ++j) {
    const Vec3<T>& v = j < 3 ? X.R.col[j] : X.p;
    out[3 * j] = v.x, out[3 * j + 1] = v.y, out[3 * j + 2] = v.z;
  }
  return out;
}

Twist<double> moved(const Twist<double>& V, int k, double h) {
  Twist<double> out = V;
  Vec3<double>& part = k < 3 ? out.angular : out.linear;
  (k % 3 == 0 ? part.x : k % 3 == 1 ? part.y : part.z) += h;
  return out;
}

using Jet = ceres::Jet<double, 6>;

Twist<Jet> jets(const Twist<double>& V) {
  return {{Jet(V.angular.x, 0), Jet(V.angular.y, 1), Jet(V.angular.z, 2)},
          {Jet(V.linear.x, 3), Jet(V.linear.y, 4), Jet(V.linear.z, 5)}};
}

}  // namespace

TEST_CASE("exp of a rotation vector is Eigen's angle and axis", "[lie]") {
  Rng rng(GENERATE(range(0u, 10u)));
  for (const double angle : kAngles) {
    CAPTURE(angle);
    const Vec3<double> axis = random_direction(rng);
    const Eigen::Matrix3d R = to_eigen(exp(axis * angle));
    CHECK_THAT(
        R, MatrixNear(Eigen::AngleAxisd(angle, to_eigen(axis)).toRotationMatrix(), kRoundingTol));
    CHECK_THAT(R, MatrixNear(to_eigen(rotation_about<double>(axis, angle)), kRoundingTol));
  }
}

TEST_CASE("exp of a twist is the matrix exponential", "[lie]") {
  Rng rng(GENERATE(range(0u, 10u)));
  for (const double angle : kAngles) {
    CAPTURE(angle);
    const Twist<double> V = random_twist(rng, angle);
    CHECK_THAT(homogeneous(exp(V)),
               MatrixNear(Eigen::Matrix4d(twist_matrix(V).exp()), kMatrixExponentialTol));
  }
}

TEST_CASE("log is the inverse of exp, up to half a turn", "[lie]") {
  Rng rng(GENERATE(range(0u, 20u)));
  for (const double angle : kAngles) {
    if (angle > kPi) continue;
    CAPTURE(angle);
    const Twist<double> V = random_twist(rng, angle), back = log(exp(V));
    // Close to π a rotation's entries change by (π − θ) times what its axis does.
    CHECK_THAT(to_eigen(back.angular), MatrixNear(to_eigen(V.angular), kRoundingTol));
    CHECK_THAT(to_eigen(back.linear), MatrixNear(to_eigen(V.linear), kRoundingTol));
  }
}

TEST_CASE("log at half a turn is one of the two vectors of that rotation", "[lie]") {
  Rng rng(GENERATE(range(0u, 20u)));
  std::array<Vec3<double>, 4> axes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, random_direction(rng)}};
  for (const Vec3<double>& axis : axes)
    for (const double angle : {kPi, std::nextafter(kPi, 0.0), kPi - 1e-12}) {
      const Vec3<double> w = log(rotation_about<double>(axis, angle));
      CHECK_THAT(std::sqrt(dot(w, w)), WithinRel(angle, 1e-14));
      CHECK_THAT(std::abs(dot(w, axis)), WithinRel(angle, 1e-14));
    }
}

TEST_CASE("log of a pose takes more than half a turn back the shorter way", "[lie]") {
  Rng rng(GENERATE(range(0u, 10u)));
  const Twist<double> V = random_twist(rng, rng.uniform(kPi + 0.01, 2 * kPi));
  const Twist<double> U = log(exp(V));
  CHECK(dot(U.angular, U.angular) <= kPi * kPi);
  CHECK_THAT(homogeneous(exp(U)), MatrixNear(homogeneous(exp(V)), kRoundingTol));
}

TEST_CASE("the adjoint of exp is the exponential of ad", "[lie]") {
  Rng rng(GENERATE(range(0u, 10u)));
  for (const double angle : kAngles) {
    CAPTURE(angle);
    const Twist<double> V = random_twist(rng, angle);
    const Pose<double> X = exp(V);
    const Matrix6 Ad = matrix_of([&](const Twist<double>& U) { return to_parent(X, U); });
    const Matrix6 ad_V = matrix_of([&](const Twist<double>& U) { return ad(V, U); });
    CHECK_THAT(Ad, MatrixNear(Matrix6(ad_V.exp()), kMatrixExponentialTol));
  }
}

TEST_CASE("Jets through exp: the central difference, at 0 too", "[lie]") {
  Rng rng(GENERATE(range(0u, 5u)));
  for (const double angle : {0.0, 1e-9, 0.5, 1.0, 2.5, 6.0}) {
    CAPTURE(angle);
    const Twist<double> V = random_twist(rng, angle);
    const std::array<Jet, 12> X = numbers(exp(jets(V)));
    constexpr double h = 1e-6;
    for (int k = 0; k < 6; ++k) {
      const auto above = numbers(exp(moved(V, k, h))), below = numbers(exp(moved(V, k, -h)));
      for (std::size_t i = 0; i < 12; ++i)
        CHECK_THAT(X[i].v[k], WithinAbs((above[i] - below[i]) / (2 * h), kCentralDifferenceTol));
    }
  }
}

TEST_CASE("Jets through log of exp: the identity, at 0 too", "[lie]") {
  Rng rng(GENERATE(range(0u, 5u)));
  for (const double angle : {0.0, 1e-160, 1e-9, 0.19, 0.21, 0.32, 1.5, 3.0}) {
    CAPTURE(angle);
    const Twist<Jet> V = log(exp(jets(random_twist(rng, angle))));
    const Jet entries[6]{V.angular.x, V.angular.y, V.angular.z, V.linear.x, V.linear.y, V.linear.z};
    for (int i = 0; i < 6; ++i)
      for (int k = 0; k < 6; ++k)
        // sin(θ/2) is flat near π: 1/cos(1.5) = 14 times the rounding.
        CHECK_THAT(entries[i].v[k], WithinAbs(i == k ? 1.0 : 0.0, 1e-12));
  }
}

TEST_CASE("nested duals through exp: second derivatives at 0 are the bracket's", "[lie]") {
  using Along = Dual<double, 1>;
  using Twice = Dual<Along, 1>;
  Rng rng(GENERATE(range(0u, 5u)));
  const Twist<double> V = random_twist(rng, 1.3);
  const Twice t(Along(0.0, 0), 0);
  const Pose<Twice> X = exp(Twist<Twice>{V.angular * t, V.linear * t});
  const Eigen::Matrix4d A = twist_matrix(V), second = A * A;  // d²/dt² exp(A t) at 0
  const auto twice = numbers(X);
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 3; ++i) {
      const Twice& x = twice[static_cast<std::size_t>(3 * j + i)];
      CHECK_THAT(x.a.v[0], WithinAbs(A(i, j), kRoundingTol));
      CHECK_THAT(x.v[0].v[0], WithinAbs(second(i, j), kRoundingTol));
    }
}

}  // namespace exp_test
