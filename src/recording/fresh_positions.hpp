#pragma once
/// Positions of a sensor that is slower than a log whose rows come at uneven times. Internal to the
/// library.

#include <vector>

#include <diffnea/recording/preprocess.hpp>
#include <diffnea/recording/recording.hpp>

namespace diffnea::detail {

/// Rows of a recording, of those channels that paths and simulations are made of.
Recording part(const Recording& recording, long from, long rows);

/// Tells whether some sensor is slower than a log whose rows lie off the plan's grid: repeats must
/// go before rows are interpolated.
bool is_slow_and_uneven(const PreprocessPlan& plan);

/// Positions of a recording without their repeats, block by block.
class FreshPositions {
 public:
  /// @param refresh  (n) as of refresh_rows()
  /// @param curved   what lies between new values: such polynomials, or lines
  FreshPositions(std::vector<int> refresh, bool curved);

  /// @return rows that are complete; the last ones wait for values to come
  Recording push(const Recording& block);
  /// @return the rows that wait; the next block begins a recording
  Recording finish();
  /// All of a recording.
  Recording whole(const Recording& recording);

 private:
  Recording filled(long to);

  std::vector<int> refresh_;
  bool curved_;
  long margin_;        ///< rows on either side that a filled one may hang on
  Recording kept_;     ///< rows as measured
  long returned_ = 0;  ///< number of these
};

}  // namespace diffnea::detail
