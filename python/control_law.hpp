#pragma once
/// Laws of the joint controller by name.

#include <diffnea/sim/controller.hpp>

#include "choice.hpp"

namespace diffnea::python {

inline const std::map<std::string, ControlLaw> kLaws = {
    {"pd", ControlLaw::kPd}, {"computed_torque", ControlLaw::kComputedTorque}};

inline const char* law_name(ControlLaw law) {
  return law == ControlLaw::kPd ? "pd" : "computed_torque";
}

}  // namespace diffnea::python
