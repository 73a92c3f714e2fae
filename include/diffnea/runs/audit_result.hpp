#pragma once
/// An audit of files, and what `diffnea audit` prints with --json (docs/schema/audit.md).

#include <filesystem>
#include <string>
#include <vector>

#include <diffnea/recording/audit.hpp>

namespace diffnea {

/// Reads recordings of one robot with their sidecars, and audits them. What other readers refuse, a
/// torque that is zero throughout and many rows that cannot be true, is a fault here.
/// @param options  of each file; none: what their sidecars say
/// @throws FileError, DataError if a file cannot be read; DataError if its joints are not those of
///         limits.joints (where there are any)
AuditReport audit_files(const std::vector<std::filesystem::path>& files, AuditLimits limits = {},
                        const std::vector<ReadOptions>& options = {});

/// An audit as `diffnea audit` prints it.
struct AuditRun {
  AuditReport report;  ///< faults and checks
  std::vector<std::string> data;
  std::string model;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("AuditReport", "Faults of the channels, and what was checked.");
    list.field("data", &AuditRun::data, "The recordings, as they were named.");
    list.field("model", &AuditRun::model, "The model's name; empty: none was given.",
               {.empty_is_null = true});
    list.embed(&AuditRun::report);
  }
};

/// Schema "diffnea/audit/1". A number that does not exist is null.
std::string audit_result_json(const AuditRun& run);

}  // namespace diffnea
