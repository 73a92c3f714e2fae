#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>
#include <diffnea/effects/memory.hpp>

namespace diffnea {

/// presliding_dahl: dry friction that begins as a spring. ż = q̇ − |q̇| z/x_s, torque F z/x_s: after
/// a reversal it climbs to F over a distance of some x_s (Dahl 1968, exponent 1). It depends on the
/// path alone, dz/dq = sgn(q̇) − z/x_s, so each stretch between reversals is solved exactly. It
/// begins unloaded, z = 0.
struct PreslidingDahl {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "presliding_dahl",
                                  .formula = "F z/x_s, dz/dt = qd - |qd| z/x_s",
                                  .summary = "dry friction that begins as a spring: Dahl's model",
                                  .port = Port::kMemory,
                                  .parameters = {{.name = "coulomb",
                                                  .unit = "N*m",
                                                  .unit_prismatic = "N",
                                                  .sign = Sign::kNonNegative},
                                                 {.name = "presliding",
                                                  .unit = "rad",
                                                  .unit_prismatic = "m",
                                                  .sign = Sign::kPositive,
                                                  .linear = false,
                                                  .initial = 0.01,
                                                  .initial_prismatic = 0.001,
                                                  .search = log_grid(1e-3, 0.2, 6),
                                                  .search_prismatic = log_grid(1e-4, 0.02, 6),
                                                  .bound = SearchBound::kPresliding}},
                                  .motor_side = true,
                                  .traits = {Trait::kFriction},
                                  .shown_over = {ShownOver::kVelocity, ShownOver::kReversals}};
    return kInfo;
  }

  /// The state is z/x_s, of −1 … 1.
  ///@{
  template <Scalar T>
  static StateRate<T> derivative(const T& z, const T& qd, const T* p) {
    const T size = select(qd < T(0.0), T(-qd), qd), side = select(qd < T(0.0), T(-1.0), T(1.0));
    return {(T(1.0) - side * z) / p[1], T(0.0), size / p[1]};
  }
  template <Scalar T>
  static T torque(const T& z, const T&, const T* p) {
    return p[0] * z;
  }
  template <Scalar T>
  static AtRest<T> at_rest(const T* p) {
    return {p[0] / p[1], T(0.0)};
  }
  static double advance(double z, const Move& move, const double* p) {
    return advance(z, move.way, p[1]);
  }
  ///@}

  /// z/x_s after a move by `step` without reversal.
  static double advance(double state, double step, double presliding) {
    const double end = step < 0.0 ? -1.0 : 1.0;
    return end + (state - end) * std::exp(-std::abs(step) / presliding);
  }

  VecX<double> torque_series(const JointSeries& x, int joint, const double* p) const {
    VecX<double> out(x.rows());
    double state = 0.0;
    for (long k = 0; k < x.rows(); ++k) {
      if (k > 0) {
        const double v0 = x.qd(k - 1, joint), v1 = x.qd(k, joint);
        const double step = x.q(k, joint) - x.q(k - 1, joint);
        if (v0 * v1 < 0.0) {  // turns where the straight line between the velocities crosses 0
          const double there = 0.5 * x.dt * v0 * v0 / (v0 - v1);
          state = advance(state, there, p[1]);
          state = advance(state, step - there, p[1]);
        } else {
          state = advance(state, step, p[1]);
        }
      }
      out[k] = p[0] * state;
    }
    return out;
  }
};

}  // namespace diffnea
