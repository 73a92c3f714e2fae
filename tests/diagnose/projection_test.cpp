/// The base projected out, against least squares of its own kind.

#include "diagnose/projection.hpp"

#include <support/swinging.hpp>

#include <Eigen/SVD>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

namespace projection_test {

using namespace diffnea;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

/// Double precision through a QR of some thousand rows; 1e-13 observed on vectors of norm 1.
constexpr double kRounding = 1e-10;

/// All base parameters free, or none; noise of an autoregression, so that whitening shows.
struct Setting {
  explicit Setting(bool free = true, double pull = 1e-3)
      : evidence(40.0, false, 1, "viscous_friction", test::slow_down),
        whitener(*evidence, std::vector<JointNoise>(2, {{{{}, 0.35}, {{0.5}, 0.3}}, 0.35}), {}) {
    const long p = evidence->base().cols();
    prior.x0 = VecX<double>::LinSpaced(p, -0.5, 0.5);
    if (free)
      for (int k = 0; k < p; ++k) prior.free.push_back(k);
    prior.root = pull * MatX<double>::Identity(free ? p : 0, free ? p : 0);
  }
  MatX<double> random(long columns) const {
    Rng rng(7);
    MatX<double> out(evidence->rows(), columns);
    for (double& x : out.reshaped()) x = rng.normal();
    return out;
  }
  /// [W X; L] @param base  X
  MatX<double> stacked(const MatX<double>& base) const {
    MatX<double> out(evidence->rows() + prior.root.rows(), base.cols());
    out << whitener(base), prior.root;
    return out;
  }

  test::SwingingEvidence evidence;
  Whitener whitener;
  BasePrior prior;
};

}  // namespace

TEST_CASE("Projection: columns are orthogonal to the base", "[diagnose]") {
  const Setting s;
  const Projection projection(*s.evidence, s.whitener, s.prior);
  const MatX<double> columns = projection.project(s.random(4));
  const MatX<double> base = s.stacked(s.evidence->seen_base()).colwise().normalized();
  CHECK((base.transpose() * columns.colwise().normalized()).cwiseAbs().maxCoeff() < kRounding);
  CHECK((base.transpose() * projection.residual().normalized()).cwiseAbs().maxCoeff() < kRounding);
}

TEST_CASE("Projection: products need no columns written out", "[diagnose]") {
  const Setting s;
  const Projection projection(*s.evidence, s.whitener, s.prior);
  const long m = s.evidence->times();
  MatX<double> a = s.random(3), b = s.random(2);
  a.topRows(m).setZero();  // reaches the second joint alone
  const Beside of_a = projection.beside(a), of_b = projection.beside(b);
  CHECK(of_a.joints == std::vector<long>{1});
  CHECK(of_a.whitened.rows() == m);
  const MatX<double> A = projection.expanded(of_a), B = projection.expanded(of_b);
  const double size = A.norm() * B.norm();
  CHECK((product(of_a, of_b) - A.transpose() * B).cwiseAbs().maxCoeff() < kRounding * size);
  CHECK((projection.with_residual(of_a) - A.transpose() * projection.residual())
            .cwiseAbs()
            .maxCoeff() < kRounding * A.norm() * projection.residual().norm());
  const VecX<double> weights = VecX<double>::LinSpaced(3, -1.0, 2.0);
  CHECK((projection.expanded(combined(of_a, weights)) - A * weights).norm() <
        kRounding * A.norm() * weights.norm());
  // Least squares of one column by the others.
  const VecX<double> y = B.col(0), x = A.colPivHouseholderQr().solve(y);
  CHECK_THAT(left_beside(product(of_a, of_a), product(of_a, of_b).col(0), y.squaredNorm()),
             WithinRel((y - A * x).squaredNorm(), 1e-8));
}

TEST_CASE("Projection: of a column of the base only the prior's pull is left", "[diagnose]") {
  const Setting s(true, 1e-6);
  const Projection projection(*s.evidence, s.whitener, s.prior);
  const MatX<double> white = s.whitener(s.evidence->seen_base());
  const MatX<double> left = projection.project(s.evidence->seen_base());
  for (long k = 0; k < left.cols(); ++k) {
    CAPTURE(k);
    // ‖(I − QQᵀ)[a; 0]‖ ≤ ‖[0; L_k]‖ = 1e-6.
    CHECK(left.col(k).norm() <= 1e-6 + kRounding * white.col(k).norm());
  }
}

TEST_CASE("Projection: its residual is that of least squares, at either motion", "[diagnose]") {
  const Setting s;
  const Projection projection(*s.evidence, s.whitener, s.prior);
  VecX<double> y = VecX<double>::Zero(s.evidence->rows() + s.prior.root.rows());
  y.head(s.evidence->rows()) = s.whitener(s.evidence->torque() - s.evidence->base() * s.prior.x0);
  const double size = y.norm();
  for (const MatX<double>* base : {&s.evidence->base(), &s.evidence->seen_base()}) {
    const MatX<double> A = s.stacked(*base);
    const VecX<double> scale = A.colwise().norm().cwiseInverse();
    const MatX<double> scaled = A * scale.asDiagonal();
    y -= scaled * scaled.bdcSvd(Eigen::ComputeThinU | Eigen::ComputeThinV)
                      .setThreshold(1e-10)
                      .solve(y)
                      .eval();
  }
  CHECK((projection.residual() - y).norm() < 1e-8 * size);
}

TEST_CASE("Projection: parameters() recovers what made the torque", "[diagnose]") {
  const Setting s(true, 1e-6);
  const Projection projection(*s.evidence, s.whitener, s.prior);
  VecX<double> truth = s.prior.x0;
  Rng rng(11);
  for (double& x : truth) x += rng.normal();
  // Effects that leave the torque of `truth`.
  const VecX<double> effects = s.evidence->torque() - s.evidence->base() * truth;
  const VecX<double> found = projection.parameters(effects);
  const VecX<double> torque = s.evidence->base() * truth;
  // Some directions of the links' parameters have no torque: those of the torque are compared. The
  // prior pulls with 1e-6 against columns of norm 1 and more.
  CHECK((s.evidence->base() * found - torque).norm() < 1e-6 * torque.norm());
}

TEST_CASE("Projection: a base that is held takes nothing", "[diagnose]") {
  const Setting s(false);
  const Projection projection(*s.evidence, s.whitener, s.prior);
  const MatX<double> columns = s.random(2);
  CHECK(projection.rank() == 0);
  CHECK(projection.project(columns) == s.whitener(columns));
  CHECK(projection.parameters(VecX<double>::Zero(s.evidence->rows())) == s.prior.x0);
}

}  // namespace projection_test
