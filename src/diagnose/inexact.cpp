#include "diagnose/inexact.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"
#include "diagnose/thresholds.hpp"
#include "recording/spectrum.hpp"

namespace diffnea {
namespace {

/// Of an accepted effect's torque: so well do its columns have its shape (filters, the reference
/// model, terms of order two). What explains less beside it is not taken for another effect.
constexpr double kAccuracy = 0.02;
/// The same of dry friction: filtered, nothing is known of how it turns but for a few milliseconds.
constexpr double kDryAccuracy = 0.04;
/// How late one of its turns may be against the others [s]: what holds a joint meanwhile is nothing
/// that its motion tells. Each leaves 2 F for so long, which the filter spreads over 1/cut-off.
constexpr double kLateTurn = 1.75e-3;
/// Rows of a spectrum's window, at the most; with fewer than the least there is none.
constexpr long kWindow = 128, kShortestWindow = 4;

/// The base's dry friction beside `terms`, in units of noise, (rows of the evidence).
VecX<double> dry_friction(const Search& search, const std::vector<Term>& terms) {
  const Evidence& evidence = search.evidence();
  const std::vector<int>& dry = evidence.dry_columns();
  if (dry.empty()) return VecX<double>::Zero(evidence.rows());
  const VecX<double> x = search.projection().parameters(torque_of(terms, evidence.rows()));
  return search.whitener()(evidence.base()(Eigen::all, dry) * x(dry));
}

/// Power of rows of the k-th joint, of those that no longer hang on how their stretch begins.
detail::Spectrum spectrum(const Evidence& evidence, long k, const VecX<double>& rows) {
  std::vector<VecX<double>> stretches;
  long longest = 1;
  for (long begin = 0, end = 0; begin < rows.size(); begin = end) {
    const auto of = [&](long i) { return evidence.stretch()[i]; };
    while (end < rows.size() && of(end) == of(begin)) ++end;
    long first = begin;
    while (first < end && evidence.begins(first, k)) ++first;
    stretches.emplace_back(rows.segment(first, end - first));
    longest = std::max(longest, end - first);
  }
  if (longest < kShortestWindow) return {};
  const long window = (std::bit_floor(static_cast<unsigned long>(longest)));
  return detail::welch(stretches, 1.0 / evidence.step(), std::min(kWindow, window));
}

/// χ² that a motor behind a spring removes of noise at its joint, because noise moves the joint.
///
/// A torque w that a drive gives and no log has moves the joint: of the torque that the model
/// predicts, S w is its work, S the loop's sensitivity, and what the model lacks is −w (Forssell,
/// Ljung 1999). Of what weighs high frequencies more than the motion does, as the second derivative
/// of that torque, most may be w's, which it then explains. At every frequency that is the column's
/// share that noise as large as what is lacking has in the predicted torque, at the most all. What
/// a loop amplifies at some frequencies it attenuates at others: |S| is 1 in the geometric mean
/// (Bode's integral, Åström and Murray 2008, sec. 12.3).
double of_moving_noise(const Search& search, const Term& term, const std::vector<Term>& terms) {
  const Evidence& evidence = search.evidence();
  const int j = term.effect.joints.front();
  const long k = evidence.index_of(j), m = evidence.times();
  if (k < 0) return 0.0;
  const Beside whole = term.torque_beside();
  const double size = product(whole, whole)(0, 0);
  if (!(size > 0.0)) return 0.0;
  const auto of_joint = [&](const VecX<double>& rows) {
    return spectrum(evidence, k, rows.segment(k * m, m));
  };
  const auto total = [j](const JointSeries& s) -> RowMatX<double> { return s.total.col(j); };
  const detail::Spectrum left = of_joint(search.left_by(terms)),
                         column = of_joint(search.projection().expanded(whole).col(0)),
                         lacking = of_joint(search.residual(terms)),
                         predicted = spectrum(evidence, k, evidence.rows_of(k, total));
  double mean = 0.0;
  for (std::size_t f = 0; f < left.power.size(); ++f) {
    const double share = std::min(1.0, lacking.power[f] / std::max(predicted.power[f], 1e-300));
    mean += (left.frequency(1) - left.frequency(0)) *
            std::sqrt(left.power[f] * column.power[f] * share);
  }
  const double with = static_cast<double>(m) * mean;
  return with * with / size;
}

}  // namespace

double inexact_at(const Search& search, const Term& term, const std::vector<Term>& terms) {
  const Evidence& evidence = search.evidence();
  const VecX<double> after = search.left_by(terms);
  const VecX<double> unknown = inexact_friction(search, terms, is_like_friction(term.effect));
  const long m = evidence.times();
  const bool local = acts_at_its_joints(term.effect);
  VecX<double> torque;  // empty where it is not known: a learned one, of one joint
  if (term.beside.cols() > 0)
    torque = search.projection().expanded(term.torque_beside()).col(0).head(evidence.rows());
  const double size = torque.norm();
  if (torque.size() > 0 && !(size > 0.0)) return kInfinity;
  double of_joints = 0.0;  // the largest product with what is not exact, over the size
  for (std::size_t k = 0; k < evidence.joints().size(); ++k) {
    const auto acts = [&](const Term& t) {
      return evidence.driven_rows().reaches(t.effect.joints, evidence.joints()[k]);
    };
    if (local && !acts(term)) continue;
    const long begin = k * m;
    const bool dry =
        std::ranges::any_of(terms, [&](const Term& t) { return acts(t) && is_dry(t.effect); });
    const double accuracy = dry ? kDryAccuracy : kAccuracy;
    double there = accuracy * accuracy *
                   std::max(0.0, search.projection().residual().segment(begin, m).squaredNorm() -
                                     after.segment(begin, m).squaredNorm());
    there += unknown[k];
    // Noise that is assumed stands for errors of filters and integrators, which do not average out.
    const std::vector<bool>& kept = search.whitener().kept();
    const auto rows = std::count(kept.begin() + begin, kept.begin() + begin + m, true);
    there += search.whitener().noise()[k].assumed * static_cast<double>(rows);
    const double share = torque.size() > 0 ? torque.segment(begin, m).norm() / size : 1.0;
    of_joints += share * std::sqrt(there);
  }
  return of_joints * of_joints + (term.effect.info().motor == HiddenMotor::kSpring
                                      ? of_moving_noise(search, term, terms)
                                      : 0.0);
}

VecX<double> inexact_friction(const Search& search, const std::vector<Term>& terms,
                              bool of_late_turns) {
  const Evidence& evidence = search.evidence();
  const VecX<double> friction = dry_friction(search, terms);
  const long m = evidence.times();
  VecX<double> out(std::ssize(evidence.joints()));
  for (long k = 0; k < out.size(); ++k) {
    double share = kInexact * kInexact;  // turns are fitted beside its size (turn_columns())
    if (of_late_turns)
      share = std::max(share, 4.0 * kLateTurn * kLateTurn * evidence.cut_off(k) *
                                  evidence.turns_per_second(k));
    out[k] = share * friction.segment(k * m, m).squaredNorm();
  }
  return out;
}

}  // namespace diffnea
