#pragma once
/// What causes gain on held-out data.

#include <string>

#include <diffnea/runs/diagnosis.hpp>

namespace diffnea::report {

/// From the base model's error through what each cause removes by itself to the noise floor.
std::string waterfall(const Finding& finding);
/// Errors of every joint, and of a ball in mm.
std::string joint_table(const Finding& finding);

}  // namespace diffnea::report
