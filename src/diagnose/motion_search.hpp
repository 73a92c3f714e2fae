#pragma once
/// Which effect a robot lacks whose drives follow commands by laws of their own: fits of simulated
/// runs, score tests about them, held-out runs. Internal to diagnose/.

#include <cstdint>
#include <functional>
#include <map>
#include <optional>

#include "core/constants.hpp"
#include "diagnose/candidates.hpp"
#include "diagnose/window_case.hpp"
#include "identify/motion_data.hpp"
#include "identify/motion_fit.hpp"

namespace diffnea {

/// The model of the robot with some effects beyond the base, fitted.
struct MotionSolution {
  std::vector<EffectSpec> terms;
  std::vector<std::string> held;    ///< patterns of parameters of terms, with their values
  double within_reach = kInfinity;  ///< cost that it might have come to, was it stopped for a rival
  Model model;                      ///< with the terms, fitted
  FitLayout layout;
  MotionFit fit;
  std::vector<MotionWindow> windows;  ///< with their states
  double cost = 0.0;                  ///< Σ (e/σ)² over the windows
};

/// Mean square of positions that noise hides, over its own: half of the noise. Filters in a drive's
/// firmware mostly change runs by a third of it, and springs and ripples stood for them.
inline constexpr double kHiddenByNoise = 0.25;

/// Weight of the least change, where the recording tells no other.
inline constexpr double kRidge = 1e-9;

/// Index among the layout's effects; −1: it is not there.
int index_of(const FitLayout& layout, const EffectSpec& spec);

/// Tells whether a shape has one of some values, within bounds: what a gear loses when it brakes.
bool is_chosen(const ParameterInfo& p);

/// Tells whether no torque is linear in an effect, a spring or gap in a gear or a part of a drive's
/// law: it is scored by a few steps of a fit, which take long.
bool is_scored_by_steps(const BoundEffect& effect);

/// Tells whether the description has a gain of every drive of a model.
bool describes_gains(const Model& model);

/// Data of a search, which outlive it.
struct MotionSearchData {
  const RecordingSource& train;
  const RecordingSource* test;  ///< null: blocks of `train` are held out
  FitChoice choice;             ///< of the base
  MotionOptions options;
  MotionData data;
  double horizon = 0.0;  ///< of the windows [s]
};

class MotionSearch {
 public:
  using Solution = MotionSolution;

  /// @param base      fitted; its parameters move with the terms
  /// @param progress  told of every step; false stops
  MotionSearch(Model base, const MotionSearchData& data, std::vector<Candidate> candidates,
               std::function<bool(const std::string&, int)> progress);

  /// The best fit of these terms that is known. It is fitted from `start`, unless it has been from
  /// a fit of the same effects that was no worse, and as far as `to_beat` asks.
  /// @param to_beat  cost below which a rival must come; a fit that will hardly do so is stopped
  MotionSolution solve(const std::vector<EffectSpec>& terms, const MotionSolution* start,
                       double to_beat = kInfinity);
  /// Cost at which a fit is so much ΔBIC behind `best`, with as few parameters as `less` has.
  double reach(const MotionSolution& less, const MotionSolution& best, double within) const;
  /// Best first; those beside the best fit of its terms are remembered.
  std::vector<WindowScore> scores(const MotionSolution& at,
                                  const std::vector<EffectSpec>& candidates);
  double delta_bic(const MotionSolution& a, const MotionSolution& b) const;
  HeldOutBlocks held_out_blocks(const MotionSolution& a, const MotionSolution& b) const;
  HeldOutChange held_out(const MotionSolution& a, const MotionSolution& b,
                         std::uint64_t seed) const;
  /// Tells nothing: candidates are scored at all points of their grids.
  bool is_far_from_linear(const EffectSpec&) const { return false; }
  std::vector<CauseParameter> parameters_of(const MotionSolution& at, const EffectSpec& term) const;
  double share_of_motion(double lm) const;
  /// Tells whether zero is in the 95 % region of what a term's torque is proportional to, together.
  bool may_be_nothing(const MotionSolution& at, const EffectSpec& term) const;
  /// Fits shapes that have one of some values at each of them. Where the base takes over what a
  /// term's sizes have in common, as a servo's damping does of two sides of a friction, only their
  /// difference is told: the smallest is then held at zero.
  MotionSolution with_told_sizes(const MotionSolution& at) const;

  /// Errors of the held-out positions over their noise, per window (m, n).
  std::vector<RowMatX<double>> held_out_errors(const MotionSolution& at) const;
  /// Positions that are compared, in all windows of the fit.
  double samples() const { return static_cast<double>(samples_); }
  /// Positions that count as one, of what a solution leaves.
  double correlation(const MotionSolution& at) const;
  /// Tells of each joint, (n), whether noise hides what a solution leaves beyond it of held-out
  /// positions, in all windows: the fitted ones a base may bend to.
  std::vector<bool> at_noise(const MotionSolution& at) const;
  /// Candidates that are scored by steps, of joints where no more is left, unless no others are
  /// tried: a gear moves its own encoder, or nothing that is seen.
  std::vector<EffectSpec> hidden_by_noise(const MotionSolution& at,
                                          const std::vector<EffectSpec>& candidates) const;
  /// Tells the same of all joints.
  bool is_at_noise(const MotionSolution& at) const;
  /// Tells whether noise hides what one leaves of them and another does not.
  bool is_hidden(const MotionSolution& less, const MotionSolution& more) const;
  /// Held-out stretches.
  const std::vector<MotionStretch>& held_out_stretches() const { return held_; }

