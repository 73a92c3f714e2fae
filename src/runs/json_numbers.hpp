#pragma once
/// How result files write numbers, and what all of them hold.

#include <diffnea/runs/result.hpp>

#include "io/json.hpp"

namespace diffnea::io {

/// What does not exist, a NaN here, is null there.
Json number(double x);
/// To 6 digits: what a plot can show, in a third of the space.
Json rounded(const std::vector<double>& values);
Json reproduce(const Reproduce& r);
/// A whole file. @param indent  −1: one line
std::string text(const Json& json, int indent);

}  // namespace diffnea::io
