#pragma once
/// result.json of `learn` and `transfer` as described values: what their runs come to.

#include <optional>

#include <diffnea/runs/policy_result.hpp>

#include "runs/policy_json.hpp"

namespace diffnea {

/// One policy of `learn`.
struct LearnedRow {
  std::uint64_t seed = 0;
  std::string file;
  double expected = 0.0;
  bool solved = false;
  std::string stopped;
  std::optional<int> first_capture;
  long iterations = 0;
  long rollouts = 0;
  double seconds = 0.0;
  std::vector<ErepsIteration> curve;
  InDraws in_draws;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("LearnedRow", "A policy that was learned.");
    list.field("seed", &LearnedRow::seed, "Of the search.");
    list.field("file", &LearnedRow::file, "File of the policy.");
    list.field("expected", &LearnedRow::expected, "Reward of the mean in the model.");
    list.field("solved", &LearnedRow::solved, "The mean catches the ball in the model.");
    list.field("stopped", &LearnedRow::stopped, "Why the search ended; empty: interrupted.");
    list.field("first_capture", &LearnedRow::first_capture,
               "First iteration one of whose samples caught the ball; null: none.");
    list.field("iterations", &LearnedRow::iterations, "Of the search.");
    list.field("rollouts", &LearnedRow::rollouts, "Executed.");
    list.field("seconds", &LearnedRow::seconds, "Time that the search took.", {.unit = "s"});
    list.columns("curve", &LearnedRow::curve, "One value an iteration.");
    list.field("in_draws", &LearnedRow::in_draws, "With `--robust` alone: of the mean.",
               {.absent = true});
  }
};

/// result.json of `learn`.
struct LearnFile {
  std::string model;
  std::string controller;
  std::string fingerprint;
  TaskFile task;
  Share solved;
  std::optional<std::uint64_t> best;
  long rollouts = 0;
  double cpu_seconds = 0.0;
  double seconds = 0.0;
  int threads = 1;
  bool interrupted = false;
  std::vector<LearnedRow> policies;
  Reproduce reproduce;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Learn", "What was learned.");
    list.field("model", &LearnFile::model, "Name of the model that it was learned in.");
    list.field("controller", &LearnFile::controller,
               "Name of the model that the controller compensates gravity with.");
    list.field("fingerprint", &LearnFile::fingerprint,
               "SHA-256 of model, controller and options: the same one and the same seed give the "
               "same policy.");
    list.field("task", &LearnFile::task, "What was learned, and where.");
    list.field("solved", &LearnFile::solved, "Policies whose mean catches the ball in the model.",
               {.key = "summary.solved"});
    list.field("best", &LearnFile::best, "Seed of the best policy; null: there is none.",
               {.key = "summary.best"});
    list.field("rollouts", &LearnFile::rollouts, "Of all seeds.", {.key = "summary.rollouts"});
    list.field("cpu_seconds", &LearnFile::cpu_seconds, "Sum of the seeds' seconds.",
               {.unit = "s", .key = "summary.cpu_seconds"});
    list.field("seconds", &LearnFile::seconds, "Time that passed.",
               {.unit = "s", .key = "summary.seconds"});
    list.field("threads", &LearnFile::threads, "That seeds or rollouts were divided among.",
               {.key = "summary.threads"});
    list.field("interrupted", &LearnFile::interrupted,
               "It was stopped: policies are what was found until then.",
               {.key = "summary.interrupted"});
    list.field("policies", &LearnFile::policies, "In the order of the seeds.");
    list.field("reproduce", &LearnFile::reproduce, "Version, command and input files.");
  }
};

/// One execution in a world.
struct ExecutedRow {
  std::uint64_t noise_seed = 0;
  bool success = false;
  std::string outcome;
  std::string text;
  double reward = 0.0;
  double reward_wide = 0.0;
  std::string failure;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Execution", "One execution in the world.");
    list.field("noise_seed", &ExecutedRow::noise_seed, "Of the world's noise.");
    list.field("success", &ExecutedRow::success, "The ball ended in the cup.");
    list.field("outcome", &ExecutedRow::outcome, "How it ended.",
               {.choices = "in_cup|late|fell_out|rim|beside|missed|failed"});
    list.field("text", &ExecutedRow::text, "When, and by how much.");
    list.field("reward", &ExecutedRow::reward, "At the ε that was learned with.");
    list.field("reward_wide", &ExecutedRow::reward_wide, "At ε = 0.055 m².");
    list.field("failure", &ExecutedRow::failure,
               "Of the world's solver, or the limit that the motion breaks.",
               {.empty_is_null = true});
  }
};

/// One policy of `transfer`.
struct TransferredRow {
  std::uint64_t seed = 0;
  std::string file;
  double expected = 0.0;
  bool solved = false;
  ExecutedRow executed;
  PathError path_error;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("TransferredRow", "A policy that was executed.");
    list.field("seed", &TransferredRow::seed, "Of the search.");
    list.field("file", &TransferredRow::file, "File of the policy.");
    list.field("expected", &TransferredRow::expected, "Reward of the mean in the model.");
    list.field("solved", &TransferredRow::solved, "The mean catches the ball in the model.");
    list.embed(&TransferredRow::executed);
    list.field("path_error", &TransferredRow::path_error,
               "Between the ball's imagined and obtained path.");
  }
};

/// result.json of `transfer`.
struct TransferFile {
  std::string model;
  std::string controller;
  std::string world;
  std::optional<std::vector<std::string>> differences;
  std::string fingerprint;
  TaskFile task;
  Share transferred;
  std::optional<Share> repeated;
  std::optional<std::uint64_t> best;
  Share solved;
  double seconds = 0.0;
  bool interrupted = false;
  std::vector<std::uint64_t> seeds;
  std::vector<TransferredRow> policies;
  std::vector<ExecutedRow> repetitions;
  Reproduce reproduce;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Transfer", "What was executed elsewhere.");
    list.field("model", &TransferFile::model, "Name of the model that it was learned in.");
    list.field("controller", &TransferFile::controller,
               "Name of the model that the controller compensates gravity with.");
    list.field("world", &TransferFile::world, "As it was named.");
    list.field("differences", &TransferFile::differences,
               "Clauses on how the world may differ from its description; empty: not at all; null "
               "or missing: from an earlier version.");
    list.field("fingerprint", &TransferFile::fingerprint, "As of `learn`.");
    list.field("task", &TransferFile::task, "As of `learn`.");
    list.field("transferred", &TransferFile::transferred,
               "Executed policies that ended in the cup.", {.key = "summary.transferred"});
    list.field("repeated", &TransferFile::repeated,
               "Repetitions of the best that did; null: there were none.",
               {.key = "summary.repeated"});
    list.field("best", &TransferFile::best,
               "Seed: a success first, then the largest reward; null: every execution failed.",
               {.key = "summary.best"});
    list.field("solved", &TransferFile::solved, "Policies that catch the ball in the model.",
               {.key = "summary.solved"});
    list.field("seconds", &TransferFile::seconds, "Time that passed.",
               {.unit = "s", .key = "summary.seconds"});
    list.field("interrupted", &TransferFile::interrupted,
               "It was stopped: what had been executed until then.",
               {.key = "summary.interrupted"});
    list.field("seeds", &TransferFile::seeds,
               "Of all policies; an interrupted run has executed the first of them.");
    list.field("policies", &TransferFile::policies, "In the order of the seeds.");
    list.field("repetitions", &TransferFile::repetitions, "Of the best policy, with noise.");
    list.field("reproduce", &TransferFile::reproduce, "Version, command and input files.");
  }
};

}  // namespace diffnea
