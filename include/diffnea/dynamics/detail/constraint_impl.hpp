#pragma once

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/constraint.hpp>

namespace diffnea::detail {

/// X exp(V t) up to the second order in t, which is all that two derivatives see: rows take three
/// quarters of the time that lie/se3.hpp's exp would make of them.
template <class U, class T>
Pose<U> moved(const Pose<T>& X, const Twist<T>& V, const U& t) {
  const Mat3<U> R = X.R.template cast<U>();
  const Vec3<U> w = V.angular.template cast<U>() * t, v = V.linear.template cast<U>() * t;
  const auto turn = [&w](const Vec3<U>& r) {
    const Vec3<U> first = cross(w, r);
    return r + first + cross(w, first) * U(0.5);
  };
  const Mat3<U> one = Mat3<U>::identity();
  return {R * Mat3<U>{turn(one.col[0]), turn(one.col[1]), turn(one.col[2])},
          X.p.template cast<U>() + R * (v + cross(w, v) * U(0.5))};
}

/// Component k of the twist, angular first.
template <class T>
T& component(Twist<T>& V, int k) {
  Vec3<T>& part = k < 3 ? V.angular : V.linear;
  return k % 3 == 0 ? part.x : k % 3 == 1 ? part.y : part.z;
}
template <class T>
T& component(Wrench<T>& W, int k) {
  Vec3<T>& part = k < 3 ? W.torque : W.force;
  return k % 3 == 0 ? part.x : k % 3 == 1 ? part.y : part.z;
}

/// Component k is ε_{first + k}.
template <class U>
Twist<U> seed(int first) {
  Twist<U> out{};
  for (int k = 0; k < 6; ++k) component(out, k) = U({}, first + k);
  return out;
}
template <class U, class T>
Twist<U> cast(const Twist<T>& V) {
  return {V.angular.template cast<U>(), V.linear.template cast<U>()};
}
template <class T>
Twist<T> still() {
  const Vec3<T> zero{T(0.0), T(0.0), T(0.0)};
  return {zero, zero};
}

}  // namespace diffnea::detail

namespace diffnea {

template <Scalar T, Constraint C>
void append_rows(const C& constraint, const std::string& name,
                 const std::array<int, C::kBodies>& bodies, const std::vector<BodyState<T>>& states,
                 std::vector<ConstraintRow<T>>& rows) {
  constexpr int n = C::kBodies;
  std::array<BodyState<T>, n> at;
  for (std::size_t b = 0; b < n; ++b) {
    at[b].V = detail::still<T>();
    if (bodies[b] == kWorld) continue;
    if (bodies[b] < 0 || bodies[b] >= static_cast<int>(states.size()))
      throw ShapeError("append_rows: constraint '" + name + "' names body " +
                       std::to_string(bodies[b]) + ", expected " + std::to_string(kWorld) +
                       " (the world) to " + std::to_string(static_cast<int>(states.size()) - 1));
    at[b] = states[static_cast<std::size_t>(bodies[b])];
  }

  using Along = Dual<T, 1>;         // one derivative in t
  using Twice = Dual<Along, 1>;     // two
  using Gradient = Dual<T, 6 * n>;  // one along every component of every twist
  constexpr bool of_velocity = VelocityConstraint<C>;
  std::array<Pose<Gradient>, n> X_gradient;
  for (std::size_t b = 0; b < n; ++b) {
    const Twist<Gradient> along = detail::seed<Gradient>(6 * static_cast<int>(b));
    X_gradient[b] = at[b].X_WB.template cast<Gradient>();
    if constexpr (of_velocity) continue;
    const Mat3<Gradient> R = X_gradient[b].R;
    X_gradient[b].p = X_gradient[b].p + R * along.linear;
    for (Vec3<Gradient>& column : X_gradient[b].R.col) {
      // R (1 + [w]): column j turns as R (w × e_j).
      const auto j = static_cast<std::size_t>(&column - X_gradient[b].R.col);
      column = column + R * cross(along.angular, Mat3<Gradient>::identity().col[j]);
    }
  }
  const std::size_t first = rows.size();
  const auto append = [&](const auto& gradients) {
    for (const Gradient& gradient : gradients) {
      ConstraintRow<T> row;
      row.name = name;
      row.relation = C::kRelation;
      row.of_velocity = of_velocity;
      for (std::size_t b = 0; b < n; ++b) {
        row.bodies[b] = bodies[b];
        for (int k = 0; k < 6; ++k)
          detail::component(row.J[b], k) = gradient.v[6 * b + static_cast<std::size_t>(k)];
      }
      rows.push_back(std::move(row));
    }
  };
  if constexpr (of_velocity) {
    std::array<Twist<Gradient>, n> V_gradient;
    std::array<Pose<Along>, n> X_along;
    std::array<Twist<Along>, n> V_along;
    for (std::size_t b = 0; b < n; ++b) {
      V_gradient[b] =
          detail::cast<Gradient>(at[b].V) + detail::seed<Gradient>(6 * static_cast<int>(b));
      X_along[b] = detail::moved(at[b].X_WB, at[b].V, Along(T(0.0), 0));
      V_along[b] = detail::cast<Along>(at[b].V);
    }
    append(constraint(X_gradient, V_gradient));
    const auto along = constraint(X_along, V_along);
    for (std::size_t r = 0; r < along.size(); ++r) {
      ConstraintRow<T>& row = rows[first + r];
      row.g = along[r].a;
      row.gd = T(0.0);
      row.bias = along[r].v[0];
    }
  } else {
    append(constraint(X_gradient));
    std::array<Pose<Twice>, n> X_twice;
    for (std::size_t b = 0; b < n; ++b)
      X_twice[b] = detail::moved(at[b].X_WB, at[b].V, Twice(Along(T(0.0), 0), 0));
    const auto twice = constraint(X_twice);
    for (std::size_t r = 0; r < twice.size(); ++r) {
      ConstraintRow<T>& row = rows[first + r];
      row.g = twice[r].a.a;
      row.gd = twice[r].v[0].a;
      row.bias = twice[r].v[0].v[0];
    }
  }
}

}  // namespace diffnea
