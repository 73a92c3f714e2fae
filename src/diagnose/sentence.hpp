#pragma once
/// The verdict as a sentence with numbers. Internal to diagnose/.

#include <diffnea/diagnose/finding.hpp>

namespace diffnea {

std::string sentence(const Finding& finding);

}  // namespace diffnea
