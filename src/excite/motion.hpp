#pragma once
/// A Fourier series per joint, its samples, and how large it may be. Internal to excite/ and
/// diagnose/.

#include <diffnea/core/random.hpp>
#include <diffnea/effects/series.hpp>

#include "excite/limits.hpp"

namespace diffnea {

/// q_j(t) = c_j + Σ_k a_jk sin(kωt) + b_jk cos(kωt), k = 1 … H, ω = 2π/period.
struct FourierMotion {
  double period = 10.0;  ///< [s]
  VecX<double> centre;   ///< (n) [rad] or [m]
  MatX<double> a, b;     ///< (n, H)

  int harmonics() const { return static_cast<int>(a.cols()); }
};

/// Rows of a motion, (N, n) [rad, rad/s, rad/s²] or [m …].
struct MotionRows {
  RowMatX<double> q, qd, qdd;
};

/// sin(kωt) and cos(kωt) at N equal steps of a period.
class HarmonicTable {
 public:
  HarmonicTable(int harmonics, long count);
  MotionRows sample(const FourierMotion& motion) const;
  /// What a trigonometric polynomial of degree H can exceed its N samples by, 1/cos(πH/N) (Ehlich
  /// and Zeller 1964).
  double overshoot() const { return overshoot_; }
  long count() const { return sin_.rows(); }

 private:
  MatX<double> sin_, cos_;  // (N, H)
  double overshoot_;
};

/// Coefficients with Σ k a_k = 0 and Σ k² b_k = 0, from H − 1 free numbers each: orthonormal bases,
/// (H, H − 1).
struct RestBasis {
  explicit RestBasis(int harmonics);
  MatX<double> a, b;
};

/// Random coefficients of one joint that begin at rest; their size is of order 1/k.
void draw_series(const RestBasis& basis, Rng& rng, Eigen::Ref<VecX<double>> a,
                 Eigen::Ref<VecX<double>> b);

/// Scales every joint's series to `share` (n) of the largest size that its position, velocity and
/// acceleration limits allow at every instant; a joint that does not move gets none. The centre is
/// put where `place` (n), −1 … 1, says within the room that is left.
void fill_ranges(const std::vector<JointRange>& ranges, const HarmonicTable& table,
                 const VecX<double>& share, const VecX<double>& place, FourierMotion& motion);

class LoopRows;

/// Torque that the model with all its effects needs, as bounds between instants too; of a robot
/// that floats without weight, its base held.
class EffortBound {
 public:
  /// @param loops  of a model with constraints, which outlive it: drives give what all joints need
  explicit EffortBound(const Model& model, const LoopRows* loops = nullptr);
  /// Largest |τ_j| at any instant of the first two periods, from rest, (n) [N·m] or [N]; infinite
  /// where a loop does not close, or what follows would leave its limits.
  /// @param count  samples of a period; 0: as many as make the margin small
  VecX<double> largest(const FourierMotion& motion, long count = 0) const;
  /// To hold a posture, (n).
  VecX<double> holding(const VecX<double>& q) const;

 private:
  RowMatX<double> drive_torques(JointSeries& x) const;

  ExtendedTree model_;
  const LoopRows* loops_;
};

/// Scales the motion about its centre until the torques meet the limits.
/// @return the factor; 0 if not even a twentieth of it does
double fit_effort(const std::vector<JointRange>& ranges, const EffortBound& bound,
                  FourierMotion& motion, long count = 0);

/// The joints with a motor over whole periods that cover `duration`; the period is a whole number
/// of rows.
/// @param loops  of a model with constraints
/// @throws ModelError if a loop does not close along it
Trajectory to_trajectory(const Model& model, const std::vector<JointRange>& ranges,
                         const FourierMotion& motion, double duration, double rate,
                         const LoopRows* loops = nullptr);

}  // namespace diffnea
