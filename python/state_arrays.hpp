#pragma once
/// Arrays of a model's states: how many numbers each has.

#include <diffnea/model/free_base.hpp>
#include <diffnea/model/model.hpp>

#include "arrays.hpp"

namespace diffnea::python {

/// Lengths of positions and of all else: with a free base its pose and its twist come first.
struct Lengths {
  explicit Lengths(const Model& model)
      : floats(model.free_base),
        q(static_cast<long>(moving_links(model).size()) + (floats ? kBasePositions : 0)),
        v(static_cast<long>(moving_links(model).size()) + (floats ? kBaseVelocities : 0)) {}
  NamedArray positions(const char* name, const py::object& array) const {
    return {name, array, q, floats ? "the base's pose of 7, then one value per joint" : kPerJoint};
  }
  NamedArray velocities(const char* name, const py::object& array) const {
    return {name, array, v, floats ? "6 of the base, then one value per joint" : kPerJoint};
  }
  static constexpr const char* kPerJoint = "one value per joint";
  bool floats;
  long q, v;
};

}  // namespace diffnea::python
