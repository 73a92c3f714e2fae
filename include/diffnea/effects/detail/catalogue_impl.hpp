#pragma once

#include <diffnea/effects/catalogue.hpp>

namespace diffnea {

namespace detail {

/// A formula's torque at one instant, at each of its joints; forces on links only where a tree is
/// given.
template <class E, Scalar T>
void add_torque(const E& formula, const BoundEffect& effect, const Tree<double>* tree,
                const JointSample<T>& x, const T* p, T* tau) {
  const int* joints = effect.joints.data();
  if constexpr (requires { formula.add_torque(x, joints, p, tau); }) {
    if (E::info().place == Place::kJoint)
      for (const int& joint : effect.joints) formula.add_torque(x, &joint, p, tau);
    else
      formula.add_torque(x, joints, p, tau);
  } else if constexpr (requires { formula.add_torque(*tree, x, joints, p, tau); }) {
    if (tree) formula.add_torque(*tree, x, joints, p, tau);
  }
}

}  // namespace detail

template <Scalar T>
void add_torque(const BoundEffect& effect, const JointSample<T>& x, const T* p, T* tau) {
  visit_formula(effect, [&](const auto& formula) {
    detail::add_torque(formula, effect, static_cast<const Tree<double>*>(nullptr), x, p, tau);
  });
}

template <Scalar T>
void add_torque(const BoundEffect& effect, const Tree<double>& tree, const JointSample<T>& x,
                const T* p, T* tau) {
  visit_formula(
      effect, [&](const auto& formula) { detail::add_torque(formula, effect, &tree, x, p, tau); });
}

template <Scalar P>
void add_to_tree(const BoundEffect& effect, const P* p, Tree<P>& tree) {
  visit_formula(effect, [&](const auto& formula) {
    if constexpr (requires(const int* j) { formula.add_to_tree(j, p, tree); })
      formula.add_to_tree(effect.joints.data(), p, tree);
  });
}

}  // namespace diffnea
