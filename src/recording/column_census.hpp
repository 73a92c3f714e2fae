#pragma once
/// What the columns of a recording hold from its first row to its last: values that are missing,
/// torques that are zero throughout. Internal.

#include <vector>

#include <diffnea/recording/csv.hpp>

#include "recording/columns.hpp"

namespace diffnea::detail {

struct ColumnCensus {
  long rows = 0;                    ///< that were counted
  std::vector<long> gaps;           ///< per column: rows without a value
  std::vector<double> largest_tau;  ///< per joint, −1: no value yet

  explicit ColumnCensus(const Columns& header)
      : gaps(header.columns.size(), 0), largest_tau(header.joint_names.size(), -1.0) {}

  void count(const std::vector<double>& row, const Columns& header);
};

/// Notes what is measured and cannot be used.
/// @param report  its `source` is read, its notes are added to
/// @throws DataError for a torque that is zero or empty throughout at a joint that nobody declared
///         passive, a file in which nothing was measured
void check_measured(const ColumnCensus& census, const Columns& header, const ReadOptions& options,
                    ReadReport& report);

/// Notes gaps, and text where numbers were expected.
/// @param text_cells  (extra channels) cells that are no numbers
/// @param report      its `rows` are read, its notes are added to
void note_gaps(const ColumnCensus& census, const Columns& header,
               const std::vector<long>& text_cells, ReadReport& report);

}  // namespace diffnea::detail
