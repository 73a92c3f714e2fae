#pragma once
/// What was learned as one self-contained HTML page: no network, printable.

#include <string>

#include <diffnea/runs/policy_result.hpp>

namespace diffnea {

/// The page, from what read_learn_run gives.
std::string learn_page(const LearnRun& run);

}  // namespace diffnea
