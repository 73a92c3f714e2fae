#pragma once
/// Parts that the pages of all runs have.

#include <string>
#include <vector>

#include <diffnea/runs/result.hpp>

namespace diffnea::report {

/// A list of texts.
std::string html_list(const std::vector<std::string>& items);
/// The command as a shell takes it, and the files with their checksums.
std::string reproduce(const Reproduce& r);

}  // namespace diffnea::report
