#pragma once
/// A diagnosis by simulated windows, of a ball or of joints: candidates, and the best solution so
/// far. Internal to diagnose/.

#include <memory>
#include <string>
#include <vector>

#include <diffnea/diagnose/diagnose.hpp>

#include "diagnose/gain.hpp"

namespace diffnea {

/// Gain of a candidate, to first order.
struct WindowScore {
  EffectSpec effect;
  double lm = 0.0;
  double delta_bic = 0.0;  ///< if what is left hung together as it does without the candidate
  double promise = 0.0;    ///< ΔBIC that a fit may come to, at most
  double parameters = 1.0;  ///< number that it adds
  double visible_share = 0.0;
  VecX<double> values = {};  ///< that it would take
};

/// Tells whether effects are of one kind, at one place.
bool same_effect(const EffectSpec& a, const EffectSpec& b);
bool holds_effect(const std::vector<EffectSpec>& terms, const EffectSpec& e);
std::vector<EffectSpec> with_effect(std::vector<EffectSpec> terms, const EffectSpec& more);
std::vector<EffectSpec> without_effect(std::vector<EffectSpec> terms, const EffectSpec& less);
/// Places and names, sorted: the same for the same effects in any order.
std::vector<std::string> names_of(const std::vector<EffectSpec>& terms);

/// How much less is left of n numbers in another fit than in one, BIC.
/// @param less  sum of squares of the one  @param more  of the other, with `parameters` more
/// @param correlation  numbers that count as one
double window_delta_bic(double less, double more, double n, double correlation,
                        double parameters);

/// Sums of squares of held-out numbers without and with something, by blocks that hang together.
struct HeldOutBlocks {
  std::vector<double> before, after;
  double n = 0.0;  ///< numbers in all
};
/// Mean squares and what is certain of their difference, by a bootstrap over the blocks.
HeldOutChange change_over(const HeldOutBlocks& blocks, std::uint64_t seed);

/// `Search` fits a model with some effects beyond its base to windows. It has a type `Solution`
/// with `terms`, and
///   Solution solve(terms, const Solution* start, to_beat): from the parameters and states of
///     `start`; may stop where the cost will hardly come below `to_beat`, if that is given
///   double reach(less, best, within): cost at which a fit of more than `less` is that much ΔBIC
///     behind `best`
///   std::vector<WindowScore> scores(solution, candidates): best first, terms left out
///   double delta_bic(a, b): how much better b is
///   HeldOutChange held_out(a, b, seed): in units of the noise
///   bool is_far_from_linear(effect): first order about 0 says little of it
///   std::vector<CauseParameter> parameters_of(solution, term)
///   double share_of_motion(lm): of all motion, what a term changes, root mean square
/// Stays where it is: the search reports to it.
template <class Search>
struct WindowCase {
  const DiagnoseOptions& options;
  Finding& finding;
  std::vector<EffectSpec> candidates = {};  ///< that are tried
  std::unique_ptr<Search> search = {};
  typename Search::Solution base = {}, best = {};
  std::vector<WindowScore> first_scores = {};  ///< of the candidates beside the base alone
  int steps = 0;                               ///< that progress was told of

  WindowCase(const DiagnoseOptions& o, Finding& f) : options(o), finding(f) {}
  WindowCase(const WindowCase&) = delete;
  WindowCase& operator=(const WindowCase&) = delete;

  bool go_on() const { return !finding.interrupted; }
  /// Tells progress of so many more steps. @return whether to go on
  bool tell(const std::string& stage, int more_steps) {
    steps += more_steps;
    if (options.progress && !options.progress({stage, steps, 0, 0.0})) finding.interrupted = true;
    return go_on();
  }
};

}  // namespace diffnea
