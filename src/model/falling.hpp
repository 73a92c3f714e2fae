#pragma once
/// A robot in flight for code that knows fixed bases alone. Internal.

#include <diffnea/model/model.hpp>

namespace diffnea {

/// A robot that floats as its joints feel it in free fall with the base held: without weight. The
/// base gives way to the joints in truth, which makes them lighter. Another robot is returned as it
/// is.
inline Model falling(Model model) {
  if (model.free_base) model.gravity = {0.0, 0.0, 0.0};
  model.free_base = false;
  return model;
}

}  // namespace diffnea
