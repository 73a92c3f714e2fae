#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/identify/virtual_fit.hpp>
#include <diffnea/model/physical.hpp>

#include "core/decompositions.hpp"
#include "identify/base_parameters.hpp"
#include "identify/stacked_factors.hpp"

namespace diffnea {
namespace {

/// tr(H⁻¹ B) / f: how much larger the score's covariance is than independent residuals make it.
double mean_ratio(const MatX<double>& B, const MatX<double>& H) {
  const VecX<double> s = H.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  MatX<double> scaled = s.asDiagonal() * H * s.asDiagonal();
  scaled.diagonal().array() += 1e-8;  // dependent columns must not blow up
  const MatX<double> b = s.asDiagonal() * B * s.asDiagonal();
  return Eigen::LDLT<MatX<double>>(scaled).solve(b).trace() / static_cast<double>(B.rows());
}

/// Which parameters the data determine by themselves, not in combinations with other free ones
/// alone: of the others, what the error bar says is the weak prior's.
std::vector<bool> seen_alone(const FitLayout& layout, const LinearFit& fit) {
  std::vector<bool> out(static_cast<std::size_t>(fit.x.size()), true);
  const auto is_free = [&](int c) { return !layout.linear[static_cast<std::size_t>(c)].fixed; };
  for (const BaseParameter& b : fit.base_parameters)
    if (std::any_of(b.columns.begin() + 1, b.columns.end(), is_free))
      for (const int c : b.columns) out[static_cast<std::size_t>(c)] = false;
  return out;
}

/// @throws ModelError naming the link if some but not all of its inertia is held
void require_whole(const FitLayout& layout, int b) {
  const auto first = layout.linear.begin() + b;
  const auto held = std::count_if(first, first + kThetaSize, [](const auto& p) { return p.fixed; });
  if (held == 0 || held == kThetaSize) return;
  throw ModelError(first->name.substr(0, first->name.rfind('.')) + ": " + std::to_string(held) +
                   " of its ten inertial parameters are held, and each virtual parameter moves "
                   "several of them; hold all ten (--fix \"" +
                   first->name.substr(0, first->name.rfind('.')) +
                   ".*\") or none, or fit convex parameters");
}

/// Held values that no body has would leave the barrier nothing to start from.
void require_consistent(const FitLayout& layout, int b, const VecX<double>& x) {
  Theta<double> t;
  std::copy_n(x.data() + b, kThetaSize, t.begin());
  const auto held = [&](int k) { return layout.linear[static_cast<std::size_t>(b + k)].fixed; };
  int fixed = 0;
  for (int k = 0; k < kThetaSize; ++k) fixed += held(k) ? 1 : 0;
  if (fixed == 0 || fixed == kThetaSize || smallest_pseudo_inertia_eigenvalue(t) > 0.0) return;
  const std::string& name = layout.linear[static_cast<std::size_t>(b)].name;
  throw ModelError("fix: no body has the values that are held of " +
                   name.substr(0, name.rfind('.')) +
                   "; hold a mass above 0, a center of mass, or all ten of its parameters");
}

/// By how much all parameters together are off: what measured torques say of s in s·x. A file's
/// masses may be those of another material, and of passive joints every multiple fits.
double torque_scale_of(const std::vector<JointFactor>& factors, const VecX<double>& sigma,
                       const VecX<double>& x) {
  double product = 0.0, square = 0.0;
  for (std::size_t j = 0; j < factors.size(); ++j) {
    const JointFactor& f = factors[j];
    if (f.factor.rows() == 0 || f.inertia.size() > 0) continue;
    const VecX<double> predicted = f.factor.R() * x(f.columns);
    const double weight = 1.0 / std::pow(sigma[static_cast<long>(j)], 2);
    product += weight * predicted.dot(f.factor.d());
    square += weight * predicted.squaredNorm();
  }
  return product > 0.0 ? product / square : 1.0;
}

/// Noise of a joint's rows, at the least [N·m or N]: what is left where all parameters serve this
/// joint alone. From there on weights only fall as far as the other joints ask. From the size of
/// its torque, rows that are noise on both sides (a drone's lateral force) would outweigh its
/// weight at first, and pull the mass to zero for good.
double least_noise(const FitLayout& layout, const JointFactor& f, const VecX<double>& x) {
  const double size = torque_size(layout, f, x);
  const long spare = f.factor.rows() - static_cast<long>(f.columns.size());
  if (f.inertia.size() > 0 || spare <= 0) return std::max(size, 1e-12);
  const double left = f.factor.residual_sum_of_squares() / static_cast<double>(spare);
  return std::max(std::sqrt(left), 1e-9 * size + 1e-15);
}

}  // namespace

LinearFit fit_linear(const FitLayout& layout, const std::vector<JointFactor>& factors,
                     const LinearFitOptions& options) {
  const long p = static_cast<long>(layout.linear.size());
  const long n = static_cast<long>(factors.size());
  const std::vector<int> free = free_columns(layout);
  long rows = 0;
  for (const JointFactor& f : factors) rows += f.factor.rows();
  if (rows == 0)
    throw DataError(
        "identify: no torque sample is left after filtering: no joint with a torque moves, or no "
        "stretch is long enough for the filter; record a motion, e.g. one of `diffnea excite` "
        "(`diffnea audit` looks at clock and channels)");
  if (free.empty())
    throw ModelError(
        "identify: every parameter is held, nothing is left to fit; groups of fit: inertia, "
        "armature, effects");
  if (rows < static_cast<long>(free.size()))
    throw DataError("identify: " + std::to_string(rows) + " torque samples after filtering for " +
                    std::to_string(free.size()) +
                    " parameters; record longer, raise the decimation rate, or fix parameters");

  const VecX<double> scale = parameter_scales(layout, factors);
  ConvexFitProblem problem;
  problem.start = consistent_start(layout, scale);
  if (options.physical) problem.bodies = layout.bodies();
  for (long k = 0; k < p; ++k)
    if (layout.linear[k].sign != Sign::kFree) problem.nonnegative.push_back(static_cast<int>(k));
  for (long k = 0; k < p; ++k)
    if (layout.linear[k].fixed) {
      problem.fixed.push_back(static_cast<int>(k));
      problem.start[k] = layout.linear[k].prior;
    }
  for (const int b : problem.bodies) require_consistent(layout, b, problem.start);
  if (options.parameters == FitParameters::kVirtual)
    for (const int b : problem.bodies) require_whole(layout, b);
  problem.entropic_prior = options.entropic_prior;
  VecX<double> weak = VecX<double>::Zero(p);
  for (const int k : free) weak[k] = 1.0 / std::pow(options.prior_width * scale[k], 2);
  problem.prior_information = weak.asDiagonal();

  // Noise of each joint: weights and parameters in turn, from the factors alone.
  LinearFit fit;
  fit.sigma = VecX<double>::Ones(n);
  for (long j = 0; j < n; ++j)
    if (factors[j].factor.rows() > 0) fit.sigma[j] = least_noise(layout, factors[j], problem.start);
  const bool has_torque = std::ranges::any_of(
      factors, [&](const JointFactor& f) { return f.rmse(VecX<double>::Zero(p)) > 0.0; });
  VecX<double> at = torque_scale_of(factors, fit.sigma, problem.start) * problem.start;
  for (int round = 0; round < options.max_reweightings; ++round) {
    StackedFactors rows_of_all = stacked(factors, fit.sigma, p, has_torque ? &at : nullptr);
    problem.R = std::move(rows_of_all.R);
    problem.d = std::move(rows_of_all.d);
    fit.solver = options.parameters == FitParameters::kVirtual ? solve_virtual_fit(problem)
                                                               : solve_convex_fit(problem);
    fit.x = fit.solver.x;
    double change = 0.0;
    for (long j = 0; j < n; ++j) {
      const JointFactor& f = factors[j];
      if (f.factor.rows() == 0) continue;
      // Every joint pays for the parameters by its share of the rows.
      const double dof =
          static_cast<double>(f.factor.rows()) *
          std::max(1.0 - static_cast<double>(free.size()) / static_cast<double>(rows), 0.1);
      const double size = torque_size(layout, f, problem.start);
      const double next = std::max(std::sqrt(f.sum_of_squares(fit.x) / dof), 1e-9 * size + 1e-15);
      change = std::max(change, std::abs(next / fit.sigma[j] - 1.0));
      fit.sigma[j] = next;
      if (f.inertia.size() == 0) continue;
      const double now = f.inertia.dot(fit.x(f.columns)), before = f.inertia.dot(at(f.columns));
      change = std::max(change, std::abs(now / before - 1.0));
    }
    at = fit.x;
    if (change < 1e-3) break;
  }

  fit.scale = scale;
  fit.weak = weak;
  const MatX<double> R = stacked(factors, fit.sigma, p, has_torque ? &at : nullptr).R;
  fit.information = R.transpose() * R;
  fit.base_parameters = base_parameters(layout, R, fit.x, scale);
  fit.rank = static_cast<int>(fit.base_parameters.size());
  use_sandwich(layout, fit.information, fit);
  return fit;
}

void use_sandwich(const FitLayout& layout, const MatX<double>& meat, LinearFit& fit) {
  require_size("use_sandwich: meat", meat.rows(), fit.x.size(), "parameter");
  const std::vector<int> free = free_columns(layout);
  const long p = fit.x.size(), f = static_cast<long>(free.size());
  MatX<double> H = fit.information(free, free), B = meat(free, free);
  const double ratio = std::max(1.0, B.trace() > 0.0 && H.trace() > 0.0 ? mean_ratio(B, H) : 1.0);
  H.diagonal() += fit.weak(free);
  B.diagonal() += fit.weak(free);
  const VecX<double> s = H.diagonal().cwiseSqrt().cwiseInverse();
  const MatX<double> inverse =
      s.asDiagonal() *
      Eigen::LDLT<MatX<double>>(MatX<double>(s.asDiagonal() * H * s.asDiagonal()))
          .solve(MatX<double>(MatX<double>::Identity(f, f))) *
      s.asDiagonal();
  MatX<double> covariance = MatX<double>::Zero(p, p), independent = covariance;
  covariance(free, free) = inverse * B * inverse;
  independent(free, free) = inverse;
  fit.std = VecX<double>::Zero(p);
  fit.identifiable.assign(static_cast<std::size_t>(p), false);
  const std::vector<bool> alone = seen_alone(layout, fit);
  for (const int c : free) {
    const double std = std::sqrt(std::max(covariance(c, c), independent(c, c)));
    const bool known = alone[static_cast<std::size_t>(c)] && std < fit.scale[c];
    fit.identifiable[static_cast<std::size_t>(c)] = known;
    fit.std[c] = known ? std : std::numeric_limits<double>::quiet_NaN();
  }
  for (BaseParameter& b : fit.base_parameters) {
    VecX<double> c = VecX<double>::Zero(p);
    for (std::size_t k = 0; k < b.columns.size(); ++k) c[b.columns[k]] = b.coefficients[k];
    b.std = std::sqrt(std::max(c.dot(covariance * c), c.dot(independent * c)));
  }
  fit.information /= ratio;
}

}  // namespace diffnea
