#pragma once
/// Drives of a robot that follows commands, beside those of its description.

#include <limits>
#include <string>

#include <diffnea/core/fields.hpp>

namespace diffnea {

/// A number of a joint's drive, rotor or friction that the recordings refute in the description.
struct RefutedNumber {
  std::string name;
  std::string unit;
  double described = std::numeric_limits<double>::quiet_NaN();
  double value = 0.0;
  double std = 0.0;
  double moves = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("RefutedNumber",
              "A number of a joint's drive, rotor or friction that the recordings refute in the "
              "description.");
    list.field("name", &RefutedNumber::name, "``elbow.position_servo.dead_band``.");
    list.field("unit", &RefutedNumber::unit, "SI, as effects write it; ``1``: none.");
    list.field("described", &RefutedNumber::described,
               "Of the model as it came; null: it has no such part.", {.optional = true});
    list.field("value", &RefutedNumber::value, "As fitted, beside the causes.");
    list.field("std", &RefutedNumber::std, "Standard error.");
    list.field("moves", &RefutedNumber::moves,
               "Root mean square by which that moves the joint, to first order, over the noise of "
               "its encoder.");
  }
};

}  // namespace diffnea
