/// Steps of a fit to simulated windows.

#include <algorithm>
#include <cmath>

#include "core/constants.hpp"
#include "identify/motion_fit.hpp"

namespace diffnea {
namespace {

/// Scale of a shape: ten times that, by the weak prior, is an e-fold, or 1 rad or m.
constexpr double kShapeScale = 0.1;

}  // namespace

double MotionFitter::coordinate(long column, const VecX<double>& x,
                                const VecX<double>& shape) const {
  const long p = x.size();
  if (column < p) return x[column];
  const bool logarithmic = problem_.layout.shape[static_cast<std::size_t>(column - p)].logarithmic;
  return logarithmic ? std::log(shape[column - p]) : shape[column - p];
}

double MotionFitter::scale_of(long column) const {
  return column < problem_.scale.size() ? problem_.scale[column] : kShapeScale;
}

/// Gain of the parameters in an undamped step by the linearised windows [χ²/2]. States take theirs
/// at every step, or are at a jump and promise it in vain.
double MotionFitter::promise(const std::vector<ReducedWindow>& reduced,
                             const VecX<double>& d) const {
  const long f = static_cast<long>(free_.size());
  const VecX<double> dx = step(d, 0.0).change;
  double out = 0.0;
  for (const ReducedWindow& r : reduced) {
    if (!r.finite) continue;
    const VecX<double> left = r.rows.col(f) + r.rows.leftCols(f) * dx;
    out += 0.5 * (r.rows.col(f).squaredNorm() - left.squaredNorm());
  }
  return out;
}

/// Root mean square of the residuals in units of the noise; 1 where they are less.
double MotionFitter::misfit() const {
  return std::sqrt(
      std::max(2.0 * now_.objective / static_cast<double>(std::max(now_.samples, 1L)), 1.0));
}

/// Square root of the weak prior's information on a column. A parameter that the data do not tell
/// stays where the fit began; they tell it no better than the model describes them. Residuals that
/// hang together tell sizes as few times: such a model may ask for a drive without end.
double MotionFitter::weak(long column) const {
  return (column < problem_.scale.size() ? blur_ : misfit()) / (10.0 * scale_of(column));
}

/// Curvature of the objective along a column, which damping is a multiple of.
double MotionFitter::curvature(long column) const {
  return now_.R.col(column).squaredNorm() + std::pow(0.1 / scale_of(column), 2);
}

/// Levenberg–Marquardt step as a convex fit: consistency exact, damping and prior as Gaussians.
MotionFitter::Step MotionFitter::step(const VecX<double>& d, double damping) const {
  constexpr double kLongest = 0.7;  // step of a shape: a factor of two, or 0.7 rad or m
  constexpr double kInside =
      0.01;  // share of a scale: where the search for a step begins, off the bound
  const FitLayout& layout = problem_.layout;
  const long p = static_cast<long>(layout.linear.size());
  const long columns = p + static_cast<long>(layout.shape.size()), f = now_.R.rows();
  ConvexFitProblem problem;
  problem.R = MatX<double>::Zero(f + columns, columns);
  problem.d = VecX<double>::Zero(f + columns);
  problem.R.topRows(f) = now_.R;
  problem.d.head(f) = d;
  problem.start.resize(columns);
  for (long c = 0; c < columns; ++c) problem.start[c] = coordinate(c, now_.x, now_.shape);
  problem.bodies = layout.bodies();
  problem.prior_information = MatX<double>::Zero(columns, columns);
  const auto nonnegative = [&](long c) {  // a logarithm is free
    if (c < p) return layout.linear[static_cast<std::size_t>(c)].sign != Sign::kFree;
    const FitParameter& def = layout.shape[static_cast<std::size_t>(c - p)];
    return def.sign != Sign::kFree && !def.logarithmic;
  };
  std::vector<char> is_free(static_cast<std::size_t>(columns), 0);
  for (const int c : free_) {
    is_free[static_cast<std::size_t>(c)] = 1;
    problem.R(f + c, c) = weak(c);
    problem.d[f + c] = weak(c) * coordinate(c, start_, start_shape_);
  }
  for (long c = 0; c < columns; ++c) {
    problem.prior_information(c, c) = damping * curvature(c);
    if (is_free[static_cast<std::size_t>(c)] == 0)
      problem.fixed.push_back(static_cast<int>(c));
    else if (nonnegative(c))
      problem.nonnegative.push_back(static_cast<int>(c));
    if (is_free[static_cast<std::size_t>(c)] != 0 && nonnegative(c) && !(problem.start[c] > 0.0))
      problem.start[c] = kInside * scale_of(c);
  }
  const auto within = [&](long c, double value) {
    if (c < p || is_free[static_cast<std::size_t>(c)] == 0) return value;
    const FitParameter& def = layout.shape[static_cast<std::size_t>(c - p)];
    double most = kInfinity;
    if (def.effect >= 0)
      most = layout.effects[static_cast<std::size_t>(def.effect)]
                 .parameter_info[static_cast<std::size_t>(def.index)]
                 .most;
    if (def.logarithmic) most = std::log(most);
    return std::min(std::max(value, def.logarithmic ? -kInfinity : def.least), most);
  };
  VecX<double> move = solve_convex_fit(problem).x;
  for (bool beyond = true; beyond;) {  // a shape beyond its bounds is held there
    beyond = false;
    for (long c = p; c < columns; ++c)
      if (const double bound = within(c, move[c]); std::abs(bound - move[c]) > 1e-12) {
        problem.start[c] = bound;
        problem.fixed.push_back(static_cast<int>(c));
        beyond = true;
      }
    if (beyond) move = solve_convex_fit(problem).x;
  }
  for (long c = 0; c < columns; ++c) move[c] -= coordinate(c, now_.x, now_.shape);
  // Shorter as a whole: a part of it alone would leave the descent's direction.
  const double longest = p < columns ? move.tail(columns - p).cwiseAbs().maxCoeff() : 0.0;
  if (longest > kLongest) move *= kLongest / longest;
  Step out;
  out.x = now_.x + move.head(p);
  out.shape = now_.shape;
  for (long s = 0; s < out.shape.size(); ++s) {
    if (is_free[static_cast<std::size_t>(p + s)] == 0) continue;
    const bool logarithmic = layout.shape[static_cast<std::size_t>(s)].logarithmic;
    const double moved = (logarithmic ? std::log(out.shape[s]) : out.shape[s]) + move[p + s];
    const double inside = within(p + s, moved);  // but for rounding
    out.shape[s] = logarithmic ? std::exp(inside) : inside;
  }
  out.change.resize(f);
  for (long k = 0; k < f; ++k) {
    const int column = free_[static_cast<std::size_t>(k)];
    out.change[k] = coordinate(column, out.x, out.shape) - coordinate(column, now_.x, now_.shape);
    out.length += curvature(column) * out.change[k] * out.change[k];
  }
  out.length = std::sqrt(out.length);
  return out;
}

MotionFitter::Step MotionFitter::shorter_step(const VecX<double>& d, double refused,
                                              double& damping) const {
  constexpr double kShorter = 0.5;      // share of the length (Moré 1978)
  constexpr double kMostDamping = 1e9;  // there is no shorter step
  Step out = step(d, damping);
  while (out.length > kShorter * refused && damping < kMostDamping) out = step(d, damping *= 10.0);
  return out;
}

}  // namespace diffnea
