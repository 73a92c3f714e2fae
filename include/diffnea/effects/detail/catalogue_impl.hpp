#pragma once

#include <diffnea/effects/catalogue.hpp>

namespace diffnea {

template <Scalar T>
void add_torque(const BoundEffect& effect, const JointSample<T>& x, const T* p, T* tau) {
  std::visit(
      [&]<class E>(const E& formula) {
        if constexpr (requires(const int* j) { formula.add_torque(x, j, p, tau); }) {
          if (E::info().place == Place::kJoint)
            for (const int& joint : effect.joints) formula.add_torque(x, &joint, p, tau);
          else
            formula.add_torque(x, effect.joints.data(), p, tau);
        }
      },
      effect.type);
}

template <Scalar T>
void add_torque(const BoundEffect& effect, const Tree<double>& tree, const JointSample<T>& x,
                const T* p, T* tau) {
  add_torque(effect, x, p, tau);
  std::visit(
      [&](const auto& formula) {
        if constexpr (requires(const int* j) { formula.add_torque(tree, x, j, p, tau); })
          formula.add_torque(tree, x, effect.joints.data(), p, tau);
      },
      effect.type);
}

template <Scalar P>
void add_to_tree(const BoundEffect& effect, const P* p, Tree<P>& tree) {
  std::visit(
      [&](const auto& formula) {
        if constexpr (requires(const int* j) { formula.add_to_tree(j, p, tree); })
          formula.add_to_tree(effect.joints.data(), p, tree);
      },
      effect.type);
}

extern template void add_torque<double>(const BoundEffect&, const JointSample<double>&,
                                        const double*, double*);
extern template void add_torque<JetD>(const BoundEffect&, const JointSample<JetD>&, const JetD*,
                                      JetD*);
extern template void add_torque<double>(const BoundEffect&, const Tree<double>&,
                                        const JointSample<double>&, const double*, double*);
extern template void add_torque<JetD>(const BoundEffect&, const Tree<double>&,
                                      const JointSample<JetD>&, const JetD*, JetD*);
extern template void add_to_tree<double>(const BoundEffect&, const double*, Tree<double>&);
extern template void add_to_tree<JetD>(const BoundEffect&, const JetD*, Tree<JetD>&);

}  // namespace diffnea
