#pragma once
/// What learned policies did in another world, as text for a terminal.

#include <string>

#include <diffnea/runs/policy_result.hpp>

namespace diffnea {

/// One sentence: how many policies succeed there, with its interval, and how often the best does.
std::string transfer_headline(const TransferRun& run);

/// One sentence on how the world differs from its description; empty where the run does not know.
std::string world_sentence(const TransferRun& run);

/// A table of the policies, then headline and world.
std::string transfer_text(const TransferRun& run);

}  // namespace diffnea
