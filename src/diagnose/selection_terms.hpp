#pragma once
/// Sets of terms as a selection handles them, and when one effect counts as another. Internal to
/// diagnose/.

#include <set>

#include "diagnose/search.hpp"

namespace diffnea {

constexpr double kNoWorse = 6.0;     ///< ΔBIC, no strong evidence yet (Kass and Raftery 1995)
constexpr double kStandsIn = 0.5;  ///< share of a cause's torque that a rival takes over, at least
constexpr double kChild = 0.98;    ///< of a cause's column that a more general effect reproduces
/// ΔBIC of a cause whose size the recording does not tell, at least: any noise has some shape. A
/// motor behind a spring of any stiffness has that of whatever is late.
constexpr double kLeastSizeless = 50.0;
constexpr int kRivals = 7;  ///< candidates whose shapes are refined in the place of a cause

std::vector<Term> without(const std::vector<Term>& terms, std::size_t i);
std::vector<Term> joined(std::vector<Term> terms, Term more);

/// Candidates that terms are of.
std::set<int> names(const std::vector<Term>& terms);

/// Accepted, a tilt is in the base's columns, too: without it, they would be those of no model.
bool stays(const Term& term);

/// Tells whether a clock of all joints that the last of the terms shifts, or a torque of all drives
/// that it makes late, is with all that shifts it where a drive that samples and holds its torques
/// may have it; or another of the terms shifts them already: a clock and a delay of all are one.
bool is_no_shift(const Search& search, const std::vector<Term>& terms);

/// Tells whether something is late by less than one of the terms, a spring at its joint, takes to
/// swing (1/ω): how that is excited and fades is known no better.
bool is_of_swing(const Search& search, const Term& late, const std::vector<Term>& terms);

/// Tells whether terms suffice only where torques act at instants that no drive has, and none of
/// them may take that over.
bool shifts_torques(const Search& search, std::vector<Term> terms);

}  // namespace diffnea
