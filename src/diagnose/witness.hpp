#pragma once
/// On what does the rest depend? Smooth functions of one or two measured variables against what
/// base and named effects leave. Internal to diagnose/.

#include "diagnose/held_out.hpp"

namespace diffnea {

struct WitnessScore {
  int joint = -1;                      ///< degree of freedom whose torque error it is
  std::vector<std::string> variables;  ///< channel names
  double delta_bic = 0.0;
  double share = 0.0;      ///< of the joint's residual mean square
  HeldOutChange held_out;  ///< of all joints' errors
};

/// The best set of variables of every joint that passes ΔBIC > accept, takes more than the base's
/// dry friction may be wrong by, and helps on held-out data, best first.
/// @param names  of the joints
std::vector<WitnessScore> find_witnesses(const Search& search, const std::vector<Term>& terms,
                                         const HeldOut& held_out,
                                         const std::vector<std::string>& names, double accept);

}  // namespace diffnea
