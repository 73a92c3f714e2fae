#pragma once
/// An audit as text for a terminal.

#include <string>

#include <diffnea/runs/audit_result.hpp>

namespace diffnea {

/// A table of the faults, each with its evidence, then what could not be checked and why.
std::string audit_text(const AuditReport& report);

}  // namespace diffnea
