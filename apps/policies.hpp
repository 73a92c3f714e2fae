#pragma once
/// What `learn`, `transfer` and `experiment` share: options of the task, and the search with its
/// checkpoints.

#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include <diffnea/experiment/seeds.hpp>
#include <diffnea/runs/policy_result.hpp>

#include "common.hpp"
#include "progress.hpp"

namespace diffnea::apps {

/// Options of a ball in a cup that is learned.
struct PolicyOptions {
  LearnOptions learn;
  std::optional<double> string;  ///< nominal length [m]
  int seeds = 1;
  bool fresh = false;
  bool robust = false;
  int draws = 64;                 ///< with robust
  std::vector<std::string> vary;  ///< PARAMETER=LOW:HIGH
  std::vector<double> start, kp, kd;

  /// For the model alone, whatever was asked for.
  void plain() {
    robust = false;
    vary.clear();
    learn.robust = {};
  }
};
void add_policy_options(CLI::App& command, PolicyOptions& options);

/// The task in a model, as the options want it. @throws as ball_in_cup
BallInCup task_of(const Model& model, const Model& controller, const PolicyOptions& options);

/// "no policy catches …" where none does, else empty.
std::string why_not_usable(const LearnRun& run);

/// Learns all seeds, with a line of progress and a checkpoint a seed in `folder`/checkpoints.
/// @return `interrupted` set if Ctrl-C came
/// @throws FileError if another process learns there, or the folder holds policies of other seeds
LearnRun learn_with_checkpoints(const BallInCup& task, const PolicyOptions& options,
                                const CommonOptions& common, const std::filesystem::path& folder,
                                ProgressLine& line);

}  // namespace diffnea::apps
