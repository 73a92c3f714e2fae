#pragma once
/// What was learned, as text for a terminal.

#include <string>

#include <diffnea/runs/policy_result.hpp>

namespace diffnea {

/// One sentence: how many seeds solve the task in the model, how long one took, rollouts.
std::string learn_headline(const LearnRun& run);

/// A table of the seeds, then the headline.
std::string learn_text(const LearnRun& run);

}  // namespace diffnea
