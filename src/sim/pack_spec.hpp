#pragma once
/// What a pack of worlds simulates, in the pack's own terms, of a model's draws and the
/// controller's model. Internal.

#include <vector>

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/sim/model_simulator.hpp>

#include "sim/pack_world.hpp"

namespace diffnea::sim {

/// @throws ModelError for what is not simulated here, draws that differ in more than numbers, a
///         network that cannot move this ball
PackSpec pack_spec(const std::vector<Model>& draws, const Model& controller,
                   const ModelSimulatorOptions& options);

}  // namespace diffnea::sim
