#pragma once
/// Coordinates y of a tree whose joints do not all move by themselves: q = G y + g₀, where every
/// row of G has one entry. A joint that mimics another has that joint's coordinate; torques of both
/// meet there, τ_y = Gᵀ τ_q.

#include <vector>

namespace diffnea {

/// How a joint follows a coordinate: q = ratio · y + offset.
struct JointDrive {
  int dof = 0;          ///< index of the coordinate y
  double ratio = 1.0;   ///< ∂q/∂y; 0: it never moves
  double offset = 0.0;  ///< q at y = 0 [rad, m]
};

/// G and g₀ of a tree. Empty: joint i is coordinate i, and nothing is copied.
struct Coordinates {
  int count = 0;                   ///< number of coordinates y
  std::vector<JointDrive> joints;  ///< one a joint, in the order of the links they move

  /// Tells whether every joint is a coordinate of its own.
  bool plain() const { return joints.empty(); }

  /// G y + g₀ with `positions`, G y without (velocities, accelerations): y itself where plain.
  /// @param scratch  holds what is returned otherwise
  template <class S>
  const S* of_joints(const S* y, bool positions, std::vector<S>& scratch) const {
    if (plain()) return y;
    scratch.resize(joints.size());
    for (std::size_t i = 0; i < joints.size(); ++i) {
      scratch[i] = y[joints[i].dof] * joints[i].ratio;
      if (positions) scratch[i] = scratch[i] + S(joints[i].offset);
    }
    return scratch.data();
  }

  /// τ_y = Gᵀ τ_q. @param tau_q  one a link  @param tau_y  (count), overwritten
  template <class R>
  void gather(const R* tau_q, R* tau_y) const {
    for (int c = 0; c < count; ++c) tau_y[c] = R(0.0);
    for (std::size_t i = 0; i < joints.size(); ++i) {
      R& tau = tau_y[joints[i].dof];
      tau = tau + tau_q[i] * joints[i].ratio;
    }
  }
};

/// Scratch of a recursion over all joints, S the scalar of the state, R that of the torques. Unused
/// by a plain tree.
template <class S, class R>
struct JointScratch {
  std::vector<S> q;    ///< position of every joint
  std::vector<S> qd;   ///< its velocity
  std::vector<S> qdd;  ///< its acceleration
  std::vector<R> tau;  ///< torque of every joint τ_q; τ_y = Gᵀ τ_q

  /// Torques to write, one a joint: `tau_y` itself where plain.
  R* torques(const Coordinates& c, R* tau_y) {
    if (c.plain()) return tau_y;
    tau.resize(c.joints.size());
    return tau.data();
  }
};

}  // namespace diffnea
