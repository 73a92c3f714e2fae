#pragma once
/// From measured rows to what a regression needs: a uniform time grid, positions without noise,
/// velocities and accelerations, torques that belong to them.
///
///   1. Gaps (rows without a position or a measured torque, or time that jumps by more than
///      max_gap) cut the recording into segments; nothing is filtered across them.
///   2. Each segment is put on a grid of the mean period (without outliers). A sample that lies on
///      a grid point is kept, else q is interpolated by the cubic through four neighbours, τ by
///      the line through two.
///   3. τ of kHold sampling: row k's torque acts from k to k+1, so what acts about row k is
///      (7 (τ_{k−1} + τ_k) − τ_{k−2} − τ_{k+1})/12, exact for cubics.
///   4. Positions of a sensor that is slower than the log lie on lines between its new values.
///   5. q, q̇, q̈: of the smoothing spline of order 8 through the segment, a low-pass without phase,
///      of gain 1/(1 + (f/filter_hz)⁸), that knows the ends for ends: no row is lost there.
/// The seven numbers of a base's pose are smoothed as positions, the quaternion with a unit norm
/// and one sign; twist and acceleration are those of the smoothed pose on the manifold. τ is not
/// filtered here: recording/decimator.hpp does that together with the regressor's columns.
///
///     const PreprocessPlan plan = plan_preprocess(recordings, {});
///     for (const Recording& r : recordings) use(preprocess(r, plan));

#include <memory>

#include <diffnea/core/fields.hpp>
#include <diffnea/recording/decimator.hpp>
#include <diffnea/recording/recording.hpp>

namespace diffnea {

/// Filters and rates; what is not given follows from the data.
struct PreprocessOptions {
  /// Cut-off of the path; 0: 1.5 times the frequency where the accelerations' spectrum is lowest,
  /// between the motion and the noise that rises with f⁴; the largest of the joints.
  double filter_hz = 0.0;
  /// 0: about 50 Hz, more if the accelerations' power asks for it, at most twice the cut-off, and
  /// of a base that floats less where noise of its pose would bias what is fitted; above the rate:
  /// off.
  double decimate_to_hz = 0.0;
  /// A longer pause splits [periods]; 0: 5, or a tenth of the cut-off's period if that is longer.
  double max_gap = 0.0;
  double min_segment = 1.0;        ///< a shorter segment is dropped [s]
  bool measured_velocity = false;  ///< filtered qd and its difference, not differences of q
};

/// What is decided once for all blocks and recordings.
struct PreprocessPlan {
  double dt = 0.0;
  double filter_hz = 0.0;
  DecimatorOptions decimator;
  double max_gap = 5.0;
  double min_segment = 1.0;
  bool measured_velocity = false;
  std::vector<double> joint_hz;
  std::vector<double> q_noise;
  std::vector<double> q_step;
  std::vector<double> tau_noise;
  std::vector<int> refresh;
  double timing_jitter = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("PreprocessPlan", "How the recordings were filtered.");
    list.field("dt", &PreprocessPlan::dt, "Of the uniform grid.", {.unit = "s"});
    list.field("filter_hz", &PreprocessPlan::filter_hz, "Cut-off of the smoothed path.",
               {.unit = "Hz"});
    list.field("decimator", &PreprocessPlan::decimator, "Low-pass of torques and regressor.");
    list.field("max_gap", &PreprocessPlan::max_gap, "A longer pause splits.", {.unit = "periods"});
    list.field("min_segment", &PreprocessPlan::min_segment, "A shorter segment was dropped.",
               {.unit = "s"});
    list.field("measured_velocity", &PreprocessPlan::measured_velocity,
               "Filtered qd and its difference, not differences of q.");
    list.field("joint_hz", &PreprocessPlan::joint_hz,
               "Per joint, then of a base that floats x y z qx qy qz qw: the cut-off for it alone; "
               "0: too short to tell.");
    list.field("q_noise", &PreprocessPlan::q_noise,
               "Likewise: standard deviation of q's noise [rad] or [m].");
    list.field("q_step", &PreprocessPlan::q_step,
               "Likewise: step to which q is rounded [rad] or [m]; 0: too fine to be seen.");
    list.field("tau_noise", &PreprocessPlan::tau_noise,
               "Likewise: of the white part of τ's (of a base its wrench τ, f, and NaN); NaN: not "
               "measured.");
    list.field("refresh", &PreprocessPlan::refresh,
               "Likewise: rows from one new position to the next, where the sensor is slower than "
               "the log.");
    list.field("timing_jitter", &PreprocessPlan::timing_jitter,
               "Share of the intervals that are off dt by more than 2 %.");
  }
};

