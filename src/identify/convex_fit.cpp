#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/convex_fit.hpp>
#include <diffnea/model/physical.hpp>

#include "core/decompositions.hpp"
#include "identify/convex_bounds.hpp"

namespace diffnea {
namespace {

using Matrix4 = Eigen::Matrix4d;

/// Π is linear in θ: Π = Σ θ_k E_k.
const std::array<Matrix4, kThetaSize>& pseudo_inertia_basis() {
  static const std::array<Matrix4, kThetaSize> basis = [] {
    std::array<Matrix4, kThetaSize> out;
    for (int k = 0; k < kThetaSize; ++k) {
      Theta<double> unit{};
      unit[k] = 1.0;
      out[k] = pseudo_inertia(unit);
    }
    return out;
  }();
  return basis;
}

Matrix4 pseudo_inertia_at(const VecX<double>& x, int body) {
  Theta<double> t;
  std::copy_n(x.data() + body, kThetaSize, t.begin());
  return pseudo_inertia(t);
}

/// log det of a positive definite matrix; −∞ if it is not.
double log_det(const Matrix4& m) {
  const Eigen::LLT<Matrix4> llt(m);
  if (llt.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
  const Eigen::Vector4d diagonal = Matrix4(llt.matrixL()).diagonal();
  return diagonal.minCoeff() > 0.0 ? 2.0 * diagonal.array().log().sum()
                                   : -std::numeric_limits<double>::infinity();
}

/// The barrier objective and its Newton step, over the parameters that are free.
class Barrier {
 public:
  explicit Barrier(const ConvexFitProblem& p) : p_(p) {
    std::vector<bool> is_fixed(p.start.size(), false);
    for (const int k : p.fixed) is_fixed[k] = true;
    for (int k = 0; k < p.start.size(); ++k)
      if (!is_fixed[k]) free_.push_back(k);
    const auto all_fixed = [&](int first, int count) {
      return std::all_of(is_fixed.begin() + first, is_fixed.begin() + first + count,
                         [](bool f) { return f; });
    };
    for (int b = 0; b < static_cast<int>(p.bodies.size()); ++b)
      if (!all_fixed(p.bodies[b], kThetaSize)) bodies_.push_back(b);
    for (const int k : p.nonnegative)
      if (!is_fixed[k]) bounds_.push_back(k);
    H_data_ = p.R.transpose() * p.R;
    if (p.prior_information.size() > 0) H_data_ += p.prior_information;
    for (const int b : bodies_)
      prior_inverse_.push_back(pseudo_inertia_at(p.start, p.bodies[b]).inverse());
  }

  const std::vector<int>& free() const { return free_; }
  const std::vector<int>& bodies() const { return bodies_; }
  const std::vector<int>& bounds() const { return bounds_; }
  int num_terms() const {
    return 4 * static_cast<int>(bodies_.size()) + static_cast<int>(bounds_.size());
  }

  /// +∞ outside the cone.
  double value(const VecX<double>& x, double mu) const {
    double f = 0.5 * (p_.R * x - p_.d).squaredNorm();
    if (p_.prior_information.size() > 0) {
      const VecX<double> e = x - p_.start;
      f += 0.5 * e.dot(p_.prior_information * e);
    }
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const Matrix4 Pi = pseudo_inertia_at(x, p_.bodies[bodies_[i]]);
      f -= (mu + p_.entropic_prior) * log_det(Pi);
      if (p_.entropic_prior > 0.0) f += p_.entropic_prior * (prior_inverse_[i] * Pi).trace();
    }
    for (const int k : bounds_) {
      if (!(x[k] > 0.0)) return std::numeric_limits<double>::infinity();
      f -= mu * std::log(x[k]);
    }
    return f;
  }

  /// Newton direction over all parameters (zero where fixed); returns the decrement λ²/2.
  double step(const VecX<double>& x, double mu, VecX<double>& direction) const {
    VecX<double> g = p_.R.transpose() * (p_.R * x - p_.d);
    MatX<double> H = H_data_;
    if (p_.prior_information.size() > 0) g += p_.prior_information * (x - p_.start);
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      const int at = p_.bodies[bodies_[i]];
      const double weight = mu + p_.entropic_prior;
      const Matrix4 inverse = pseudo_inertia_at(x, at).inverse();
      std::array<Matrix4, kThetaSize> A;  // Π⁻¹ E_k
      for (int k = 0; k < kThetaSize; ++k) {
        A[k] = inverse * pseudo_inertia_basis()[k];
        g[at + k] -= weight * A[k].trace();
        if (p_.entropic_prior > 0.0)
          g[at + k] += p_.entropic_prior * (prior_inverse_[i] * pseudo_inertia_basis()[k]).trace();
      }
      for (int k = 0; k < kThetaSize; ++k)
        for (int l = 0; l <= k; ++l) {
          const double h = weight * A[k].cwiseProduct(A[l].transpose()).sum();
          H(at + k, at + l) += h;
          if (l != k) H(at + l, at + k) += h;
        }
    }
    for (const int k : bounds_) {
      g[k] -= mu / x[k];
      H(k, k) += mu / (x[k] * x[k]);
    }
    // Jacobi scaling: masses and second moments differ by orders of magnitude.
    const MatX<double> Hf = H(free_, free_);
    const VecX<double> scale = Hf.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatX<double> Hs = scale.asDiagonal() * Hf * scale.asDiagonal();
    const VecX<double> gf = g(free_);
    const Eigen::LDLT<MatX<double>> ldlt(Hs);
    const VecX<double> df = -(scale.asDiagonal() * ldlt.solve(scale.asDiagonal() * gf)).eval();
    direction.setZero(x.size());
    for (std::size_t i = 0; i < free_.size(); ++i) direction[free_[i]] = df[i];
    return -0.5 * gf.dot(df);
  }

