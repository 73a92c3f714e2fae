#pragma once
/// What the ball's part of a diagnosis works on: data, candidates, and the best solution so far.
/// Internal to diagnose/.

#include <vector>

#include <diffnea/diagnose/diagnose.hpp>

#include "diagnose/ball_search.hpp"

namespace diffnea {

struct BallCase : WindowCase<BallSearch> {
  bool fit_string;  ///< and the effects that the model has
  Model model;
  BallFitOptions fit = {};
  bool known_noise = false;
  bool spin = false;                   ///< is recorded
  std::vector<EffectSpec> known = {};  ///< of the model

  BallCase(const DiagnoseOptions& o, Finding& f, bool fits, const Model& m)
      : WindowCase(o, f), fit_string(fits), model(m) {}

  /// `search` on these windows.
  void search_on(BallData fitted, BallData held_out);
};

/// Data, noise and candidates; no solutions yet. The finding is told what is held out and left out.
/// @param c  options, finding, fit_string and model are given
/// @throws DataError where too little is recorded
void prepare(const std::vector<Recording>& train, const std::vector<Recording>& test, BallCase& c);

}  // namespace diffnea
