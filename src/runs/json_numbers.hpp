#pragma once
/// How result files write numbers.

#include <string>
#include <vector>

#include "io/json.hpp"

namespace diffnea::io {

/// What does not exist, a NaN here, is null there.
Json number(double x);
/// To 6 digits: what a plot can show, in a third of the space.
Json rounded(const std::vector<double>& values);
/// A whole file. @param indent  −1: one line
std::string text(const Json& json, int indent);

}  // namespace diffnea::io
