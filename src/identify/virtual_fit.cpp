#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/virtual_fit.hpp>
#include <diffnea/model/physical.hpp>

#include "core/decompositions.hpp"
#include "identify/convex_bounds.hpp"
#include "identify/descent.hpp"

namespace diffnea {
namespace {

/// Steps of a descent, and the share of the cost that a last one gains: below a thousandth of χ²/2
/// for a cost of 10⁶.
constexpr int kMostSteps = 2000;
constexpr double kTolerance = 1e-9;

/// Least squares in the virtual parameters φ: x(φ) is θ(φ) of bodies, φ² of non-negative
/// parameters, φ of the others.
class VirtualDescent {
 public:
  explicit VirtualDescent(const ConvexFitProblem& p)
      : p_(p), is_body_(static_cast<std::size_t>(p.start.size()), false), phi_(p.start) {
    std::vector<bool> fixed(is_body_.size(), false), square = fixed;
    for (const int k : p.fixed) fixed[static_cast<std::size_t>(k)] = true;
    for (const int b : p.bodies) {
      const auto held = std::count(fixed.begin() + b, fixed.begin() + b + kThetaSize, true);
      if (held != 0 && held != kThetaSize)
        throw ModelError("virtual parameters of a body: hold all ten or none");
      if (held != 0) continue;
      bodies_.push_back(b);
      std::fill_n(is_body_.begin() + b, kThetaSize, true);
      Theta<double> theta;
      std::copy_n(p.start.data() + b, kThetaSize, theta.begin());
      const Theta<double> phi = virtual_from_theta(theta);
      std::copy(phi.begin(), phi.end(), phi_.data() + b);
    }
    for (const int k : p.nonnegative)
      if (!fixed[static_cast<std::size_t>(k)] && !is_body_[static_cast<std::size_t>(k)]) {
        squares_.push_back(k);
        phi_[k] = std::sqrt(p.start[k]);
      }
    for (int k = 0; k < p.start.size(); ++k)
      if (!fixed[static_cast<std::size_t>(k)]) free_.push_back(k);
    if (p.prior_information.size() > 0) {
      const Eigen::SelfAdjointEigenSolver<MatX<double>> of(p.prior_information);
      weak_ =
          of.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * of.eigenvectors().transpose();
    }
  }

  /// Parameters at the present point.
  VecX<double> x() const { return x_at(phi_); }

  // Steps, for descend().
  double cost() const { return cost_at(phi_); }
  void linearise();
  double attempt(double damping);
  void accept() { phi_ = tried_; }
  void refuse() {}
  bool stopped() const { return false; }
  bool settled() const { return true; }
  void reweigh() {}

 private:
  VecX<double> x_at(const VecX<double>& phi) const;
  VecX<double> residual(const VecX<double>& x) const {
    VecX<double> out(p_.R.rows() + weak_.rows());
    out.head(p_.R.rows()) = p_.R * x - p_.d;
    if (weak_.rows() > 0) out.tail(weak_.rows()) = weak_ * (x - p_.start);
    return out;
  }
  double cost_at(const VecX<double>& phi) const { return 0.5 * residual(x_at(phi)).squaredNorm(); }
  Theta<double> of_body(const VecX<double>& phi, int body) const {
    Theta<double> out;
    std::copy_n(phi.data() + body, kThetaSize, out.begin());
    return out;
  }

  const ConvexFitProblem& p_;
  std::vector<bool> is_body_;
  std::vector<int> bodies_, squares_, free_;
  VecX<double> phi_, tried_, r_;
  MatX<double> weak_, J_;  ///< root of Λ; ∂r/∂φ, (rows, free)
};

VecX<double> VirtualDescent::x_at(const VecX<double>& phi) const {
  VecX<double> out = phi;
  for (const int b : bodies_) {
    const Theta<double> theta = theta_from_virtual(of_body(phi, b));
    std::copy(theta.begin(), theta.end(), out.data() + b);
  }
  for (const int k : squares_) out[k] = phi[k] * phi[k];
  return out;
}

void VirtualDescent::linearise() {
  const long p = phi_.size();
  MatX<double> slopes = MatX<double>::Identity(p, p);  // ∂x/∂φ
  for (const int b : bodies_)
    slopes.block(b, b, kThetaSize, kThetaSize) =
        theta_with_jacobian(InertiaCoordinates::kVirtual, of_body(phi_, b)).jacobian;
  for (const int k : squares_) slopes(k, k) = 2.0 * phi_[k];
  const MatX<double> of_free = slopes(Eigen::all, free_);
  J_.resize(p_.R.rows() + weak_.rows(), of_free.cols());
  J_.topRows(p_.R.rows()) = p_.R * of_free;
  if (weak_.rows() > 0) J_.bottomRows(weak_.rows()) = weak_ * of_free;
  r_ = residual(x_at(phi_));
}

double VirtualDescent::attempt(double damping) {
  // A virtual parameter that nothing depends on, like the angles of a ball, stays where it is.
  VecX<double> size = J_.colwise().norm().transpose();
  const double least = 1e-9 * std::max(size.maxCoeff(), 1e-300);
  MatX<double> A = MatX<double>::Zero(J_.rows() + J_.cols(), J_.cols());
  A.topRows(J_.rows()) = J_;
  A.bottomRows(J_.cols()).diagonal() = std::sqrt(damping) * size.cwiseMax(least);
  VecX<double> b = VecX<double>::Zero(A.rows());
  b.head(J_.rows()) = -r_;
  const VecX<double> step = Eigen::HouseholderQR<MatX<double>>(A).solve(b);
  tried_ = phi_;
  for (std::size_t k = 0; k < free_.size(); ++k) tried_[free_[k]] += step[static_cast<long>(k)];
  return cost_at(tried_);
}

}  // namespace

ConvexFitResult solve_virtual_fit(const ConvexFitProblem& problem) {
  check_convex_problem(problem);
  if (problem.entropic_prior > 0.0)
    throw ModelError(
        "virtual parameters: the entropic prior is no sum of squares; fit convex parameters, or "
        "leave the prior out");
  VirtualDescent descent(problem);
  ConvexFitResult result;
  const DescentEnd end = descend(descent, {kMostSteps, kTolerance}, result.iterations);
  result.converged = end == DescentEnd::kConverged || end == DescentEnd::kNoStep;
  result.x = descent.x();
  describe_optimum(problem, result);
  return result;
}

}  // namespace diffnea
