#pragma once
/// What `transfer` and `experiment` share: policies executed in a MuJoCo world.

#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include <diffnea/runs/policy_result.hpp>
#include <diffnea/worlds/world.hpp>

#include "common.hpp"
#include "progress.hpp"

namespace diffnea::apps {

struct TransferOptions {
  std::string world = kBallInCupWorld;
  std::string rope;              ///< overrides the world's
  std::optional<double> string;  ///< of the world [m]; none: the policies' nominal
  int repetitions = 10;
  bool record = false;               ///< of every policy, what sensors see of it
  MujocoSimulatorOptions simulator;  ///< of repetitions
  TransferOptions() {
    simulator.torque_noise = 0.1;
    simulator.encoder_noise = 1e-3;
  }
};
void add_transfer_options(CLI::App& command, TransferOptions& options);

/// @return `interrupted` set if Ctrl-C came
TransferRun transfer_policies(const LearnRun& learned, const TransferOptions& options,
                              const CommonOptions& common, ProgressLine& line);

/// Executes every policy once more, before sensors, each with noise of its own:
/// `recording_<seed>.csv` and what columns cannot hold, in `folder`.
/// @param run  its `interrupted` is set if Ctrl-C came
/// @return what went wrong, a line each; the executions of `run` are none the worse for it
std::string record_policies(TransferRun& run, const TransferOptions& options,
                            const CommonOptions& common, const std::filesystem::path& folder,
                            ProgressLine& line);

/// The world that the options name, and its name.
std::string world_name(const TransferOptions& options);
WorldSpec world_of(const TransferOptions& options);

}  // namespace diffnea::apps
