#pragma once
/// Limbs: joints whose motion no other joint has a part in. Legs of a robot that hangs by its trunk
/// are, whatever their number. Internal to the library.

#include <diffnea/effects/extended_tree.hpp>

namespace diffnea {

/// Consecutive degrees of freedom that move without regard to all others.
struct Limb {
  int first = 0;  ///< degree of freedom
  int count = 0;  ///< number of degrees of freedom
};

/// All degrees of freedom, in order. Those that a link, a follower or an effect ties together are of
/// one limb, and so are those between them.
/// @param effects  beyond those of the model
std::vector<Limb> limbs(const ExtendedTree& model, const std::vector<BoundEffect>& effects);

}  // namespace diffnea
