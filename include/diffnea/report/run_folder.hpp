#pragma once
/// RUN/ of a fit or of a diagnosis: its files, written together.

#include <string>
#include <vector>

#include <diffnea/io/diagnosis.hpp>
#include <diffnea/io/result.hpp>
#include <diffnea/io/result_folder.hpp>

namespace diffnea {

/// Everything that a fit may leave in RUN/ (docs/schema/identify.md).
inline const std::vector<std::string> kFitRunFiles{"result.json", "series.json", "model.json",
                                                   "model.urdf",  "model.xml",   "report.html"};

/// Writes all of them into the folder and publishes it. Where the model came from a URDF or an MJCF
/// that is still there, the fitted one is written in that form too.
/// @param run  gains notes on what that form cannot hold
/// @throws FileError
void publish_fit_run(FitRun& run, ResultFolder& folder);

/// Everything that a diagnosis may leave in RUN/ (docs/schema/diagnose.md). A fit's files go: where
/// result.json is, the rest belongs to it.
inline const std::vector<std::string> kDiagnoseRunFiles = kFitRunFiles;

/// Writes result.json, series.json and the extended model.json into the folder and publishes it.
/// @throws FileError
void publish_diagnose_run(const DiagnoseRun& run, ResultFolder& folder);

}  // namespace diffnea
