#pragma once
/// Which effect a ball's path lacks: score tests about a fit by windows, refits, held-out windows.
/// Internal to diagnose/.

#include <cstdint>

#include "core/constants.hpp"
#include "diagnose/window_case.hpp"
#include "identify/ball_path.hpp"

namespace diffnea {

/// The model of the ball with some effects beyond the base, fitted.
struct BallSolution {
  std::vector<EffectSpec> terms;
  FittedBall ball;
  BallFit fit;
  double cost = 0.0;  ///< Σ ρ(e/σ₀)
};

class BallSearch {
 public:
  using Solution = BallSolution;

  /// @param train, test  windows; @param options  with the noise, sigma > 0
  /// @param base  effects of the model  @param fit_base  false: the model stands as it is
  BallSearch(const Model& model, std::vector<EffectSpec> base, bool fit_base, BallData train,
             BallData test, const BallFitOptions& options,
             std::function<bool(const std::string&, int)> progress);

  /// From the parameters and states of `start`, and from where the effects that are new to it say
  /// that a search begins. A ball's fit goes on to its end, whatever there is to beat.
  BallSolution solve(const std::vector<EffectSpec>& terms, const BallSolution* start,
                     double to_beat = kInfinity) const;
  /// Cost up to which a fit might come within some ΔBIC of another; +∞: any.
  double reach(const BallSolution&, const BallSolution&, double) const { return kInfinity; }
  /// Best first. Those of `candidates` that are terms already are left out. Nothing: stopped.
  std::vector<WindowScore> scores(const BallSolution& at,
                                  const std::vector<EffectSpec>& candidates) const;
  /// How much better b is than a, BIC; n counts numbers that are independent of each other.
  double delta_bic(const BallSolution& a, const BallSolution& b) const;
  /// Rows that count as one, of what a solution leaves; outliers are held at 4 σ.
  double correlation(const BallSolution& at) const;
  /// In units of the noise; bootstrap over windows.
  HeldOutChange held_out(const BallSolution& a, const BallSolution& b, std::uint64_t seed) const;
  /// Tells whether it has starts of its own.
  bool is_far_from_linear(const EffectSpec& e) const;
  /// With standard errors for which rows that hang together count as one.
  std::vector<CauseParameter> parameters_of(const BallSolution& at, const EffectSpec& term) const;
  double share_of_motion(double lm) const;

  const BallFitOptions& options() const { return options_; }
  const BallData& train() const { return train_; }
  const BallData& test() const { return test_; }
  long samples() const { return samples_; }

 private:
  BallSolution solved(const std::vector<EffectSpec>& terms, const BallLayout& layout,
                      const BallData& data) const;
  BallLayout layout_of(const std::vector<EffectSpec>& terms) const;

  Model model_;
  std::vector<EffectSpec> base_;
  bool fit_base_;
  BallData train_, test_;
  BallFitOptions options_;
  std::function<bool(const std::string&, int)> progress_;
  long samples_ = 0;
};

/// Rows that count as one: 1 + 2 Σ ρ_l over the first lags whose ρ_l > 0, 40 at most (after Geyer
/// 1992). @param stretches  (m, 3) each, of uninterrupted rows
double correlation(const std::vector<RowMatX<double>>& stretches);

/// What is left of each position, per window (m, 3) [m].
std::vector<RowMatX<double>> ball_errors(const FittedBall& ball, const FlightOptions& flight);

}  // namespace diffnea
