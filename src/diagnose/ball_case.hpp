#pragma once
/// What the ball's part of a diagnosis works on: data, candidates, and the best solution so far.
/// Internal to diagnose/.

#include <memory>
#include <string>
#include <vector>

#include <diffnea/diagnose/diagnose.hpp>

#include "diagnose/ball_search.hpp"

namespace diffnea {

/// Stays where it is: `search` reports to it.
struct BallCase {
  const DiagnoseOptions& options;
  Finding& finding;
  bool fit_string;  ///< and the effects that the model has
  Model model;
  BallFitOptions fit = {};
  bool known_noise = false;
  bool spin = false;                        ///< is recorded
  std::vector<EffectSpec> known = {};       ///< of the model
  std::vector<EffectSpec> candidates = {};  ///< that are tried
  std::unique_ptr<BallSearch> search = {};
  BallSolution base = {}, best = {};
  std::vector<BallScore> first_scores = {};  ///< of the candidates beside the base alone
  int steps = 0;                             ///< that progress was told of

  bool go_on() const { return !finding.interrupted; }
  /// Tells progress of so many more steps. @return whether to go on
  bool tell(const std::string& stage, int more_steps);
  /// `search` on these windows.
  void search_on(BallData fitted, BallData held_out);
};

/// Data, noise and candidates; no solutions yet. The finding is told what is held out and left out.
/// @param c  options, finding, fit_string and model are given
/// @throws DataError where too little is recorded
void prepare(const std::vector<Recording>& train, const std::vector<Recording>& test, BallCase& c);

/// Of one kind, at one place.
bool same_effect(const EffectSpec& a, const EffectSpec& b);
bool holds_effect(const std::vector<EffectSpec>& terms, const EffectSpec& e);
std::vector<EffectSpec> with_effect(std::vector<EffectSpec> terms, const EffectSpec& more);
std::vector<EffectSpec> without_effect(std::vector<EffectSpec> terms, const EffectSpec& less);

}  // namespace diffnea
