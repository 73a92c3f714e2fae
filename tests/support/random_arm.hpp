#pragma once
/// Random robots and states for property tests: branching trees, revolute and prismatic joints, any
/// axes, rotor inertia, any gravity, inertias that a body can have.

#include <diffnea/core/random.hpp>
#include <diffnea/model/tree.hpp>

namespace diffnea::test {

inline Vec3<double> random_vec3(Rng& rng, double scale = 1.0) {
  const double x = rng.normal(), y = rng.normal(), z = rng.normal();
  return Vec3<double>{x, y, z} * scale;
}

inline Vec3<double> random_unit(Rng& rng) {
  const Vec3<double> v = random_vec3(rng);
  return v * (1.0 / std::sqrt(dot(v, v)));
}

inline Pose<double> random_pose(Rng& rng, double scale = 0.3) {
  const double w = rng.normal(), x = rng.normal(), y = rng.normal(), z = rng.normal();
  return {rotation_from_quaternion(w, x, y, z), random_vec3(rng, scale)};
}

/// A cloud of `num_points` point masses: what it is, a body can be. 10 and more give full rank.
inline SpatialInertia<double> random_inertia(Rng& rng, int num_points = 10) {
  SpatialInertia<double> sum;
  const Vec3<double> center = random_vec3(rng, 0.1);
  for (int i = 0; i < num_points; ++i)
    sum =
        sum + inertia_from_com<double>(rng.uniform(0.05, 0.4), center + random_vec3(rng, 0.1), {});
  return sum;
}

struct RandomArmOptions {
  int num_dofs = 6;
  bool branching = true;        ///< else a serial chain
  bool prismatic = true;        ///< a third of the joints slide; else all revolute
  bool principal_axes = false;  ///< ±x, ±y, ±z only; else half of the axes are oblique
  bool armature = true;
};

inline Tree<double> random_tree(Rng& rng, const RandomArmOptions& options = {}) {
  const Vec3<double> principal[] = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},
                                    {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  Tree<double> tree;
  tree.gravity = random_vec3(rng, 6.0);
  for (int i = 0; i < options.num_dofs; ++i) {
    Link<double> link;
    link.parent = options.branching ? static_cast<int>(rng.uniform() * (i + 1)) - 1 : i - 1;
    // Serial stretches are what most robots have: half of the links follow the one before.
    if (rng.uniform() < 0.5) link.parent = i - 1;
    link.type =
        options.prismatic && rng.uniform() < 0.33 ? JointType::kPrismatic : JointType::kRevolute;
    const bool oblique = !options.principal_axes && rng.uniform() < 0.5;
    link.axis = oblique ? random_unit(rng) : principal[static_cast<int>(rng.uniform() * 6)];
    link.X_PJ = random_pose(rng);
    link.inertia = random_inertia(rng);
    if (options.armature) link.armature = rng.uniform(0.01, 0.2);
    tree.links.push_back(link);
  }
  return tree;
}

inline VecX<double> random_vector(Rng& rng, int n, double scale = 1.0) {
  VecX<double> v(n);
  for (double& x : v) x = scale * rng.normal();
  return v;
}

/// A tree and a moving state of it.
struct RandomArm {
  explicit RandomArm(unsigned seed, const RandomArmOptions& options = {}) {
    Rng rng(seed);
    tree = random_tree(rng, options);
    const int n = tree.num_dofs();
    q = random_vector(rng, n, 1.5);
    qd = random_vector(rng, n, 2.0);
    qdd = random_vector(rng, n, 5.0);
    tau = random_vector(rng, n, 5.0);
  }
  Tree<double> tree;
  VecX<double> q, qd, qdd, tau;
};

}  // namespace diffnea::test
