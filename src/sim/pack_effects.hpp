#pragma once
/// Effects of one instant at the joints of a pack of arms: friction and all else that has no
/// memory. Included by pack_world.cpp alone, once per instruction set.
///
/// With τ_e(q, q̇) = τ_e(q, 0) + c(q̇) q̇, the second part is taken at the middle of the step, c ≥ 0
/// held at what the last acceleration makes of the velocity there: h c/2 joins the armature. So no
/// friction, however steep at rest, makes a step unstable.

#include <vector>

#include <diffnea/core/pack.hpp>
#include <diffnea/effects/catalogue.hpp>

#include "sim/pack_lanes.hpp"
#include "sim/pack_world.hpp"

namespace diffnea::sim {
namespace DIFFNEA_ISA {

class PackEffects {
 public:
  explicit PackEffects(const PackSpec& spec)
      : spec_(spec), n_(spec.joints), total_(n_), at_rest_(n_), zero_(n_, Pack(0.0)) {
    for (const BoundEffect& e : spec.effects) reads_.push_back(e.info().reads);
  }

  void take_parameters(const LaneDraws& draws) {
    parameters_ = gather_parameters(draws, spec_.effects, &PackDraw::effects);
    constant_.assign(n_, Pack(0.0));
    viscous_.assign(n_, Pack(0.0));
    const std::vector<Pack> one(n_, Pack(1.0));
    for (std::size_t e = 0; e < spec_.effects.size(); ++e) {
      if (reads_[e] == Reads::kNothing) add_effect(e, 0.0, zero_, zero_, constant_);
      if (reads_[e] == Reads::kSpeedLinearly) add_effect(e, 0.0, zero_, one, viscous_);
    }
  }

  /// What they do to the links over the next step of h [s].
  /// @param q, qd, qdd  (joints) before the step, of the last step
  /// @param u     (joints) torque at the links, added to
  /// @param tree  armature is added to
  void act(double time, double h, const std::vector<Pack>& q, const std::vector<Pack>& qd,
           const std::vector<Pack>& qdd, std::vector<Pack>& u, Tree<Pack>& tree) {
    if (spec_.effects.empty()) return;
    constexpr double kLeast = 1e-9;  // [rad/s]: below, the secant is that of this speed
    for (int j = 0; j < n_; ++j) {
      const Pack v = qd[j] + qdd[j] * Pack(0.5 * h);
      speed_[j] = select(abs(v) < Pack(kLeast), Pack(kLeast), v);
      total_[j] = constant_[j] + viscous_[j] * speed_[j];
      at_rest_[j] = constant_[j];
    }
    for (std::size_t e = 0; e < spec_.effects.size(); ++e) {
      if (reads_[e] < Reads::kSpeed) continue;
      add_effect(e, time, q, speed_, total_);
      if (reads_[e] == Reads::kMotion) add_effect(e, time, q, resting(e), at_rest_);
    }
    for (int j = 0; j < n_; ++j) {
      const Pack slope = (total_[j] - at_rest_[j]) / speed_[j];
      const Pack secant = select(slope > Pack(0.0), slope, Pack(0.0));
      u[j] -= total_[j] + secant * (qd[j] - speed_[j]);
      tree.links[j].armature += secant * Pack(0.5 * h);
    }
  }

 private:
  void add_effect(std::size_t e, double time, const std::vector<Pack>& q,
                  const std::vector<Pack>& qd, std::vector<Pack>& tau) const {
    JointSample<Pack> x;
    x.time = time;
    x.q = q.data();
    x.qd = qd.data();
    x.qdd = x.tau = zero_.data();  // unread: such effects were refused
    add_torque<Pack>(spec_.effects[e], spec_.draws.front().tree, x, parameters_[e].data(),
                     tau.data());
  }

  /// Speeds at which what it acts on is at rest. Its joints alone: a torque over another joint's
  /// speed is no friction of its own, however large it is while this one hardly moves.
  const std::vector<Pack>& resting(std::size_t e) {
    still_ = speed_;
    for (const int j : spec_.effects[e].joints) still_[j] = Pack(0.0);
    return still_;
  }

  const PackSpec& spec_;
  int n_;
  std::vector<Reads> reads_;  ///< (effects)
  std::vector<std::vector<Pack>> parameters_;
  std::vector<Pack> constant_, viscous_;  ///< of effects that need not be asked again
  std::vector<Pack> total_, at_rest_, zero_, speed_ = zero_;
  std::vector<Pack> still_ = zero_;  ///< scratch of resting()
};

}  // namespace DIFFNEA_ISA
}  // namespace diffnea::sim
