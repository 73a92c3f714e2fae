#pragma once
/// Test whether runs differ by more than what hangs together within one. Internal to diagnose/.

#include <cstdint>
#include <vector>

#include "diagnose/evidence.hpp"

namespace diffnea {

/// Tells whether some run has more than one block of a second: one alone says nothing of how much
/// its mean would have been another in the next.
bool tells_sessions(const Evidence& evidence);

/// Means of an error over blocks of a second are drawn anew for all runs (permutation test of the
/// variance between runs): the share of draws in which the runs differ as much.
/// @param errors  (rows()) @param used  rows that count
/// @param joint   index into evidence.joints()
double sessions_alike(const Evidence& evidence, const VecX<double>& errors,
                      const std::vector<bool>& used, long joint, std::uint64_t seed);

}  // namespace diffnea
