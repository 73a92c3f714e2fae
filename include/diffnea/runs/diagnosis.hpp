#pragma once
/// RUN/result.json and RUN/series.json of a diagnosis, both ways (docs/schema/diagnose.md).

#include <diffnea/diagnose/finding.hpp>
#include <diffnea/runs/result.hpp>

namespace diffnea {

/// A diagnosis as RUN/ holds it.
struct DiagnoseRun {
  Finding finding;  ///< result of diagnose()
  Reproduce reproduce;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Finding", "What a model lacks, with evidence, rivals and the gain.",
              {.files = kInResult});
    list.embed(&DiagnoseRun::finding);
    list.field("reproduce", &DiagnoseRun::reproduce, "Version, command and input files.",
               {.optional = true});
  }
};

/// Schema "diffnea/diagnose/1". A number that does not exist is null.
std::string diagnose_result_json(const DiagnoseRun& run);

/// Schema "diffnea/diagnose-series/1": held-out torque of every joint, measured and as both models
/// predict it, the joint's motion, the ball's path, and the curves of the evidence; rounded to 6
/// digits, at most 4000 points of each joint.
/// @throws ModelError if a column of the path has another length than its time
std::string diagnose_series_json(const Finding& finding);

/// Reads what the two functions above left in a folder. Without series.json there are no series and
/// no plots; the model is its name alone (model.json holds it).
/// @throws FileError, ModelError naming file and key; for a result of another kind, naming its
/// schema
DiagnoseRun read_diagnose_run(const std::filesystem::path& folder);

}  // namespace diffnea
