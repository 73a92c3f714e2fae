#pragma once

#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>
#include <diffnea/effects/memory.hpp>

namespace diffnea {

/// saturation: the drive gives no more than ±τ_max, and the log holds what was asked of it: adds
/// logged − clip(logged, ±τ_max). It needs the logged torque; filter the result as the torque is
/// filtered, never its input. What is logged behind the limit shows no such difference.
struct Saturation {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "saturation",
        .formula = "u = clip(tau_c, -tau_max, tau_max)",
        .summary = "largest torque of the drive, below what is asked of it",
        .port = Port::kMemory,
        .parameters = {{.name = "limit",
                        .unit = "N*m",
                        .unit_prismatic = "N",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 1e3,
                        .search = log_grid(0.1, 1e3, 21),
                        .bound = SearchBound::kTorque}},
        .motor_side = true,
        .traits = {Trait::kOfDrive},
        .shown_over = {ShownOver::kTorque}};
    return kInfo;
  }

  template <class T>
  static void add_to_drive(const T* p, DrivePath<T>& path) {
    path.limit = select(p[0] < path.limit, p[0], path.limit);
  }

  /// (N) torque in addition at `joint`, not filtered.
  /// @throws DataError if the series has no logged torque
  VecX<double> torque_series(const JointSeries& x, int joint, const double* p) const {
    if (x.logged.rows() != x.rows() || x.logged.cols() <= joint)
      throw DataError(
          "saturation: the series has no logged torque, which is what a limit shows in");
    const VecX<double> u = x.logged.col(joint);
    return u - u.cwiseMin(p[0]).cwiseMax(-p[0]);
  }
};

}  // namespace diffnea
