#pragma once
/// What base and accepted effects leave because their columns are not exact: filters, the reference
/// model, and dry friction, of which no function of the motion tells how it turns. Internal to
/// diagnose/.

#include "diagnose/search.hpp"

namespace diffnea {

/// χ² that `term` may remove of what base and `terms` leave because their columns are not exact: of
/// each joint no more than goes with the term's torque there (Cauchy's inequality). That is (2 %)²
/// of what `terms` remove, where one of them is dry friction (4 %)²; (1 %)² of the base's dry
/// friction, more where `term` is like friction and the joint turns often; what is assumed for
/// noise (white_noise()), all along; and of a spring before a motor, what noise that moves the
/// joint gives it.
double inexact_at(const Search& search, const Term& term, const std::vector<Term>& terms);

/// χ² that the base leaves at each of evidence().joints() because the torque of its dry friction is
/// not exact: no function of the motion tells it.
/// @param of_late_turns  what passes for other functions of the velocity is more
VecX<double> inexact_friction(const Search& search, const std::vector<Term>& terms,
                              bool of_late_turns);

}  // namespace diffnea
