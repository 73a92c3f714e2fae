#pragma once
/// A model with its effects, ready to compute: what changes the link tree (armature, payload) is in
/// the tree, what adds torque is in the list. The right-hand side of the sign equation is RNEA(q,
/// q̇, q̈) + armature·q̈ + effects.

#include <memory>

#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/effects/bound_effect.hpp>

namespace diffnea {

class LoopTorques;

/// A model's tree and effects, as extend() makes them; effects of a ball are in neither.
struct ExtendedTree {
  Tree<double> tree;  ///< armature, payload and tilt of the base included
  /// Torques of one instant (BoundEffect::is_local), without armature.
  std::vector<BoundEffect> effects;
  std::vector<BoundEffect> series;  ///< those of the ports kMeasurement and kMemory
  /// Where constraints close loops: predicted torques of a series are those of the leading joints.
  /// extend() leaves it null, as of an open chain.
  std::shared_ptr<const LoopTorques> loops = nullptr;
};

/// @param runs  recordings that per-run effects have a parameter for
/// @param run   the recording that it stands for: effects of others (`where` ends in :run=K) are
///              left out; −1: of no recording, only what acts in all
/// @throws ModelError if an effect of the model cannot be bound
ExtendedTree extend(const Model& model, const std::vector<int>& runs = {}, int run = -1);

/// Whether the torque depends on the time since the run began (warm_up).
bool reads_time(const BoundEffect& e);

/// Joint torques with all effects, one row a sample: what the sensors of the drives would read.
/// @param q, qd, qdd  (N, n) [rad, rad/s, rad/s²] or [m …]; with a free base as for rnea_batch
/// @param run         recording the rows belong to
/// @param time        (N) since it began [s], for effects that read it; null: not known
/// @return (N, n) [N·m] or [N]
/// @throws ShapeError; ModelError if the model has an effect with memory or of a measurement
/// channel, which single rows do not tell (effects/series.hpp), or one that reads the time, and
/// none is given
RowMatX<double> inverse_dynamics(const ExtendedTree& model,
                                 const Eigen::Ref<const RowMatX<double>>& q,
                                 const Eigen::Ref<const RowMatX<double>>& qd,
                                 const Eigen::Ref<const RowMatX<double>>& qdd, int run = 0,
                                 const VecX<double>* time = nullptr);

}  // namespace diffnea
