#pragma once
/// A stretch of a recording as effects with memory and effects of measurement channels see it, and
/// the numerics on a uniform time grid that they are made of.

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// All joints over one uninterrupted stretch on a uniform time grid. [rad, rad/s, rad/s², N·m] or
/// [m …, N].
struct JointSeries {
  double dt = 0.0;     ///< [s]
  double start = 0.0;  ///< time of the first row since its recording began [s]
  int run = 0;         ///< which recording of several
  /// (N, n) smooth (filtered) motion as logged.
  ///@{
  RowMatX<double> q, qd, qdd;
  ///@}
  /// (N, n) torque that the links transmit, as the base model predicts it for that motion: without
  /// rotor inertia, friction or any other effect (smooth).
  RowMatX<double> tau;
  /// (N, n) torque that the base model predicts for the log, with all its effects; empty: as tau.
  RowMatX<double> total;
  /// (N, n) inertia of the links about each joint alone, the base model's; may be empty.
  RowMatX<double> inertia;
  /// (N, n) logged torque; may be empty. Saturation and backlash read it, and the first swing of
  /// links behind an encoder.
  RowMatX<double> logged;

  /// Number of rows.
  long rows() const { return q.rows(); }
  /// The drive's whole torque where it is known, else what the links transmit.
  const RowMatX<double>& drive() const { return total.size() > 0 ? total : tau; }
};

/// f' by central differences of order four, one-sided ones at the ends; of lower order below five
/// rows.
/// @param f  (N), @param dt [s]
VecX<double> derivative(const VecX<double>& f, double dt);

/// f(t + d), piecewise cubic with the slopes of `derivative`: it is continuous and so is its slope,
/// also in d. Held beyond the ends. @param d [s], of either sign
VecX<double> shifted(const VecX<double>& f, double dt, double d);

/// y of T ẏ = f − y: exact where f is straight between the rows. Begins as if f had always risen as
/// in its first step. @param T  [s] ≥ 0
VecX<double> low_passed(const VecX<double>& f, double dt, double T);

}  // namespace diffnea

#ifndef DIFFNEA_COMPILED
#include <diffnea/effects/detail/joint_series_impl.hpp>
#endif
