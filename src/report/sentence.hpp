#pragma once
/// A diagnosis in words with numbers: for how long the simulation follows the robot, then the
/// verdict.

#include <string>

#include <diffnea/diagnose/finding.hpp>

namespace diffnea::report {

std::string sentence(const Finding& finding);
/// Words on an error by its witness: "depends on q_elbow and qd_elbow", "comes in bursts …".
std::string witness_clause(const Witness& witness);
/// Share of the held-out mean square beyond that of the noise, 1, that is removed: 0 … 1.
double beyond_noise(const Gain& gain);

}  // namespace diffnea::report
