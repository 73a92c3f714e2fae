#pragma once
/// Motion of free bodies in time: Runge–Kutta of order four over poses and twists; rotations are
/// made orthonormal again after every step.

#include <diffnea/dynamics/free_body.hpp>
#include <diffnea/dynamics/integrators.hpp>

namespace diffnea {

namespace detail {

inline constexpr Eigen::Index kStateSize = 18;  // p, R by columns, V

template <class T>
void pack_states(const std::vector<BodyState<T>>& states, VecX<T>& z) {
  z.resize(kStateSize * static_cast<Eigen::Index>(states.size()));
  Eigen::Index at = 0;
  const auto put = [&](const Vec3<T>& v) {
    z.template segment<3>(at) = to_eigen(v);
    at += 3;
  };
  for (const BodyState<T>& s : states) {
    put(s.X_WB.p);
    for (const Vec3<T>& column : s.X_WB.R.col) put(column);
    put(s.V.angular);
    put(s.V.linear);
  }
}
template <class T>
void unpack_states(const VecX<T>& z, std::vector<BodyState<T>>& states) {
  Eigen::Index at = 0;
  const auto take = [&]() -> Vec3<T> {
    at += 3;
    return {z[at - 3], z[at - 2], z[at - 1]};
  };
  for (BodyState<T>& s : states) {
    s.X_WB.p = take();
    for (Vec3<T>& column : s.X_WB.R.col) column = take();
    s.V.angular = take();
    s.V.linear = take();
  }
}
/// One step of Newton's iteration for the nearest rotation, R (3 − RᵀR)/2: from 1e-8 to 1e-16.
template <class T>
Mat3<T> nearest_rotation(const Mat3<T>& R) {
  const Mat3<T> gram = transpose(R) * R;
  Mat3<T> correction;
  for (int j = 0; j < 3; ++j)
    correction.col[j] = (Mat3<T>::identity().col[j] * T(3.0) - gram.col[j]) * T(0.5);
  return R * correction;
}

}  // namespace detail

/// Scratch of `step_bodies`.
template <Scalar T>
struct MotionWorkspace {
  VecX<T> z;                    ///< all states as one column, 18 numbers a body: p, R by columns, V
  RungeKutta4<VecX<T>> solver;  ///< of that column
  std::vector<BodyState<T>> states;  ///< at the stage whose slope is taken
};

/// Moves the bodies by `h` [s].
/// @param accelerations  f(share, states) → std::vector<Twist<T>>: V̇ of every body, in B, at the
///        share of the step
/// @param ws  scratch, overwritten
template <Scalar T, class Accelerations>
void step_bodies(const Accelerations& accelerations, double h, std::vector<BodyState<T>>& states,
                 MotionWorkspace<T>& ws) {
  ws.states = states;
  detail::pack_states(states, ws.z);
  const auto slope = [&](double share, const VecX<T>& z, VecX<T>& dz) {
    detail::unpack_states(z, ws.states);
    const std::vector<Twist<T>> Vd = accelerations(share, ws.states);
    std::vector<BodyState<T>> rate = ws.states;
    for (std::size_t b = 0; b < rate.size(); ++b) {
      const BodyState<T>& s = ws.states[b];
      rate[b].X_WB = {s.X_WB.R * skew(s.V.angular), s.X_WB.R * s.V.linear};  // Ẋ = X [V]
      rate[b].V = Vd[b];
    }
    detail::pack_states(rate, dz);
  };
  ws.solver.step(slope, h, ws.z);
  detail::unpack_states(ws.z, states);
  for (BodyState<T>& s : states) s.X_WB.R = detail::nearest_rotation(s.X_WB.R);
}

}  // namespace diffnea
