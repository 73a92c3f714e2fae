#include "diagnose/reference.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/identify/convex_fit.hpp>
#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/model/physical.hpp>

namespace diffnea {
namespace {

/// How far ln v₀ of the base's friction is followed from where it was read; beside a spring, which
/// the friction's jumps may wind up: their second derivative needs a v₀ that is no extrapolation.
constexpr double kMostTurn = 1.5, kMostTurnAtSpring = 0.7;
/// A reference whose torque has moved by less leaves the candidates' columns as they are. A column
/// that is wrong by a tenth loses a hundredth of its gain, and what is offered has it made anew.
constexpr double kMoved = 0.1;
/// Weight of the torque against what is plausible of its parameters: by a ten-thousandth of its
/// size it may change for that.
constexpr double kAlike = 1e4;

/// Tells whether no robot has these parameters: friction or a rotor below 0, or a link that no
/// distribution of mass can be.
bool is_impossible(const FitLayout& layout, const VecX<double>& x) {
  for (std::size_t k = 0; k < layout.linear.size(); ++k) {
    const FitParameter& p = layout.linear[k];
    if (!p.fixed && p.sign != Sign::kFree && x[k] < 0.0) return true;
  }
  return std::ranges::any_of(layout.bodies(), [&](int first) {
    Theta<double> theta;
    for (int k = 0; k < kThetaSize; ++k) theta[k] = x[first + k];
    return !layout.linear[first].fixed && !(smallest_pseudo_inertia_eigenvalue(theta) > 0.0);
  });
}

/// Factors of the linear parameters alone: how sharply friction turns has columns of its own, the
/// last ones.
std::vector<JointFactor> linear_factors(const FitLayout& layout, const Evidence& evidence) {
  const int p = static_cast<int>(layout.linear.size());
  std::vector<JointFactor> out;
  for (const JointFactor& f : evidence.factors()) {
    std::vector<int> columns = f.columns;
    std::erase_if(columns, [p](int c) { return c >= p; });
    const long n = std::ssize(columns);
    const MatX<double> R = f.factor.R();
    RowMatX<double> rows(R.rows(), n + 1);
    rows << R.leftCols(n), f.factor.d();
    out.push_back({std::move(columns), TriangularFactor(static_cast<int>(n))});
    out.back().factor.add(rows);
  }
  return out;
}

/// The nearest parameters that a robot can have, by the torque that they predict. The test's base
/// knows no bounds: rotors and links behind them share an inertia that the motion does not part,
/// and a link behind its spring swings by its own. Friction clipped alone would be missing from the
/// torque that drives are late by: a lag of 40 ms came out 2 to 3 % short.
VecX<double> possible(const FitLayout& layout, const Evidence& evidence, const VecX<double>& x) {
  if (!is_impossible(layout, x)) return x;
  const long p = std::ssize(layout.linear);
  ConvexFitProblem problem;
  const std::vector<JointFactor> factors = linear_factors(layout, evidence);
  const VecX<double> scale = parameter_scales(layout, factors);
  problem.start = consistent_start(layout, scale);
  problem.bodies = layout.bodies();
  long rows = 0;
  for (const JointFactor& f : factors) rows += f.factor.R().rows();
  problem.R = MatX<double>::Zero(rows, p);
  for (long at = 0; const JointFactor& f : factors) {
    const MatX<double> R = f.factor.R();
    const double weight = kAlike / std::max(R.norm(), 1e-300);
    problem.R.middleRows(at, R.rows())(Eigen::all, f.columns) = weight * R;
    at += R.rows();
  }
  VecX<double> weak = VecX<double>::Zero(p);
  for (long k = 0; k < p; ++k) {
    const FitParameter& parameter = layout.linear[k];
    if (parameter.fixed) {
      problem.fixed.push_back(static_cast<int>(k));
      problem.start[k] = parameter.prior;
      continue;
    }
    if (parameter.sign != Sign::kFree) problem.nonnegative.push_back(static_cast<int>(k));
    weak[k] = std::pow(10.0 * scale[k], -2);
  }
  problem.prior_information = weak.asDiagonal();
  problem.d = problem.R * x.head(p);
  VecX<double> out = x;
  out.head(p) = solve_convex_fit(problem).x;
  return out;
}

}  // namespace

VecX<double> shapes_at(const FitLayout& layout, const VecX<double>& x,
                       const std::vector<Term>& terms) {
  const bool spring = std::ranges::any_of(
      terms, [](const Term& t) { return t.effect.info().motor == HiddenMotor::kSpring; });
  const double most = spring ? kMostTurnAtSpring : kMostTurn;
  VecX<double> shape(std::ssize(layout.shape));
  long at = std::ssize(layout.linear);
  for (std::size_t s = 0; s < layout.shape.size(); ++s) {
    shape[s] = layout.shape[s].prior;
    if (is_smoothing(layout.shape[s])) shape[s] *= std::exp(std::clamp(x[at++], -most, most));
  }
  return shape;
}

Model base_at(const Model& model, const FitLayout& layout, const VecX<double>& x,
              const std::vector<Term>& terms) {
  VecX<double> physical = x.head(std::ssize(layout.linear));
  for (std::size_t k = 0; k < layout.linear.size(); ++k)  // the test's base knows no bounds
    if (layout.linear[k].sign != Sign::kFree && !layout.linear[k].fixed)
      physical[k] = std::max(physical[k], 0.0);
  return apply_fit(model, layout, physical, shapes_at(layout, x, terms));
}

VecX<double> Reference::set(const VecX<double>& x, const std::vector<Term>& terms) {
  Model reference = base_at(model_, layout_, possible(layout_, train_, x), terms);
  // Columns on top of it hold those that change the tree or the channels; a tilt changes the base's
  // columns, too.
  for (const Term& t : terms)
    if (!t.effect.own && (t.effect.is_local() || t.effect.info().has(Trait::kGravity)))
      reference.effects.push_back(to_spec(t.effect));
  const VecX<double> moved = train_.set_reference(reference);
  if (test_) test_->set_reference(reference);
  return moved;
}

Model Reference::extended(const VecX<double>& x, const std::vector<Term>& terms) const {
  Model out = base_at(model_, layout_, possible(layout_, train_, x), terms);
  for (const Term& t : terms)
    if (!t.effect.own) out.effects.push_back(to_spec(t.effect));
  return out;
}

std::vector<bool> Reference::rebase(const Projection& projection,
                                    const std::vector<Term>& terms) {
  const VecX<double> x = projection.reference(torque_of(terms, train_.rows()));
  const VecX<double> by = set(x, terms);
  if (moved_.size() == 0) moved_ = VecX<double>::Zero(by.size());
  moved_ += by;
  const bool tilted = set_tilt(x, terms);
  std::vector<bool> out(by.size(), false);
  for (long j = 0; j < by.size(); ++j) {
    if (!tilted && !(moved_[j] > kMoved)) continue;
    out[j] = true;
    moved_[j] = 0.0;
  }
  if (std::ranges::find(out, true) == out.end()) out.clear();
  return out;
}

/// Under a tilt that is among the causes, the base's columns are those of the tilted base.
bool Reference::set_tilt(const VecX<double>& x, const std::vector<Term>& terms) {
  Vec3<double> more{0, 0, 0};
  for (const Term& t : terms)
    if (t.effect.info().has(Trait::kGravity))
      more = more + Vec3<double>{t.effect.parameters[0], t.effect.parameters[1], 0.0};
  if (!tilted_ && dot(more, more) == 0.0) return false;
  tilted_ = dot(more, more) > 0.0;
  train_.set_tilt(more, x);
  if (test_) test_->set_tilt(more, x);
  return true;
}

}  // namespace diffnea
