#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>

namespace diffnea {

/// velocity_filter_lag: a robot that logs velocities logs them filtered, T q̇̇_logged = q̇ − q̇_logged,
/// beside positions that are not. q̇ and q̈ of the series are taken to come from that velocity: the
/// truth is q̇ + T q̈ and its derivative, q as it is.
struct VelocityFilterLag {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "velocity_filter_lag",
                                  .formula = "qd = qd_logged + T d(qd_logged)/dt",
                                  .summary = "first-order filter in the logged velocity",
                                  .port = Port::kMeasurement,
                                  .parameters = {{.name = "lag",
                                                  .unit = "s",
                                                  .unit_prismatic = "s",
                                                  .sign = Sign::kNonNegative,
                                                  .linear = false,
                                                  .search = log_grid(1e-3, 50e-3, 6)}},
                                  .traits = {Trait::kIfAsked, Trait::kLogsVelocity},
                                  .shown_over = {ShownOver::kTorqueRate, ShownOver::kCorrelation}};
    return kInfo;
  }

  static VecX<double> logged_velocity(const VecX<double>& qd, double dt, const double* p) {
    return low_passed(qd, dt, p[0]);
  }

  void add_to_motion(const JointSeries& x, int joint, const double* p, JointSeries& truth) const {
    const VecX<double> qdd = truth.qdd.col(joint);
    truth.qd.col(joint) += p[0] * qdd;
    truth.qdd.col(joint) += p[0] * derivative(qdd, x.dt);
  }
};

}  // namespace diffnea
