#pragma once
/// Random trees in which joints follow others, and the full tree beside each.

#include "support/random_arm.hpp"

namespace diffnea::test {

/// A random tree of which half of the joints follow others, and the full tree beside it.
struct RandomFollowers {
  explicit RandomFollowers(unsigned seed)
      : RandomFollowers(Rng(seed), 2 + static_cast<int>(seed % 8)) {}
  RandomFollowers(Rng rng, int links) : full(random_tree(rng, {.num_dofs = links})), tree(full) {
    std::vector<JointDrive>& joints = tree.coordinates.joints;
    for (int i = 0; i < links; ++i) {
      const bool own = tree.coordinates.count == 0 || rng.uniform() < 0.5;
      if (own)
        joints.push_back({tree.coordinates.count++, 1.0, 0.0});
      else
        joints.push_back({static_cast<int>(rng.uniform() * tree.coordinates.count),
                          rng.uniform() < 0.2 ? 0.0 : rng.normal(), rng.normal()});
    }
    const int n = tree.num_dofs();
    G = MatX<double>::Zero(links, n);
    g0.resize(links);
    for (int i = 0; i < links; ++i) {
      G(i, joints[i].dof) = joints[i].ratio;
      g0[i] = joints[i].offset;
    }
    y = random_vector(rng, n, 1.5);
    yd = random_vector(rng, n, 2.0);
    ydd = random_vector(rng, n, 5.0);
    tau = random_vector(rng, n, 5.0);
    q = G * y + g0;
    qd = G * yd;
    qdd = G * ydd;
  }
  Tree<double> full, tree;
  MatX<double> G;
  VecX<double> g0, y, yd, ydd, tau, q, qd, qdd;
};

}  // namespace diffnea::test
