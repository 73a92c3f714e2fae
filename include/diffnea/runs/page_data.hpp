#pragma once
/// Data of RUN/report.html, beside its words: {"result": …, "series": …} with those keys of
/// result.json and series.json that its script draws from (src/report/draw.js), thinned to 4 MB.

#include <string>
#include <vector>

#include <diffnea/runs/diagnosis.hpp>
#include <diffnea/runs/policy_result.hpp>
#include <diffnea/runs/result.hpp>

namespace diffnea {

std::string page_data(const FitRun& run);       ///< all series and the ball
std::string page_data(const DiagnoseRun& run);  ///< series but for q, qd and qdd; plots; the ball
/// Curves of all seeds, the movements of some. @param shown  indices of policies
std::string page_data(const LearnRun& run, const std::vector<int>& shown);
/// Rewards of all executions, the movements of some. @param shown  indices of executions
std::string page_data(const TransferRun& run, const std::vector<int>& shown);

}  // namespace diffnea
