#pragma once
/// Constraints of a model (model/constraint_spec.hpp) between the links of its tree, as
/// dynamics/constrained_tree.hpp takes them.

#include <string>
#include <variant>
#include <vector>

#include <diffnea/dynamics/constrained_tree.hpp>
#include <diffnea/dynamics/constraints.hpp>
#include <diffnea/model/model.hpp>

namespace diffnea {

/// One of the library's constraints, by value.
template <class P>
using AnyConstraint =
    std::variant<BallJoint<P>, Weld<P>, Hinge<P>, WheelContact<P>, RollingWheel<P>>;

/// A constraint between links of a tree.
template <class P>
struct TreeConstraint {
  std::string name;            ///< for errors
  std::array<int, 2> links{};  ///< indices of tree links, or kWorld; of a wheel the second alone
  AnyConstraint<P> equations;  ///< between frames of these links
};

/// A list of them: callable as constrained_forward_dynamics expects.
template <class P>
struct TreeConstraints {
  std::vector<TreeConstraint<P>> list;  ///< in the order of their rows

  /// Appends the rows of all. @throws as append_rows
  template <class T>
  void operator()(const std::vector<BodyState<T>>& links,
                  std::vector<ConstraintRow<T>>& rows) const {
    for (const TreeConstraint<P>& c : list)
      std::visit(
          [&]<class C>(const C& equations) {
            if constexpr (C::kBodies == 2)
              append_rows(equations, c.name, c.links, links, rows);
            else
              append_rows(equations, c.name, {c.links[1]}, links, rows);
          },
          c.equations);
  }
};

/// Constraints of the model, on the links of make_tree(model). A wheel that rolls is two: it
/// touches, and it does not slip.
inline TreeConstraints<double> tree_constraints(const Model& model) {
  const TreeMap map = map_to_tree(model);
  TreeConstraints<double> out;
  for (const ConstraintSpec& c : model.constraints) {
    const auto [a, X_LA] = place_in_tree(map, c.first.link);
    const auto [b, X_LB] = place_in_tree(map, c.second.link);
    const Pose<double> J = X_LA * c.first.X_LF, K = X_LB * c.second.X_LF;
    const auto add = [&, links = std::array<int, 2>{a, b}](const AnyConstraint<double>& equations) {
      out.list.push_back({c.name, links, equations});
    };
    switch (c.kind) {
      case ConstraintKind::kConnect:
        add(BallJoint<double>{J.p, K.p});
        break;
      case ConstraintKind::kWeld:
        add(Weld<double>{J, K});
        break;
      case ConstraintKind::kHinge:
        add(Hinge<double>{J, K});
        break;
      case ConstraintKind::kRolling:
        add(WheelContact<double>{K.p, K.R.col[2], c.radius});
        add(RollingWheel<double>{K.p, K.R.col[2], c.radius});
        break;
    }
  }
  return out;
}

}  // namespace diffnea
