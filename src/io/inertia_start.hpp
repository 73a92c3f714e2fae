#pragma once
/// Inertias to begin with, of a description that states none.

#include <diffnea/model/model.hpp>

namespace diffnea::io {

/// Gives every moving link a mass by the distance of its joints, and notes it, if no moving link
/// states an inertia. A fit needs masses of the right order to begin with, and to know how far from
/// them the true ones may well be.
void start_from_geometry(Model& model);

}  // namespace diffnea::io
