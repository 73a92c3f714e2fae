#pragma once
/// The effects of a model's draws as a pack of worlds simulates them: with memory or of one
/// instant, at links or at motors behind springs. Internal.

#include <vector>

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/hidden_motor.hpp>
#include <diffnea/model/model.hpp>

#include "sim/pack_world.hpp"

namespace diffnea::sim {

/// A draw's effects by the side of the springs that they act on.
struct DrawnEffects {
  Model model;
  ExtendedTree tree;
  std::vector<BoundEffect> drives;         ///< with memory (sim/pack_drives.hpp)
  std::vector<BoundEffect> links, motors;  ///< of one instant
  MotorShares shares;
};

/// Effects and where they act: the same in all draws.
std::vector<std::pair<std::string, std::string>> names_and_places(
    const std::vector<BoundEffect>& effects);

/// @throws ModelError always: the effect is not simulated here
[[noreturn]] void refuse(const Model& model, const BoundEffect& e);

/// @throws ModelError for an effect that is not simulated here, draws that differ in more than
///         numbers
std::vector<DrawnEffects> drawn_effects(const std::vector<Model>& draws);

}  // namespace diffnea::sim
