#pragma once
/// From a candidate's score to a term: its shapes moved to where they explain most, and whether
/// what comes out can be the effect that it is called. Internal to diagnose/.

#include "diagnose/search.hpp"

namespace diffnea {

/// The candidate of a score, its shapes refined beside `terms` (Gauss–Newton in their logarithms),
/// with the best of its choices.
Term refined(const Search& search, const Score& score, const std::vector<Term>& terms);
/// The same from a term's own shapes.
Term refined(const Search& search, Term term, const std::vector<Term>& terms);

/// Of a size that no robot has, whatever stands beside it: a torque constant off by half.
bool impossible(const Term& term);

/// Neither impossible nor a failed fit, like a torque as large as the joint's whole torque.
bool plausible(const Search& search, const Term& term);

}  // namespace diffnea
