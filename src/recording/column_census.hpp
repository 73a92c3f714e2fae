#pragma once
/// Contents of the columns of a recording from its first row to its last: values that are missing,
/// positions without any, torques that are zero throughout. Internal.

#include <vector>

#include <diffnea/recording/csv.hpp>

#include "recording/columns.hpp"

namespace diffnea::detail {

struct ColumnCensus {
  long rows = 0;                    ///< that were counted
  std::vector<long> gaps;           ///< per column: rows without a value
  std::vector<long> before, after;  ///< gaps before the first value, after the last
  std::vector<double> first, last;  ///< per column: times of the first and the last value [s]
  std::vector<double> largest_tau;  ///< per joint, −1: no value yet
  std::size_t time_column = 0;

  explicit ColumnCensus(const Columns& header)
      : gaps(header.columns.size(), 0),
        before(gaps),
        after(gaps),
        first(gaps.size(), 0.0),
        last(first),
        largest_tau(header.joint_names.size(), -1.0),
        time_column(static_cast<std::size_t>(header.find(Channel::kTime))) {}

  void count(const std::vector<double>& row, const Columns& header);
};

/// Notes what is measured and cannot be used.
/// @param report  its `source` is read, its notes are added to
/// @throws DataError for a position without any value, a torque that is zero or empty throughout at
///         a joint that nobody declared passive, a file in which nothing was measured
void check_measured(const ColumnCensus& census, const Columns& header, const ReadOptions& options,
                    ReadReport& report);

/// Notes gaps, and text where numbers were expected.
/// @param text_cells  (extra channels) cells that are no numbers
/// @param report      its `rows` are read, its notes are added to
void note_gaps(const ColumnCensus& census, const Columns& header,
               const std::vector<long>& text_cells, ReadReport& report);

}  // namespace diffnea::detail
