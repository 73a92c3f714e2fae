#pragma once
/// From a candidate's score to a term: its shapes moved to where they explain most, and whether
/// what comes out can be the effect that it is called. Internal to diagnose/.

#include "diagnose/search.hpp"

namespace diffnea {

/// A term with its shapes moved from where they are to where they explain most beside `terms`
/// (Gauss–Newton in their logarithms), its choices as they are.
Term with_shapes_refined(const Search& search, Term term, const std::vector<Term>& terms);
/// The same with the best of its choices, each with the shapes that suit it.
Term refined(const Search& search, Term term, const std::vector<Term>& terms);

/// Of a size that no robot has, whatever stands beside it: a torque constant off by half.
bool impossible(const Term& term);

/// Neither impossible nor a failed fit, like a torque as large as the joint's whole torque.
bool plausible(const Search& search, const Term& term);

}  // namespace diffnea
