#pragma once
/// Reward of ball in a cup (paper; corrected, see docs/policy.md):
///
///   R = exp(½ max_t ψ_t + ½ ψ_N) − 1/(N+1) Σ_{i=0}^{N} (λ_q ‖q_i − q_0‖² + λ_q̇ ‖q̇_i‖²)
///   ψ = Δᵀm̂/(ΔᵀΔ + ε),   Δ = p_WB − p_WC,   m̂ = the cup's axis
///
/// the field of a dipole at the cup's origin, which draws the ball into it from above. ψ_N is that
/// of a ball that is in the cup at the end. Any other ball gets at most what it gets hanging still
/// below the cup, ψ_hang = −r/(r² + ε): hovering over the cup when time is up is no success. A ball
/// that touches the cup from outside, and a cup upside down, end the episode.
///
/// A network's ball (BallPhase::kImagined) knows no catch: it gets the paper's ψ_N wherever it
/// ends, and the slack is that of the looks at which it is outside the cup. It is solved where the
/// ball is inside throughout the last half second.

#include <diffnea/core/fields.hpp>
#include <diffnea/policy/task.hpp>

namespace diffnea {

/// Weights and lengths of the reward.
struct BallInCupOptions {
  double epsilon = 0.01;
  double lambda_q = 0.02;
  double lambda_qd = 0.002;
  double lambda_slack = 0.0;
  double string = 0.4;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("BallInCupOptions", "Weights and lengths of the reward.", {.exact = true});
    list.field("epsilon", &BallInCupOptions::epsilon,
               "ε, the square of the distance from the cup's origin at which ψ is largest.",
               {.unit = "m²"});
    list.field("lambda_q", &BallInCupOptions::lambda_q, "λ_q, of joint positions.",
               {.unit = "1/rad²"});
    list.field("lambda_qd", &BallInCupOptions::lambda_qd, "λ_q̇, of joint velocities.",
               {.unit = "s²/rad²"});
    list.field("lambda_slack", &BallInCupOptions::lambda_slack,
               "λ_s, of the string's slack (1 − ‖Δ‖/r)² until the ball is caught: where a massless "
               "string is furthest from a rope. 0: the paper's reward.",
               {.optional = true, .null = 0.0});
    list.field("string", &BallInCupOptions::string, "r, the string's length.", {.unit = "m"});
  }
};

/// The task: the ball ends in the cup.
class BallInCupTask : public Task {
 public:
  /// @throws Error if epsilon or string is not positive, or a λ is negative
  explicit BallInCupTask(const BallInCupOptions& options = {});

  /// @throws Error if the simulator shows no ball, cup, axis, phase, or a joint's position or
  /// velocity
  void begin(const Simulator& simulator, int count) override;
  void look(double time, const Lanes& observation, std::vector<char>& ended) override;
  VecX<double> rewards() const override;
  /// 1 where the ball is in the cup at the end.
  std::vector<char> solved() const override;
  std::unique_ptr<Task> clone() const override;

  /// As given.
  const BallInCupOptions& options() const { return options_; }

 private:
  BallInCupOptions options_;
  std::vector<int> q_, qd_;  ///< rows of the observation
  int ball_[3] = {}, cup_[3] = {}, axis_[3] = {}, phase_row_ = 0;

  // One entry a world, up to the end of its episode.
  Lanes q0_;                     ///< (joints × count), of the first look
  VecX<double> looks_;           ///< seen so far
  VecX<double> penalty_;         ///< summed over them
  VecX<double> psi_, psi_most_;  ///< ψ of the last look, and the largest
  VecX<double> phase_;           ///< of the last look
  VecX<double> outside_;         ///< when a ball that nothing holds was last outside [s]
  double time_ = 0.0;            ///< of the last look [s]
  VecX<double> live_, now_;      ///< scratch: 1 where the episode goes on; penalty of this look
};

}  // namespace diffnea
