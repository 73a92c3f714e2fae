#pragma once
/// Every continuous parameter of a tree as one vector of deviations: gravity, and per link the
/// fixed pose (a rotation vector in J and a shift), the ten inertial parameters, the rotor inertia.

#include <diffnea/model/tree.hpp>

namespace diffnea::test {

inline constexpr int kParametersPerLink = 6 + kThetaSize + 1;

inline int num_parameters(const Tree<double>& tree) {
  return 3 + kParametersPerLink * tree.num_dofs();
}

template <Scalar T>
Tree<T> with_parameters(const Tree<double>& tree, const VecX<T>& x) {
  Tree<T> out = tree.cast<T>();
  out.gravity = out.gravity + Vec3<T>{x[0], x[1], x[2]};
  for (int i = 0; i < tree.num_dofs(); ++i) {
    const T* d = x.data() + 3 + kParametersPerLink * i;
    Link<T>& link = out.links[i];
    const Mat3<T> turn = rotation_about<T>({1, 0, 0}, d[0]) * rotation_about<T>({0, 1, 0}, d[1]) *
                         rotation_about<T>({0, 0, 1}, d[2]);
    link.X_PJ.R = link.X_PJ.R * turn;
    link.X_PJ.p = link.X_PJ.p + Vec3<T>{d[3], d[4], d[5]};
    Theta<T> theta = link.inertia.theta();
    for (int k = 0; k < kThetaSize; ++k) theta[k] = theta[k] + d[6 + k];
    link.inertia = SpatialInertia<T>::from_theta(theta);
    link.armature = link.armature + d[6 + kThetaSize];
  }
  return out;
}

}  // namespace diffnea::test
