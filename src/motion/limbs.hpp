#pragma once
/// Limbs: joints whose motion no other joint has a part in. Legs of a robot that hangs by its trunk
/// are, whatever their number. Internal to the library.

#include <diffnea/effects/extended_tree.hpp>

namespace diffnea {

/// Consecutive joints that move without regard to all others.
struct Limb {
  int first = 0;  ///< joint
  int count = 0;  ///< number of joints
};

/// All joints, in order. Those that a link, a follower or an effect ties together are of one limb,
/// and so are those between them.
/// @param effects  beyond those of the model
std::vector<Limb> limbs(const ExtendedTree& model, const std::vector<BoundEffect>& effects);

/// A limb as a robot of its own, on the same base: its joints and links count from 0.
class LimbPart {
 public:
  /// @param tree  of the whole robot
  LimbPart(const Tree<double>& tree, const Limb& limb);

  const Limb& limb() const { return limb_; }
  /// Number of a link there; −1: it is of another limb.
  int link(int whole) const { return link_[static_cast<std::size_t>(whole)]; }
  /// Tells whether an effect acts there.
  bool has(const BoundEffect& effect) const;
  /// Effect as the limb has it.
  BoundEffect effect(BoundEffect whole) const;
  /// The limb's share of a model.
  ExtendedTree model(const ExtendedTree& whole) const;

 private:
  bool is_robot() const { return links_ == static_cast<int>(link_.size()); }

  Limb limb_;
  std::vector<int> link_;  ///< for each of the robot
  int links_ = 0;          ///< number of the limb's
};

}  // namespace diffnea
