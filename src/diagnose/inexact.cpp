#include "diagnose/inexact.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

namespace diffnea {
namespace {

/// Of an accepted effect's torque: so well do its columns have its shape (filters, the reference
/// model, terms of order two). What explains less beside it is not taken for another effect.
constexpr double kAccuracy = 0.02;
/// The same of dry friction: filtered, nothing is known of how it turns but for a few milliseconds.
constexpr double kDryAccuracy = 0.04;
/// The same of dry friction F that is the base's, whose turns are fitted beside its size
/// (turn_columns()), at the least.
constexpr double kBaseDryAccuracy = 0.01;
/// How late one of its turns may be against the others [s]: what holds a joint meanwhile is nothing
/// that its motion tells. Each leaves 2 F for so long, which the filter spreads over 1/cut-off.
constexpr double kLateTurn = 1.75e-3;

/// The base's dry friction beside `terms`, in units of noise, (rows of the evidence).
VecX<double> dry_friction(const Search& search, const std::vector<Term>& terms) {
  const Evidence& evidence = search.evidence();
  const std::vector<int>& dry = evidence.dry_columns();
  if (dry.empty()) return VecX<double>::Zero(evidence.rows());
  VecX<double> effects = VecX<double>::Zero(evidence.rows());
  for (const Term& t : terms) effects += t.torque();
  const VecX<double> x = search.projection().parameters(effects);
  return search.whitener()(evidence.base()(Eigen::all, dry) * x(dry));
}

}  // namespace

double inexact_at(const Search& search, const Term& term, const std::vector<Term>& terms) {
  const Evidence& evidence = search.evidence();
  const VecX<double> after = search.left_by(terms);
  const VecX<double> unknown = inexact_friction(search, terms, is_like_friction(term.effect));
  const long m = evidence.times();
  const Port port = term.effect.info().port;
  const bool local =
      port == Port::kJointTorque || (port == Port::kMemory && !encoder_at_motor(term.effect));
  double out = 0.0;
  for (std::size_t k = 0; k < evidence.joints().size(); ++k) {
    if (local &&
        std::ranges::find(term.effect.joints, evidence.joints()[k]) == term.effect.joints.end())
      continue;
    const long begin = static_cast<long>(k) * m;
    const bool dry = std::ranges::any_of(terms, [&](const Term& t) {
      return std::ranges::find(t.effect.joints, evidence.joints()[k]) != t.effect.joints.end() &&
             is_dry(t.effect);
    });
    const double accuracy = dry ? kDryAccuracy : kAccuracy;
    out += accuracy * accuracy *
           std::max(0.0, search.projection().residual().segment(begin, m).squaredNorm() -
                             after.segment(begin, m).squaredNorm());
    out += unknown[static_cast<long>(k)];
    // Noise that is assumed stands for errors of filters and integrators, which do not average out.
    const std::vector<bool>& kept = search.whitener().kept();
    const auto rows = std::count(kept.begin() + begin, kept.begin() + begin + m, true);
    out += search.whitener().noise()[k].assumed * static_cast<double>(rows);
  }
  return out;
}

VecX<double> inexact_friction(const Search& search, const std::vector<Term>& terms,
                              bool of_late_turns) {
  const Evidence& evidence = search.evidence();
  const VecX<double> friction = dry_friction(search, terms);
  const long m = evidence.times();
  VecX<double> out(static_cast<long>(evidence.joints().size()));
  for (long k = 0; k < out.size(); ++k) {
    double share = kBaseDryAccuracy * kBaseDryAccuracy;
    if (of_late_turns)
      share = std::max(share, 4.0 * kLateTurn * kLateTurn * evidence.cut_off(k) *
                                  evidence.turns_per_second(k));
    out[k] = share * friction.segment(k * m, m).squaredNorm();
  }
  return out;
}

}  // namespace diffnea
