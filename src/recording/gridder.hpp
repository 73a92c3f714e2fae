#pragma once
/// Measured rows to a uniform grid, segment by segment, as a stream. Internal to recording/.

#include <vector>

#include <diffnea/recording/recording.hpp>

namespace diffnea::detail {

/// Columns of a grid row: q (n), τ (n), then q̇ (n) if it is wanted.
class Gridder {
 public:
  struct Options {
    double dt = 0.0;        ///< [s]
    double max_gap = 5.0;   ///< [periods]
    bool velocity = false;  ///< measured q̇ too
    bool average_hold =
        true;  ///< τ of kHold sampling: at the rows' instants, from the held values about them
  };
  Gridder(const Options& options, int num_joints);

  int num_columns() const { return num_columns_; }

  /// Takes row i of `r`. @return false if it cannot follow the row before: call finish_segment()
  /// and offer it again. Rows with a gap are left out (a long stretch of them is a pause).
  bool push(const Recording& r, long i);
  /// Grid points that waited for a further row; the next row begins a segment.
  void finish_segment();

  /// Finished grid rows of the present segment, (rows × num_columns), row-major; the caller takes
  /// them away.
  std::vector<double> rows;
  double start_time() const { return t0_; }  ///< of the segment's grid point 0
  bool in_segment() const { return !times_.empty(); }

 private:
  void emit_interval(std::size_t k);
  void place_held_torque();

  Options options_;
  int n_, num_columns_;
  std::vector<double> times_;  ///< of the raw rows that are still needed, at most 4
  std::vector<double> raw_;    ///< the same rows' columns
  std::vector<double> held_;   ///< measured τ of the last four rows, oldest first
  double t0_ = 0.0;
  long next_ = 0;                  ///< grid point to come
  long pushed_ = 0, emitted_ = 0;  ///< rows so far: of recordings, of the grid
};

/// Rows without a position, a measured torque or, if wanted, a velocity.
bool is_gap(const Recording& r, long i, bool velocity);

}  // namespace diffnea::detail
