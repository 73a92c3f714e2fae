#pragma once
/// Planar loops: a chain of bars whose last one is pinned to the ground. Three bars make a four-bar
/// linkage, four a five-bar. The plane may stand anywhere; the bars' inertias are spatial.

#include <array>

#include <diffnea/dynamics/constraint_projection.hpp>
#include <diffnea/dynamics/constraints.hpp>

#include "support/random_arm.hpp"

namespace diffnea::test {

struct PlanarLoop {
  /// @param bars  3 or 4
  PlanarLoop(unsigned seed, int bars) {
    Rng rng(seed);
    const Pose<double> X_WG = random_pose(rng, 0.5);  // the plane: x and z of G
    const std::array<double, 4> lengths =
        bars == 3 ? std::array{0.3, 0.8, 0.6, 0.0} : std::array{0.4, 0.7, 0.7, 0.4};
    tree.gravity = X_WG.R * Vec3<double>{0.3, 0.2, -9.81};
    for (int i = 0; i < bars; ++i) {
      Link<double> link;
      link.parent = i - 1;
      link.axis = {0, 1, 0};
      link.X_PJ = i == 0
                      ? X_WG
                      : Pose<double>::translation({lengths[static_cast<std::size_t>(i - 1)], 0, 0});
      link.inertia = random_inertia(rng);
      tree.links.push_back(link);
    }
    pin = {X_WG.R * Vec3<double>{0.9, 0, 0} + X_WG.p,
           {lengths[static_cast<std::size_t>(bars - 1)], 0, 0}};
    // The driven joint first (of the five-bar the first two), the others close the loop.
    VecX<double> start(bars);
    if (bars == 3)
      start << -1.1, 0.6, 1.4;
    else
      start << -1.6, 1.2, 0.9, 0.9;
    const ProjectedPositions closed = project_positions(tree, *this, start);
    q = closed.q;
    residual = closed.residual;
    qd = project_velocities(tree, *this, q, random_vector(rng, bars, 2.0));
    tau = random_vector(rng, bars, 3.0);
  }

  template <class Links, class Rows>
  void operator()(const Links& links, Rows& rows) const {
    append_rows(pin, "pin", {kWorld, tree.num_links() - 1}, links, rows);
  }

  Tree<double> tree;
  BallJoint<double> pin;  ///< point of the ground, tip of the last bar
  VecX<double> q, qd,     ///< a moving state that is closed
      tau;                ///< of all joints
  double residual = 0.0;  ///< [m] of that state
};

/// The same links as free bodies, their joints as hinges, torques as pairs of wrenches.
inline ConstrainedAcceleration<double> in_maximal_coordinates(const PlanarLoop& loop) {
  const Tree<double>& tree = loop.tree;
  const Vec3<double> zero{0, 0, 0};
  const int n = tree.num_links();
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(tree, loop.q, loop.qd, VecX<double>::Zero(n), kinematics);
  std::vector<FreeBody<double>> bodies;
  std::vector<BodyState<double>> states;
  for (int i = 0; i < n; ++i) {
    bodies.push_back({BodyKind::kRigid, tree.links[i].inertia});
    states.push_back({kinematics.links[i].X_WL, kinematics.links[i].V});
  }
  std::vector<ConstraintRow<double>> rows;
  std::vector<Wrench<double>> applied(static_cast<std::size_t>(n), {zero, zero});
  const Pose<double> to_axis{{{{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}}, zero};  // its z is the link's y
  for (int i = 0; i < n; ++i) {
    const Link<double>& link = tree.links[i];
    append_rows(Hinge<double>{link.X_PJ * to_axis, to_axis}, "joint", {link.parent, i}, states,
                rows);
    applied[i].torque = applied[i].torque + link.axis * loop.tau[i];
    if (link.parent >= 0)
      applied[link.parent].torque = applied[link.parent].torque - link.axis * loop.tau[i];
  }
  append_rows(loop.pin, "pin", {kWorld, n - 1}, states, rows);
  return constrained_acceleration<double>(bodies, states, applied, {}, rows, tree.gravity, {});
}

}  // namespace diffnea::test
