#pragma once
/// Limbs: joints whose motion no other joint has a part in. Legs of a robot that hangs by its trunk
/// are, whatever their number. Internal to the library.

#include "motion/hidden_rotors.hpp"

namespace diffnea {

/// Consecutive joints that move without regard to all others, their hidden rotors and integrators.
struct Limb {
  int first = 0;                 ///< joint
  int count = 0;                 ///< number of joints
  std::vector<int> rotors = {};  ///< degrees of freedom behind the joints, ascending

  /// All degrees of freedom: of joints, then of what is behind them.
  std::vector<int> dofs() const;
};

/// All joints, in order. Those that a link, a follower or an effect ties together are of one limb,
/// and so are those between them; a rotor is of its joint's.
/// @param model    unfolded
/// @param effects  beyond those of the model
std::vector<Limb> limbs(const ExtendedTree& model, const HiddenRotors& rotors,
                        const std::vector<BoundEffect>& effects);

}  // namespace diffnea
