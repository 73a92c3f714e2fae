#pragma once

#include <diffnea/effects/catalogue.hpp>

namespace diffnea {

namespace detail {

/// A formula's torque at joints that follow others: evaluated along their own motion, and felt by
/// the coordinates by Gᵀ. bind() lets no formula be here that reads transmitted torque.
template <class E, Scalar T>
void add_torque_of_followers(const E& formula, const BoundEffect& effect, const JointSample<T>& x,
                             const T* p, T* tau) {
  for (const JointDrive& d : effect.follows) {
    const auto moved = [&](const T* y, double offset) {
      return y ? y[d.dof] * d.ratio + T(offset) : T(0.0);
    };
    const T q = moved(x.q, d.offset), qd = moved(x.qd, 0.0), qdd = moved(x.qdd, 0.0);
    const JointSample<T> own{x.time, x.run, &q, &qd, &qdd, nullptr};
    const int joint[2] = {0, 0};  // pairs are compiled here and never bound
    T torque(0.0);
    formula.add_torque(own, joint, p, &torque);
    tau[d.dof] = tau[d.dof] + torque * d.ratio;
  }
}

/// Torque of a gear at both of its sides.
template <class E, Scalar T>
void add_gear_torque(const BoundEffect& effect, const JointSample<T>& x, const T* p, T* tau) {
  for (std::size_t k = 0; k + 1 < effect.joints.size(); k += 2) {
    const int link = effect.joints[k], rotor = effect.joints[k + 1];
    const T torque = E::gear_torque(T(x.q[rotor] - x.q[link]), T(x.qd[rotor] - x.qd[link]), p);
    tau[link] = tau[link] - torque;
    tau[rotor] = tau[rotor] + torque;
  }
}

/// A formula's torque at one instant, at each of its joints; forces on links only where a tree is
/// given.
template <class E, Scalar T>
void add_torque(const E& formula, const BoundEffect& effect, const Tree<double>* tree,
                const JointSample<T>& x, const T* p, T* tau) {
  const int* joints = effect.joints.data();
  if constexpr (requires { formula.add_torque(x, joints, p, tau); }) {
    if (!effect.follows.empty())
      add_torque_of_followers(formula, effect, x, p, tau);
    else if (E::info().place == Place::kJoint)
      for (std::size_t k = 0; k < effect.joints.size(); ++k) {
        if (effect.encoders.empty()) {
          formula.add_torque(x, &effect.joints[k], p, tau);
          continue;
        }
        JointSample<T> read = x;
        read.encoder = effect.encoders[k];
        formula.add_torque(read, &effect.joints[k], p, tau);
      }
    else
      formula.add_torque(x, joints, p, tau);
  } else if constexpr (requires { formula.add_torque(*tree, x, joints, p, tau); }) {
    if (tree) formula.add_torque(*tree, x, effect.links.data(), p, tau);
  } else if constexpr (requires(const T& d) {
                         value_part(d);  // packs have no gears
                         E::gear_torque(d, d, p);
                       }) {
    if (effect.is_gear) add_gear_torque<E>(effect, x, p, tau);
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
    if constexpr (requires(const int* link) { formula.add_to_tree(link, p, tree); })
      formula.add_to_tree(effect.links.data(), p, tree);
  });
}

}  // namespace diffnea