/// Rows of one recording on a uniform grid.
struct Preprocessed {
  /// As in the Recording.
  ///@{
  std::string source;
  int run = 0;
  std::vector<std::string> joint_names;
  ///@}
  double dt = 0.0;                 ///< of the grid [s]
  VecX<double> time;               ///< (N) [s]
  std::vector<int> segment;        ///< (N) rows of one segment are contiguous
  RowMatX<double> q;               ///< (N, n) filtered [rad] or [m]
  RowMatX<double> qd;              ///< (N, n) of q, or the measured one filtered [rad/s] or [m/s]
  RowMatX<double> qdd;             ///< (N, n) [rad/s²] or [m/s²]
  RowMatX<double> q_logged;        ///< (N, n) not filtered
  RowMatX<double> tau;             ///< (N, n) not filtered; as in Recording where has_tau is false
  std::vector<bool> has_tau;       ///< as in Recording
  /// Motion of a base that floats, else empty. Twists are against the world, in the base's axes.
  ///@{
  RowMatX<double> base;               ///< (N, 7) X_WB filtered, as in Recording, of unit quaternion
  RowMatX<double> base_twist;         ///< (N, 6) V_WB_B of it, or the measured one filtered
  RowMatX<double> base_acceleration;  ///< (N, 6) its derivative [rad/s², m/s²]
  RowMatX<double> base_wrench;        ///< (N, 6) not filtered; 0 where none was recorded
  bool has_base_wrench = false;       ///< it was recorded
  ///@}
  std::vector<std::string> notes;  ///< segments dropped and why

  /// Number of rows.
  long rows() const { return time.size(); }
};

/// Chooses grid, cut-off and decimation. For a stream, any stretch of it that is long enough to be
/// typical does. Held-out recordings take the plan of those that were fitted (plan_like).
/// @throws DataError if the recordings differ in joints, or hold no stretch to differentiate
PreprocessPlan plan_preprocess(const std::vector<Recording>& recordings,
                               const PreprocessOptions& options = {});

/// The plan of other recordings for these: the same cut-off and bands [Hz], hence the same torque,
/// on the grid of their own period. What a slower one cannot hold is left out: up to a quarter of
/// its rate.
/// @throws DataError if the recordings differ in joints, or hold no stretch to differentiate
PreprocessPlan plan_like(const PreprocessPlan& plan, const std::vector<Recording>& recordings);

/// One whole recording.
Preprocessed preprocess(const Recording& recording, const PreprocessPlan& plan);

/// The same block by block in bounded memory: blocks overlap by as much as the filter remembers,
/// which makes the rows those of preprocess() to 1e-9 of their size.
class Preprocessor {
 public:
  /// @param block_rows  rows that are filtered at once [rows]; 0: chosen
  explicit Preprocessor(const PreprocessPlan& plan, long block_rows = 0);
  ~Preprocessor();
  /// Can be moved, not copied.
  ///@{
  Preprocessor(Preprocessor&&) noexcept;
  Preprocessor& operator=(Preprocessor&&) noexcept;
  ///@}

  /// Takes the next rows of one recording. @return rows that are complete
  /// @throws DataError if they are of another recording: finish() ends one
  Preprocessed push(const Recording& block);
  /// Ends the recording. @return the rows that waited for more
  Preprocessed finish();

 private:
  friend Preprocessed preprocess(const Recording&, const PreprocessPlan&);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace diffnea
