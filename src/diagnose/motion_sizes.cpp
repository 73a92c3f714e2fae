/// Sizes of the causes of a fit of simulated runs: their intervals, and which of them may be
/// nothing.

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"
#include "diagnose/chi_square.hpp"
#include "diagnose/motion_search.hpp"
#include "diagnose/thresholds.hpp"
#include "identify/gears.hpp"

namespace diffnea {
namespace {

/// Chance that nothing at all looks like a size.
constexpr double kChance = 0.05;
}  // namespace

std::vector<CauseParameter> MotionSearch::parameters_of(const MotionSolution& at,
                                                        const EffectSpec& term) const {
  std::vector<CauseParameter> out;
  const int e = index_of(at.layout, term);
  if (e < 0) return out;
  const BoundEffect& effect = at.layout.effects[static_cast<std::size_t>(e)];
  const long p = static_cast<long>(at.layout.linear.size());
  for (std::size_t k = 0; k < effect.parameter_info.size(); ++k) {
    const ParameterInfo& info = effect.parameter_info[k];
    CauseParameter of{info.name, "", effect.parameters[k]};
    const auto take = [&](const std::vector<FitParameter>& list, const VecX<double>& values,
                          long from) {
      for (std::size_t c = 0; c < list.size(); ++c) {
        if (list[c].effect != e || list[c].index != static_cast<int>(k)) continue;
        of.unit = list[c].unit;
        of.value = values[static_cast<long>(c)];
        if (list[c].fixed) continue;
        const long at_column = from + static_cast<long>(c);
        of.std = std::sqrt(std::max(at.fit.covariance(at_column, at_column), 0.0));
        of.low = of.value - kNormal95 * of.std;
        of.high = of.value + kNormal95 * of.std;
        if (list[c].sign != Sign::kFree) of.low = std::max(of.low, 0.0);
        // Flanks of the fit give way; how much of that true ones do nobody knows.
        if (hides_motor(effect) && k == gear_size(effect))
          of.high += flank_give(effect, at.layout, at.fit.x, at.fit.shape, data_.data);
      }
    };
    take(at.layout.linear, at.fit.x, 0);
    take(at.layout.shape, at.fit.shape, p);
    if (info.name == "motor_inertia")  // the joint's armature, as set_rotors() has it
      for (const EffectSpec& spec : at.model.effects)
        for (const EffectParameter& own : spec.parameters)
          if (same_effect(spec, term) && own.name == info.name) of.value = own.value;
    out.push_back(of);
  }
  return out;
}

std::vector<long> MotionSearch::sizes_of(const MotionSolution& at, const EffectSpec& term) const {
  std::vector<long> out;
  const int e = index_of(at.layout, term);
  for (std::size_t c = 0; c < at.layout.linear.size(); ++c)
    if (at.layout.linear[c].effect == e && !at.layout.linear[c].fixed)
      out.push_back(static_cast<long>(c));
  return out;
}

/// Tells whether a gear may as well be rigid: its size within its own error, or where the encoder's
/// noise hides it.
bool MotionSearch::may_be_rigid(const MotionSolution& at, int gear) const {
  const BoundEffect& e = at.layout.effects[static_cast<std::size_t>(gear)];
  const std::vector<double> sizes = gear_sizes(e, at.layout, at.fit.x, at.fit.shape, data_.data);
  if (sizes.empty()) return true;
  for (std::size_t s = 0; s < at.layout.shape.size(); ++s) {
    const FitParameter& p = at.layout.shape[s];
    if (p.effect != gear || p.index != static_cast<int>(gear_size(e)) || p.fixed) continue;
    const long column = at.fit.x.size() + static_cast<long>(s);
    const double size = at.fit.shape[static_cast<long>(s)],
                 std = std::sqrt(std::max(at.fit.covariance(column, column), 0.0));
    const bool hidden =
        e.info().motor == HiddenMotor::kSpring ? size > sizes.front() : size < sizes.front();
    return hidden || size < kNormal95 * std;
  }
  return false;
}

/// The same of an amplitude that the torque is not linear in.
bool MotionSearch::may_be_none(const MotionSolution& at, const EffectSpec& term) const {
  const int e = index_of(at.layout, term);
  for (std::size_t s = 0; e >= 0 && s < at.layout.shape.size(); ++s) {
    const FitParameter& p = at.layout.shape[s];
    if (p.effect != e || p.fixed || p.logarithmic) continue;
    const long column = at.fit.x.size() + static_cast<long>(s);
    const double size = at.fit.shape[static_cast<long>(s)],
                 std = std::sqrt(std::max(at.fit.covariance(column, column), 0.0));
    return std::abs(size) < kNormal95 * std;
  }
  return false;
}

bool MotionSearch::may_be_nothing(const MotionSolution& at, const EffectSpec& term) const {
  if (const int e = index_of(at.layout, term);
      e >= 0 && hides_motor(at.layout.effects[static_cast<std::size_t>(e)]))
    return may_be_rigid(at, e);
  const std::vector<long> sizes = sizes_of(at, term);
  if (sizes.empty()) return may_be_none(at, term);
  const VecX<double> x = at.fit.x(sizes);
  MatX<double> C = at.fit.covariance(sizes, sizes);
  C.diagonal() *= 1.0 + kRidge;
  const double square = x.dot(C.ldlt().solve(x));
  return chi_square_tail(square, static_cast<int>(sizes.size())) > kChance;
}

MotionSolution MotionSearch::with_told_sizes(const MotionSolution& at) const {
  MotionSolution out = at;
  for (const EffectSpec& t : at.terms) {
    for (const ParameterInfo& p : find_effect(t.effect).parameters) {
      if (!is_chosen(p)) continue;
      const auto with = [&](double value) {
        MotionSolution other = out;
        for (EffectSpec& e : other.model.effects)
          for (EffectParameter& of : e.parameters)
            if (same_effect(e, t) && of.name == p.name) of.value = value;
        return solved(std::move(other), at.terms);
      };
      // First order chose one. The plain one stays, unless the fits tell another apart from it.
      MotionSolution best = with(p.initial);
      for (const double value : p.search)
        if (value != p.initial)
          if (MotionSolution other = with(value); delta_bic(best, other) > kToldApart)
            best = std::move(other);
      out = std::move(best);
    }
    const std::vector<long> sizes = sizes_of(out, t);
    const bool untold = sizes.size() > 1 && std::ranges::all_of(sizes, [&](long c) {
                          return out.fit.x[c] < kNormal95 * std::sqrt(out.fit.covariance(c, c)) &&
                                 out.layout.linear[static_cast<std::size_t>(c)].sign != Sign::kFree;
                        });
    if (!untold || may_be_nothing(out, t)) continue;
    const long least = *std::ranges::min_element(sizes, {}, [&](long c) { return out.fit.x[c]; });
    out.held.push_back(out.layout.linear[static_cast<std::size_t>(least)].name + "=0");
    out = solved(std::move(out), at.terms);
  }
  return out;
}

}  // namespace diffnea
