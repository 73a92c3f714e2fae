#pragma once
/// RUN/ of a fit, a diagnosis, a search or a transfer: its files, written together.

#include <filesystem>
#include <string>
#include <vector>

#include <diffnea/runs/ball_network_file.hpp>
#include <diffnea/runs/diagnosis.hpp>
#include <diffnea/runs/policy_result.hpp>
#include <diffnea/runs/result.hpp>
#include <diffnea/runs/result_folder.hpp>

namespace diffnea {

/// Everything that a run may leave in RUN/ (docs/schema/identify.md, diagnose.md, learn.md,
/// transfer.md), but for policy_<seed>.json and recording_<seed>.csv with its .json.
inline const std::vector<std::string> kRunFiles{
    "result.json",     "series.json", "model.json",        "model.urdf",    "model.xml",
    "controller.json", "report.html", kNextExperimentFile, kBallNetworkFile};

/// What publishing would lose: another command's result, or files of these names that diffnea did
/// not leave. Call it before the work. @param command  whose run it will be: "identify"
/// @throws FileError naming what is there
void check_run_folder(const std::filesystem::path& folder, const std::string& command);

/// Writes all of them into the folder and publishes it. Where the model came from a URDF or an MJCF
/// that is still there, the fitted one is written in that form too.
/// @param run  gains notes on what that form cannot hold
/// @throws FileError
void publish_fit_run(FitRun& run, ResultFolder& folder);

/// The same for a diagnosis and its extended model.
void publish_diagnose_run(DiagnoseRun& run, ResultFolder& folder);

/// Policies, models, series, page. Policies of seeds that an earlier run had go.
void publish_learn_run(const LearnRun& run, ResultFolder& folder);
/// The same for executions.
void publish_transfer_run(const TransferRun& run, ResultFolder& folder);

}  // namespace diffnea
