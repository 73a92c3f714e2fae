#pragma once
/// A recording as whole stretches, and whether their motion repeats. Internal to diagnose/.

#include <diffnea/effects/joint_series.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

/// Blocks of filtered rows, put together stretch by stretch.
class Stretches {
 public:
  /// @param first_run  number of the first recording
  explicit Stretches(int first_run) : first_run_(first_run) {}
  void add(const Preprocessed& block);

  /// Drops stretches of fewer rows.
  void drop_shorter(long rows);
  void drop_first(std::size_t i, long rows);
  /// Other positions of a stretch, with their path.
  void set_positions(std::size_t i, RowMatX<double> positions, const PreprocessPlan& plan);

  /// Own motion and logged torque of every stretch.
  const std::vector<JointSeries>& series() const { return series_; }
  /// Logged positions of every stretch, not filtered.
  const std::vector<RowMatX<double>>& positions() const { return positions_; }
  /// Rows of a stretch with the motion of `s` and their own torque.
  Preprocessed rows_of(std::size_t i, const JointSeries& s, long from, long count) const;
  /// Where a stretch comes from, without its rows.
  const Preprocessed& about(std::size_t i) const { return about_[i]; }

 private:
  void begin(const Preprocessed& block, long row);

  int first_run_;
  double run_start_ = 0.0;
  std::vector<JointSeries> series_;
  std::vector<RowMatX<double>> positions_;
  std::vector<Preprocessed> about_;  ///< of each stretch: all but its rows
};

/// Sets the plan's path through positions, (rows(), n).
void set_path(const RowMatX<double>& positions, const PreprocessPlan& plan, JointSeries& s);

/// Rows until the motion repeats, within its first period: a loop that starts at rest catches up.
/// Of two periods, at most a third of the first; 0 with less.
long settling_rows(double period, const JointSeries& s);

/// Tells whether every period of the motion is as the others, but for noise; not if few rows have
/// another one at their phase, or a period is no whole number of samples.
bool repeats(double period, const JointSeries& s);

}  // namespace diffnea
