#pragma once
/// RUN/result.json and RUN/series.json of a diagnosis (docs/schema/diagnose.md).

#include <diffnea/diagnose/finding.hpp>
#include <diffnea/io/result.hpp>

namespace diffnea {

/// A diagnosis as RUN/ holds it.
struct DiagnoseRun {
  Finding finding;
  Reproduce reproduce;
};

/// Schema "diffnea/diagnose/1". A number that does not exist is null.
std::string diagnose_result_json(const DiagnoseRun& run);

/// Schema "diffnea/diagnose-series/1": held-out torque of every joint, measured and as both models
/// predict it, and the joint's motion, rounded to 6 digits.
std::string diagnose_series_json(const Finding& finding);

}  // namespace diffnea
