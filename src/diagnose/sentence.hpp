#pragma once
/// The verdict as a sentence with numbers. Internal to diagnose/.

#include <diffnea/diagnose/finding.hpp>

namespace diffnea {

/// How much of the catalogue a sentence speaks of.
enum class Tried { kAll, kSome, kNothing };

std::string sentence(const Finding& finding, Tried tried = Tried::kAll);

}  // namespace diffnea
