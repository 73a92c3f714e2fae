#pragma once
/// A URDF from nothing but a model: for models that came in another form.

#include <string>
#include <vector>

#include <diffnea/model/model.hpp>

namespace diffnea::io {

/// Links, joints, inertias, limits, damping and friction; frames become links without inertia. A
/// link `world` is put below what stands elsewhere than at the origin, or moves against it.
/// @param notes  gains what a URDF cannot express, for the user
std::string draw_urdf(const Model& model, std::vector<std::string>& notes);

}  // namespace diffnea::io
