#pragma once
/// Torques along a measured path as what they do to the position that a joint's encoder shows: rows
/// of evidence whose noise is white, by the noise of the signals alone. Internal to diagnose/.
///
/// Beside its path, the others' taken as measured, joint j obeys M_jj δq̈ = τ − K δq − D δq̇ + w,
/// with w of spectral density Q, and its encoder shows δq with variance R. The Kalman filter of
/// these two states (Anderson, Moore 1979, ch. 3, 5) turns torque, and what smoothing has left of
/// the positions, into innovations: linear, causal, and exact from the first row of a stretch on,
/// of which the first state is not known. Where it has settled it is a low-pass of order two with
/// cut-off (Q/(M² R))^¼: below, torque noise weighs the rows, above, the positions' noise as a
/// torque; no bandwidth is chosen. Nothing is differentiated, so that a short run is as good as a
/// piece of a long one.

#include <vector>

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/joint_series.hpp>

namespace diffnea {

/// Step of differences of the links' torque [rad] or [m], and per second.
inline constexpr double kLinkStep = 1e-5;

/// A joint's equation along a stretch, each (N).
struct JointEquation {
  explicit JointEquation(long rows)
      : inertia(rows), stiffness(rows), damping(rows), density(rows), variance(rows) {}

  VecX<double> inertia;    ///< M_jj [kg·m²] or [kg]
  VecX<double> stiffness;  ///< ∂τ/∂q of the links [N·m/rad] or [N/m]
  VecX<double> damping;    ///< ∂τ/∂q̇ of the links
  VecX<double> density;    ///< Q [N²m²s] or [N²s]
  VecX<double> variance;   ///< R [rad²] or [m²]
};

/// Noise of a position below that of any encoder [rad] or [m]: rounding of a simulation's log.
inline constexpr double kLeastPosition = 1e-9;

/// Noise of the signals of all joints, by which rows are weighed.
struct SignalNoise {
  VecX<double> position;  ///< (n) standard deviation [rad] or [m]
  VecX<double> density;   ///< (n) of the torque [N²m²s] or [N²s]
  /// First of the three hinges of a base that floats (UnfoldedBase): their noise is that of an
  /// orientation, of the same size about every line, the middle one's; −1: there are none.
  int hinges = -1;

  /// Variance of Σ w_i δq_i, the positions' noise. @param w, q  (n)
  double variance(const VecX<double>& w, const VecX<double>& q) const;
};

/// The equations of `joints` along a stretch. Positions of the others count as noise: the
/// acceleration's is larger where the path ends.
/// @param path_hz  cut-off of the path
/// @param every    samples between two at which the links are looked at
std::vector<JointEquation> joint_equations(const Tree<double>& tree, const JointSeries& path,
                                           const std::vector<int>& joints, const SignalNoise& noise,
                                           double path_hz, int every);

/// The filter of one joint along one stretch.
class TorqueFilter {
 public:
  /// @param every  samples of a row, which is their innovations' sum over √every
  TorqueFilter(const JointEquation& equation, double dt, int every);

  /// Rows of a stretch of N samples.
  long rows() const { return std::ssize(gain_) / every_; }
  /// The first of them that no longer hangs on how little was known of the first state.
  long settled() const;

  /// State between two calls of push().
  struct State {
    MatX<double> x;    ///< (2, C)
    VecX<double> sum;  ///< (C)
    long sample = 0;
  };
  /// Takes the next torques.
  /// @param torque  (K, C)
  /// @param next    (C) torque of the sample after them; null: the stretch ends
  /// @param out     (rows(), C); written at the rows that they complete
  void push(const Eigen::Ref<const RowMatX<double>>& torque, const double* next, State& state,
            Eigen::Ref<MatX<double>> out) const;
  /// All torques at once, (N, C) → (rows(), C).
  MatX<double> operator()(const Eigen::Ref<const RowMatX<double>>& torque) const;
  /// The same of what encoders show beside the path, (N) → (rows()); its sign is that of the torque
  /// which would explain it.
  VecX<double> shown(const VecX<double>& positions) const;

 private:
  struct Gain {
    double a00, a10, f01, f11;  ///< step from updated to next state
    double now, next;           ///< torque at either end of the step, on position
    double speed;               ///< torque at either end, on velocity
    double update0, update1;    ///< position that is shown, on both
    double weight;              ///< 1/√(innovation's variance · every)
  };
  std::vector<Gain> gain_;
  int every_;
};

}  // namespace diffnea
