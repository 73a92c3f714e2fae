#include "diagnose/reference.hpp"

#include <algorithm>
#include <cmath>

#include "diagnose/signed_fit.hpp"

namespace diffnea {
namespace {

/// How far ln v₀ of the base's friction is followed from where it was read; beside a spring, which
/// the friction's jumps may wind up: their second derivative needs a v₀ that is no extrapolation.
constexpr double kMostTurn = 1.5, kMostTurnAtSpring = 0.7;
/// A reference whose torque has moved by less leaves the candidates' columns as they are. A column
/// that is wrong by a tenth loses a hundredth of its gain, and what is offered has it made anew.
constexpr double kMoved = 0.1;
/// Weight of the least change, where the recording tells no other.
constexpr double kRidge = 1e-9;

/// A model can hold no rotor and no friction below 0, the test's base can: what they have there,
/// the other parameters take over, as far as they predict the same torque. Clipped alone, it would
/// be missing from the torque that drives are late by: a lag of 40 ms came out 2 to 3 % short.
VecX<double> within_signs(const FitLayout& layout, const Evidence& evidence,
                          const VecX<double>& x) {
  const long p = static_cast<long>(layout.linear.size());
  std::vector<int> free;
  std::vector<bool> nonnegative;
  bool outside = false;
  for (long k = 0; k < p; ++k) {
    const FitParameter& parameter = layout.linear[static_cast<std::size_t>(k)];
    if (parameter.fixed) continue;
    free.push_back(static_cast<int>(k));
    nonnegative.push_back(parameter.sign != Sign::kFree);
    outside = outside || (nonnegative.back() && x[k] < 0.0);
  }
  if (!outside) return x;
  MatX<double> K = MatX<double>::Zero(x.size(), x.size());
  for (const JointFactor& f : evidence.factors()) {
    const MatX<double> R = f.factor.R();
    const MatX<double> RR = R.transpose() * R / std::max(R.squaredNorm(), 1e-300);
    for (long a = 0; a < RR.rows(); ++a)
      for (long b = 0; b < RR.cols(); ++b)
        K(f.columns[static_cast<std::size_t>(a)], f.columns[static_cast<std::size_t>(b)]) +=
            RR(a, b);
  }
  MatX<double> A = K(free, free);
  A.diagonal() += kRidge * A.diagonal() + VecX<double>::Constant(A.rows(), 1e-300);
  VecX<double> out = x;
  const VecX<double> at = x(free);
  out(free) = signed_fit(A, A * at, nonnegative).x;
  return out;
}

}  // namespace

VecX<double> shapes_at(const FitLayout& layout, const VecX<double>& x,
                       const std::vector<Term>& terms) {
  const bool spring = std::ranges::any_of(
      terms, [](const Term& t) { return t.effect.info().motor == HiddenMotor::kSpring; });
  const double most = spring ? kMostTurnAtSpring : kMostTurn;
  VecX<double> shape(static_cast<long>(layout.shape.size()));
  long at = static_cast<long>(layout.linear.size());
  for (std::size_t s = 0; s < layout.shape.size(); ++s) {
    shape[static_cast<long>(s)] = layout.shape[s].prior;
    if (is_smoothing(layout.shape[s]))
      shape[static_cast<long>(s)] *= std::exp(std::clamp(x[at++], -most, most));
  }
  return shape;
}

Model base_at(const Model& model, const FitLayout& layout, const VecX<double>& x,
              const std::vector<Term>& terms) {
  VecX<double> physical = x.head(static_cast<long>(layout.linear.size()));
  for (std::size_t k = 0; k < layout.linear.size(); ++k)  // the test's base knows no bounds
    if (layout.linear[k].sign != Sign::kFree && !layout.linear[k].fixed)
      physical[static_cast<long>(k)] = std::max(physical[static_cast<long>(k)], 0.0);
  return apply_fit(model, layout, physical, shapes_at(layout, x, terms));
}

VecX<double> Reference::set(const VecX<double>& x, const std::vector<Term>& terms) {
  Model reference = base_at(model_, layout_, within_signs(layout_, train_, x), terms);
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
  Model out = base_at(model_, layout_, within_signs(layout_, train_, x), terms);
  for (const Term& t : terms)
    if (!t.effect.own) out.effects.push_back(to_spec(t.effect));
  return out;
}

std::vector<bool> Reference::rebase(const Projection& projection,
                                    const std::vector<Term>& terms) {
  VecX<double> effects = VecX<double>::Zero(train_.rows());
  for (const Term& t : terms) effects += t.torque();
  const VecX<double> x = projection.reference(effects);
  const VecX<double> by = set(x, terms);
  if (moved_.size() == 0) moved_ = VecX<double>::Zero(by.size());
  moved_ += by;
  const bool tilted = set_tilt(x, terms);
  std::vector<bool> out(static_cast<std::size_t>(by.size()), false);
  for (long j = 0; j < by.size(); ++j) {
    if (!tilted && !(moved_[j] > kMoved)) continue;
    out[static_cast<std::size_t>(j)] = true;
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
