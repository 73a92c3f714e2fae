#pragma once
/// Stiffness and damping of what swings behind its encoder. Internal to diagnose/.
///
/// A column off the resonance swings where the robot does not, so that χ² over a stiffness has a
/// valley as narrow as the resonance, and beside it nothing that leads there. A broad one leads near
/// it: with much damping first, then with less, stiffnesses are tried about the best so far, as
/// close to each other as the resonance is wide.

#include <vector>

#include "diagnose/search.hpp"

namespace diffnea {

/// @param term  of an encoder at the motor
/// @return the term at the best of these beside `terms`, which stay as they are; as it is where no
///   spring is in it
Term narrowed(const Search& search, const Term& term, const std::vector<Term>& terms);

}  // namespace diffnea
