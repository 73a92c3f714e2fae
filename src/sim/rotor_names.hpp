#pragma once
/// What the rotor of an elastic joint and its spring are called in a MuJoCo document.

#include <string>

namespace diffnea::sim {

inline std::string rotor_name(const std::string& joint) { return "rotor of " + joint; }
inline std::string spring_name(const std::string& joint) { return "spring of " + joint; }

}  // namespace diffnea::sim