 private:
  struct Variant;  // a candidate at one point of its grid
  struct OnBench;
  /// Parts that scores beside a solution share, each made where it is asked for.
  struct Beside {
    std::optional<MotionSolution> brief;              ///< the same terms, fitted to brief_
    std::optional<std::vector<MotionStretch>> moves;  ///< stretches as it simulates them
  };

  FitLayout layout_of(const Model& model, const std::vector<EffectSpec>& terms,
                      const std::vector<std::string>& held) const;
  /// Fits of one set of terms.
  struct Known {
    struct Run {                      ///< fits that began at one fit
      std::vector<std::string> from;  ///< names of its terms
      double cost;                    ///< where it had ended
      double within_reach;  ///< cost below which they might not have come, had they gone on
    };
    std::optional<MotionSolution> best;
    std::optional<MotionSolution> begun;  ///< where a score has come to, and no fit has begun
    std::vector<Run> runs;
    std::vector<EffectSpec> scored;  ///< candidates beside `best`
    std::vector<WindowScore> scores;
  };

  /// @param held  as in MotionSolution
  Known& known(const std::vector<EffectSpec>& terms, const std::vector<std::string>& held);
  std::vector<WindowScore> new_scores(const MotionSolution& at,
                                      const std::vector<EffectSpec>& candidates);
  MotionSolution solved(MotionSolution from, const std::vector<EffectSpec>& terms,
                        double to_beat = kInfinity) const;
  /// The solution with all that a joint's drive does times a factor; not fitted.
  MotionSolution at_scale(MotionSolution of, const std::string& joint, double by) const;
  /// The solution with the gains of drives held at the description's: beside a body of unknown mass
  /// they would be told as ratios to it, but for what the other links weigh.
  MotionSolution with_described_gains(MotionSolution of) const;
  bool may_be_rigid(const MotionSolution& at, int gear) const;
  bool may_be_none(const MotionSolution& at, const EffectSpec& term) const;
  /// Columns of a term's linear parameters that are fitted.
  std::vector<long> sizes_of(const MotionSolution& at, const EffectSpec& term) const;
  MotionProblem problem(const Model& model, const FitLayout& layout) const;
  /// Gain of what no torque is linear in, a spring or gap in a gear or a part of a drive's law: at
  /// its offers, what a few steps of a fit reach. None: every simulation with it blows up.
  /// @param beside   `at`; written where it is needed
  /// @param to_beat  cost that it must come to: steps end where ten more would hardly do
  std::optional<WindowScore> score_by_steps(const MotionSolution& at, Beside& beside,
                                            const BoundEffect& effect, double correlation,
                                            double to_beat);
  /// The layout of a model with these terms; what was held before stays so.
  /// @param of  effect of the joints that move alone, all else as it is; null: all move
  FitLayout layout_as_before(const Model& model, const std::vector<EffectSpec>& terms,
                             const std::vector<std::string>& held, const FitLayout& before,
                             const BoundEffect* of = nullptr) const;
  /// Where each side of an effect's offers may begin: the offer that does best in brief windows, on
  /// the bench of its joint. None: the robot has no such bench.
  /// @param moves  of `at`; written where it is needed
  std::optional<OnBench> begun_on_bench(const MotionSolution& at,
                                        std::optional<std::vector<MotionStretch>>& moves,
                                        const BoundEffect& effect,
                                        const std::vector<std::vector<EffectSpec>>& offers) const;
  /// The same with all of the robot, of which the joint alone moves. @param brief  of `at`
  std::vector<MotionSolution> begun_with_all(
      const MotionSolution& at, const MotionSolution& brief, const BoundEffect& effect,
      const std::vector<std::vector<EffectSpec>>& offers) const;
  /// Where a few steps of a fit to windows end. @param x  (p) where it begins
  MotionFit steps_of(const MotionProblem& of, const VecX<double>& x,
                     std::vector<MotionWindow>& windows, int steps, double to_beat) const;
  /// A few steps of a fit to windows. What was held stays so.
  /// @param of  effect of the joints that move alone, all else as it is; null: all move
  MotionSolution stepped(MotionSolution from, const std::vector<EffectSpec>& terms,
                         const std::vector<MotionWindow>& windows, int steps,
                         double to_beat = kInfinity, const BoundEffect* of = nullptr) const;
  void score(const MotionSolution& at, const std::vector<Variant>& variants, double correlation,
             std::vector<WindowScore>& out) const;
  /// The stretches as a solution simulates them, as measured beyond its windows.
  std::vector<MotionStretch> simulated(const MotionSolution& at) const;
  /// Simulated positions of windows.
  std::vector<RowMatX<double>> positions(const MotionSolution& at,
                                         const std::vector<MotionStretch>& stretches,
                                         std::vector<MotionWindow> windows, bool fit_states) const;
  /// Their errors, over the noise.
  std::vector<RowMatX<double>> errors(const MotionSolution& at,
                                      const std::vector<MotionStretch>& stretches,
                                      const std::vector<MotionWindow>& windows,
                                      bool fit_states) const;

  Model base_;
  const MotionSearchData& data_;
  std::vector<Candidate> candidates_;
  std::function<bool(const std::string&, int)> progress_;
  std::vector<MotionStretch> held_;                   ///< whole, or the blocks that are held out
  std::vector<MotionWindow> windows_, held_windows_;  ///< with measured states
  /// Pieces of windows_, over before what flies free is astray; with measured states.
  std::vector<MotionWindow> brief_;
  long samples_ = 0;
  std::map<std::vector<std::string>, Known> known_;
};

}  // namespace diffnea
