#pragma once
/// What effects there are, for people and for programs: what `diffnea effects` prints.

#include <string>

namespace diffnea {

/// One block an effect: formula, place, parameters with units, signs and initial values.
std::string effects_text();

/// The same as JSON, schema diffnea/effects/1.
std::string effects_json();

}  // namespace diffnea