 private:
  const ConvexFitProblem& p_;
  std::vector<int> free_, bodies_, bounds_;
  std::vector<Matrix4> prior_inverse_;
  MatX<double> H_data_;
};

/// ½‖Rx − d‖² of plain least squares over the free parameters.
double unconstrained_objective(const ConvexFitProblem& p, const std::vector<int>& free) {
  VecX<double> d = p.d;
  VecX<double> held = p.start;
  for (const int k : free) held[k] = 0.0;
  d -= p.R * held;
  const MatX<double> R = p.R(Eigen::all, free);
  const VecX<double> scale = R.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const MatX<double> Rs = R * scale.asDiagonal();
  Eigen::ColPivHouseholderQR<MatX<double>> qr(Rs);
  qr.setThreshold(1e-10);
  return 0.5 * (Rs * qr.solve(d) - d).squaredNorm();
}

}  // namespace

void check_convex_problem(const ConvexFitProblem& p) {
  const long n = p.start.size();
  require_size("convex fit: columns of R", p.R.cols(), n, "parameter");
  require_size("convex fit: d", p.d.size(), p.R.rows(), "row of R");
  if (p.prior_information.size() > 0) {
    require_size("convex fit: rows of prior_information", p.prior_information.rows(), n,
                 "parameter");
    require_size("convex fit: columns of prior_information", p.prior_information.cols(), n,
                 "parameter");
  }
  const auto is_fixed = [&](int k) {
    return std::find(p.fixed.begin(), p.fixed.end(), k) != p.fixed.end();
  };
  const auto held = [&](int body) {  // nothing of it moves: it may be what it is
    for (int k = body; k < body + kThetaSize; ++k)
      if (!is_fixed(k)) return false;
    return true;
  };
  for (std::size_t b = 0; b < p.bodies.size(); ++b)
    if (!held(p.bodies[b]) && !std::isfinite(log_det(pseudo_inertia_at(p.start, p.bodies[b]))))
      throw ModelError("convex fit: body " + std::to_string(b) +
                       " of the start is not strictly physically consistent (its pseudo-inertia is "
                       "not positive definite)");
  for (const int k : p.nonnegative)
    if (!(p.start[k] > 0.0) && !is_fixed(k))
      throw ModelError("convex fit: parameter " + std::to_string(k) + " starts at " +
                       std::to_string(p.start[k]) + ", expected > 0");
}

