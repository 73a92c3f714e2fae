#pragma once
/// An audit of files, and what `diffnea audit` prints with --json (docs/schema/audit.md).

#include <filesystem>
#include <string>
#include <vector>

#include <diffnea/recording/audit.hpp>

namespace diffnea {

/// Reads recordings of one robot with their sidecars, and audits them. What other readers refuse, a
/// torque that is zero throughout and many rows that cannot be true, is a fault here.
/// @param passive  joints whose torque is known to be zero, beside those of the sidecars and limits
/// @throws FileError, DataError if a file cannot be read; DataError if its joints are not those of
///         limits.joints (where there are any)
AuditReport audit_files(const std::vector<std::filesystem::path>& files,
                        const AuditLimits& limits = {},
                        const std::vector<std::string>& passive = {});

/// Schema "diffnea/audit/1". A number that does not exist is null.
/// @param data   the recordings, as they were named
/// @param model  the model's name; empty: none was given
std::string audit_result_json(const AuditReport& report, const std::vector<std::string>& data,
                              const std::string& model = "");

}  // namespace diffnea
