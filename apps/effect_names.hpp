#pragma once
/// Effects as commands take them: a list that is split at commas, though a place may hold one.

#include <string>
#include <vector>

namespace diffnea::apps {

/// Puts together again what a comma split: `transmission_coupling@joint2`, `joint3` is one effect
/// at a pair of joints.
std::vector<std::string> with_pairs(const std::vector<std::string>& words);

}  // namespace diffnea::apps