void describe_optimum(const ConvexFitProblem& problem, ConvexFitResult& result) {
  const Barrier barrier(problem);
  const VecX<double>& x = result.x;
  result.objective = 0.5 * (problem.R * x - problem.d).squaredNorm();
  result.consistency_cost =
      std::max(0.0, result.objective - unconstrained_objective(problem, barrier.free()));
  // At the boundary an eigenvalue is μ/z with a multiplier z that the data press with; inside, it
  // is of the order of the body itself.
  constexpr double kBoundary = 1e-4;
  for (const int b : barrier.bodies()) {
    const Matrix4 Pi = pseudo_inertia_at(x, problem.bodies[b]);
    const Matrix4 Pi0 = pseudo_inertia_at(problem.start, problem.bodies[b]);
    const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix4> relative(Pi, Pi0,
                                                                     Eigen::EigenvaluesOnly);
    if (relative.eigenvalues()[0] < kBoundary) result.active_bodies.push_back(b);
  }
  for (const int k : barrier.bounds()) {
    const double data_scale = 1.0 / std::max(problem.R.col(k).norm(), 1e-300);  // σ of x_k alone
    if (x[k] < 0.1 * data_scale || x[k] < kBoundary * problem.start[k])
      result.active_nonnegative.push_back(k);
  }
}

ConvexFitResult solve_convex_fit(const ConvexFitProblem& problem, const ConvexFitOptions& options) {
  check_convex_problem(problem);
  const Barrier barrier(problem);
  ConvexFitResult result;
  VecX<double> x = problem.start;
  if (barrier.free().empty()) {
    result.x = x;
    result.objective = 0.5 * (problem.R * x - problem.d).squaredNorm();
    result.converged = true;
    return result;
  }
  // The barrier starts where it weighs as much as the misfit of the start, and falls tenfold a
  // stage.
  const int terms = std::max(barrier.num_terms(), 1);
  double mu = std::max(barrier.value(x, 0.0) / terms, 10.0 * options.final_barrier);
  VecX<double> direction;
  for (bool last = false; !last && result.iterations < options.max_iterations;) {
    mu *= 0.1;
    if (mu <= options.final_barrier) {
      mu = options.final_barrier;
      last = true;
    }
    // The inner tolerance keeps the iterate within a small part of the barrier's own gap μ·terms.
    const double tolerance = 1e-3 * mu;
    while (result.iterations < options.max_iterations) {
      const double decrement = barrier.step(x, mu, direction);
      ++result.iterations;
      const double f = barrier.value(x, mu);
      if (!(decrement > tolerance) || !(decrement > 1e-14 * std::abs(f))) {
        if (last) result.converged = true;
        break;
      }
      double t = 1.0;
      VecX<double> next = x + t * direction;
      double f_next = barrier.value(next, mu);
      // Armijo, and stay inside; a step that promises less than f is rounded to shows nothing.
      const double rounding = std::numeric_limits<double>::epsilon() * std::abs(f);
      const auto worth_trying = [&] { return t > 1e-12 && t * decrement > rounding; };
      while (!(f_next <= f - 0.2 * t * decrement) && worth_trying()) {
        t *= 0.5;
        next = x + t * direction;
        f_next = barrier.value(next, mu);
      }
      if (!worth_trying()) {  // rounding: no lower point along a descent direction
        if (last) result.converged = decrement < 1e-9 * std::abs(f) + options.final_barrier;
        break;
      }
      x = next;
    }
  }
  result.x = x;
  describe_optimum(problem, result);
  return result;
}

}  // namespace diffnea
