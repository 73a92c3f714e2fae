#pragma once
/// RUN/result.json and RUN/series.json of `learn` and `transfer`, both ways (docs/schema/learn.md,
/// transfer.md).

#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/experiment/ball_in_cup.hpp>
#include <diffnea/experiment/stick_figure.hpp>
#include <diffnea/runs/result.hpp>

namespace diffnea {

/// What `diffnea learn` found: one policy a seed.
struct LearnRun {
  BallInCup task;                            ///< with options completed
  std::vector<LearnedPolicy> policies = {};  ///< in the order of the seeds, without those not begun
  std::vector<RolloutTrace> imagined = {};   ///< of every policy's mean, in the model
  std::vector<StickFigure> figures = {};  ///< of those, as they were read; the writer computes them
  int threads = 1;                        ///< that seeds or rollouts were divided among
  double seconds = 0.0;                   ///< that passed
  bool interrupted = false;  ///< stopped by the user: policies are what was found until then
  Reproduce reproduce = {};  ///< the command that learned them
};

/// What `diffnea transfer` saw: every policy once, the best one again and again.
struct TransferRun {
  BallInCup task;                            ///< as it was learned
  std::vector<LearnedPolicy> policies = {};  ///< all that were learned
  std::vector<RolloutTrace> imagined = {};   ///< of their means, in the model; no rows: not kept
  std::string world;                         ///< as it was named
  /// Clauses on how the world may differ from its description; none: it is its description. Not
  /// given in files of earlier versions.
  std::optional<std::vector<std::string>> differences = {};
  std::vector<Execution> executions = {};  ///< of the policies, without noise
  int best = -1;  ///< of the executions: a success first, then by reward; −1: none
  std::vector<Execution> repetitions = {};  ///< of the best, with noise
  /// Of imagined and executions, as they were read; the writer computes them.
  ///@{
  std::vector<StickFigure> imagined_figures = {}, figures = {};
  ///@}
  double seconds = 0.0;      ///< that passed
  bool interrupted = false;  ///< stopped by the user: what had been executed until then
  Reproduce reproduce = {};  ///< the command that executed them
};

/// k of n, and its 95 % interval (Wilson 1927).
struct Share {
  int k = 0;
  int n = 0;
  double low = 0.0;
  double high = 1.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Share", "k of n, and its 95 % interval (Wilson 1927).");
    list.field("k", &Share::k, "How many of the n.");
    list.field("n", &Share::n, "0: nothing is known, the interval is 0 to 1.");
    list.derived(
        "share",
        [](const Share& s) {
          return s.n > 0 ? static_cast<double>(s.k) / s.n
                         : std::numeric_limits<double>::quiet_NaN();
        },
        "k / n; null where n is 0.");
    list.field("low", &Share::low, "Lower end of the interval of k/n.");
    list.field("high", &Share::high, "Upper end of the interval of k/n.");
  }
};
/// k of n, with its interval.
Share share_of(int k, int n);

/// The policy that succeeds in the model with the largest reward there, or else the largest; −1:
/// none.
int best_policy(const std::vector<LearnedPolicy>& policies);
/// First iteration one of whose samples caught the ball, from 1; 0: none.
int first_capture(const LearnedPolicy& policy);

/// Between the ball's imagined and obtained path [m]; NaN if one has no rows.
struct PathError {
  double at_capture = 0.0;
  double rms = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("PathError", "Between the ball's imagined and obtained path.");
    list.field("at_capture", &PathError::at_capture,
               "In the last row before the model catches it; null: never.", {.unit = "m"});
    list.field("rms", &PathError::rms, "Until then, or to the end of the shorter.", {.unit = "m"});
  }
};
/// Of both at 100 rows a second.
PathError path_error(const RolloutTrace& imagined, const RolloutTrace& obtained);

/// "in_cup", "late", "fell_out", "rim", "beside", "missed"; "failed" where `failure` says why.
std::string outcome_word(const Execution& execution);

std::string learn_result_json(const LearnRun& run);        ///< schema "diffnea/learn/1"
std::string learn_series_json(const LearnRun& run);        ///< schema "diffnea/learn-series/1"
std::string transfer_result_json(const TransferRun& run);  ///< schema "diffnea/transfer/1"
std::string transfer_series_json(const TransferRun& run);  ///< schema "diffnea/transfer-series/1"

/// Reads a folder that `learn` left: result.json, series.json, model.json, controller.json,
/// policy_<seed>.json. Traces have the rate and the channels of series.json. @throws FileError,
/// ModelError naming file and key
LearnRun read_learn_run(const std::filesystem::path& folder);
/// A run of `diffnea transfer` from its folder. @throws FileError, ModelError
TransferRun read_transfer_run(const std::filesystem::path& folder);

}  // namespace diffnea
