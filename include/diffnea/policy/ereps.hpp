#pragma once
/// Episodic relative entropy policy search (Peters et al. 2010; Deisenroth et al. 2013,
/// sec. 2.4.3.1) with a bound on the maximum-likelihood update, too (paper; corrected, see
/// docs/policy.md): ask for samples, tell their rewards.
///
///     Ereps search(start, options, seed);
///     while (!search.done()) search.tell(rewards_of(search.ask()));

#include <cstdint>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/policy/gaussian.hpp>

namespace diffnea {

/// Bounds on the step, samples an iteration, and when to stop.
struct ErepsOptions {
  int samples = 80;
  double epsilon = 0.5;
  double kappa = 0.5;
  int iterations = 100;
  double stop_std = 0.02;
  double least_std = 1e-3;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ErepsOptions", "How a search goes, and when it stops.");
    list.field("samples", &ErepsOptions::samples, "N, of an iteration.");
    list.field("epsilon", &ErepsOptions::epsilon, "KL bound of the reweighted samples.",
               {.unit = "nat"});
    list.field("kappa", &ErepsOptions::kappa, "KL(old ‖ new) bound of the Gaussian's update.",
               {.unit = "nat"});
    list.field("iterations", &ErepsOptions::iterations, "At most.");
    list.field("stop_std", &ErepsOptions::stop_std,
               "Done when every parameter's standard deviation is below.");
    list.field("least_std", &ErepsOptions::least_std, "The update keeps every direction's above.");
  }
};

/// Weights of samples by the dual g(η) = ηε + R_max + η log(1/N Σ exp((R_i − R_max)/η)), N and Σ
/// those of finite rewards.
struct Reweighting {
  /// [reward]. Where ε is more than taking the best alone costs, one that does so; where
  /// all rewards are equal any does, and it is the larger of 1 and |R|.
  double eta = 0.0;
  VecX<double> weights;            ///< (N), sum 1
  double kl = 0.0;                 ///< of the weights against uniform ones of the finite, ≤ ε [nat]
  double effective_samples = 0.0;  ///< 1/Σw²
};
/// @param rewards (N), finite or −∞ (weight 0)
/// @throws DataError if one is NaN or +∞ (says which), or none is finite; Error if not epsilon > 0
Reweighting reweight(const VecX<double>& rewards, double epsilon);
/// g(η) and g'(η) = ε − KL(η). @throws as reweight(); Error if not eta > 0
double ereps_dual(const VecX<double>& rewards, double epsilon, double eta, double* slope = nullptr);

/// The weighted maximum-likelihood Gaussian with KL(old ‖ new) ≤ kappa: as near to it as λ allows,
/// bisected on log λ:
///   μ' = (Σwθ + λμ)/(1 + λ),  Σ' = (Σw(θ−μ')(θ−μ')ᵀ + λΣ + λ(μ'−μ)(μ'−μ)ᵀ)/(1 + λ)
/// then every direction's standard deviation raised to least_std, which the bound includes. An old
/// one that has a direction below is floored by that direction's instead.
/// @param theta (N × d)  @param weights (N), sum 1
/// @param kl  of the update, written if given
/// @throws ShapeError; Error if a weight or kappa makes no sense
Gaussian bounded_update(const Gaussian& old, const RowMatX<double>& theta,
                        const VecX<double>& weights, double kappa, double least_std,
                        double* kl = nullptr);

/// What one iteration did.
struct ErepsIteration {
  int iteration = 0;
  double reward_mean = 0.0;
  double reward_best = 0.0;
  double eta = 0.0;
  double kl_samples = 0.0;
  double kl_update = 0.0;
  double entropy = 0.0;
  double effective_samples = 0.0;
  double largest_std = 0.0;
  double solved_share = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ErepsIteration", "One iteration of a search.", {.exact = true});
    list.in_memory("iteration", &ErepsIteration::iteration, "From 1.");
    list.field("reward_mean", &ErepsIteration::reward_mean, "Mean of the finite rewards.");
    list.field("reward_best", &ErepsIteration::reward_best, "Best reward so far.");
    list.field("eta", &ErepsIteration::eta, "Temperature of the weights.");
    list.field("kl_samples", &ErepsIteration::kl_samples,
               "As Reweighting::kl, at most ErepsOptions::epsilon.", {.unit = "nat"});
    list.field("kl_update", &ErepsIteration::kl_update,
               "KL(old ‖ new), at most ErepsOptions::kappa.", {.unit = "nat"});
    list.field("entropy", &ErepsIteration::entropy, "Of the new Gaussian.", {.unit = "nat"});
    list.field("effective_samples", &ErepsIteration::effective_samples, "1/Σw².");
    list.field("largest_std", &ErepsIteration::largest_std, "Of the new Gaussian's parameters.");
    list.field("solved_share", &ErepsIteration::solved_share,
               "Share of the samples that solve the task, where it says so.");
  }
};

/// The search itself: samples, rewards, the next Gaussian; can be stopped and resumed at any
/// iteration.
class Ereps {
 public:
  /// @throws Error if an option makes no sense
  Ereps(Gaussian start, const ErepsOptions& options, std::uint64_t seed);

  /// Samples of this iteration, (N × d): the same however often one asks, drawn from seed and
  /// iteration alone, so that a search goes on from what it saved to the same result.
  const RowMatX<double>& ask();
  /// @throws DataError naming iteration, sample and parameters of a reward that is NaN or +∞, or if
  /// all are −∞; ShapeError; the search is then as it was
  void tell(const VecX<double>& rewards);

  /// Whether a stop rule holds.
  bool done() const;
  const std::string& stop_reason() const;  ///< empty while it goes on
  /// The present distribution.
  const Gaussian& policy() const { return policy_; }
  const VecX<double>& best() const {
    return best_;
  }  ///< best sample so far; empty before the first
  /// What every iteration did.
  const std::vector<ErepsIteration>& history() const { return history_; }
  /// The same, to be resumed.
  std::vector<ErepsIteration>& history() { return history_; }
  /// As given.
  const ErepsOptions& options() const { return options_; }
  /// Of the samples.
  std::uint64_t seed() const { return seed_; }
  /// Iterations that are done.
  int iteration() const { return static_cast<int>(history_.size()); }

  /// Goes on from what was saved. @throws Error if it does not fit the options
  void restore(Gaussian policy, VecX<double> best, std::vector<ErepsIteration> history);

 private:
  void judge();  ///< whether to stop

  Gaussian policy_;
  ErepsOptions options_;
  std::uint64_t seed_;
  RowMatX<double> samples_;
  int sampled_for_ = -1;
  VecX<double> best_;
  std::vector<ErepsIteration> history_;
  std::string stopped_;
};

}  // namespace diffnea
