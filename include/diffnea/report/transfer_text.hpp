#pragma once
/// What learned policies did in another world, as text for a terminal.

#include <string>

#include <diffnea/runs/policy_result.hpp>

namespace diffnea {

/// One sentence: how many policies succeed there, with its interval, and how often the best does.
std::string transfer_headline(const TransferRun& run);

/// A table of the policies, then the headline.
std::string transfer_text(const TransferRun& run);

}  // namespace diffnea
