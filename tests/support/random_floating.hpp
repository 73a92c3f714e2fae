#pragma once
/// Random trees on a free base, and moving states of them.

#include <diffnea/model/free_base.hpp>

#include "support/random_arm.hpp"

namespace diffnea::test {

/// A random tree whose link 0 floats; the other links hang on it.
inline Tree<double> random_floating_tree(Rng& rng, RandomArmOptions options) {
  ++options.num_dofs;
  Tree<double> tree = random_tree(rng, options);
  tree.free_base = true;
  for (int i = 1; i < tree.num_links(); ++i)
    tree.links[i].parent = std::max(tree.links[i].parent, 0);
  return tree;
}

/// Positions with a base anywhere and turned in any way.
inline VecX<double> random_positions(Rng& rng, const Tree<double>& tree) {
  VecX<double> q = random_vector(rng, tree.num_positions(), 1.5);
  q.segment<4>(3).normalize();
  return q;
}

struct RandomFloating {
  explicit RandomFloating(unsigned seed, const RandomArmOptions& options = {}) {
    Rng rng(seed);
    tree = random_floating_tree(rng, options);
    const int n = tree.num_velocities();
    q = random_positions(rng, tree);
    v = random_vector(rng, n, 2.0);
    vd = random_vector(rng, n, 5.0);
    tau = random_vector(rng, n, 5.0);
  }
  Tree<double> tree;
  VecX<double> q, v, vd, tau;
};

/// The same robot on a fixed base: three prismatic and three revolute joints without mass carry B.
struct OnSixJoints {
  explicit OnSixJoints(const Tree<double>& floating) {
    tree.gravity = floating.gravity;
    const Vec3<double> axes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int k = 0; k < 6; ++k)
      add_link(tree, {.parent = k - 1,
                      .type = k < 3 ? JointType::kPrismatic : JointType::kRevolute,
                      .axis = axes[k % 3]});
    tree.links[kBase].inertia = floating.links[0].inertia;
    for (int i = 1; i < floating.num_links(); ++i) {
      Link<double> link = floating.links[i];
      link.parent += kBase;
      tree.links.push_back(link);
    }
  }
  static constexpr int kBase = 5;  ///< index of the link that is B
  Tree<double> tree;
};

}  // namespace diffnea::test
