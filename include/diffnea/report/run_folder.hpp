#pragma once
/// RUN/ of a fit or a diagnosis: its files, written together.

#include <string>
#include <vector>

#include <diffnea/io/diagnosis.hpp>
#include <diffnea/io/result.hpp>
#include <diffnea/io/result_folder.hpp>

namespace diffnea {

/// Everything that a run may leave in RUN/ (docs/schema/identify.md, diagnose.md).
inline const std::vector<std::string> kRunFiles{"result.json",      "series.json", "model.json",
                                                "model.urdf",       "model.xml",   "report.html",
                                                kNextExperimentFile};

/// Writes all of them into the folder and publishes it. Where the model came from a URDF or an MJCF
/// that is still there, the fitted one is written in that form too.
/// @param run  gains notes on what that form cannot hold
/// @throws FileError
void publish_fit_run(FitRun& run, ResultFolder& folder);

/// The same for a diagnosis and its extended model.
void publish_diagnose_run(DiagnoseRun& run, ResultFolder& folder);

}  // namespace diffnea
