#pragma once
/// The rows of a recording that can be true, each looked at alone: others are quarantined.
/// Internal.

#include <array>
#include <deque>
#include <filesystem>
#include <string>
#include <vector>

#include <diffnea/recording/csv.hpp>

#include "recording/columns.hpp"
#include "recording/line_source.hpp"
#include "recording/torque_spikes.hpp"

namespace diffnea::detail {

/// Beginning of the reason against rows behind a clock that was set back and goes on from there.
inline const std::string kSetBack = "the clock is set back, from ";

/// A row of the file in SI.
struct Row {
  long line = 0;               ///< in the file, 1 is the header
  std::vector<double> values;  ///< per column; a gap is NaN
};

class CredibleRows {
 public:
  /// Reads the header.
  /// @param report  gets the rows' number and those that are quarantined; outlives this
  /// @throws FileError, DataError as RecordingReader
  CredibleRows(const std::filesystem::path& path, const ReadOptions& options, ReadReport& report);

  const Columns& header() const { return header_; }

  /// @param row  overwritten  @return false at the end of the file
  bool next(Row& row);

  void quarantine(long line, std::string reason);

  // Complete at the end of the file.
  long last_line() const { return lines_.number(); }
  bool breaks_off() const { return breaks_off_; }  ///< in the middle of the last row
  const std::vector<long>& text_cells() const { return text_cells_; }  ///< per extra channel

 private:
  struct SuspectRow {
    Row row;
    std::string reason;
  };

  /// Why the row cannot be true; empty if it can.
  std::string reason_against_row(const std::vector<double>& row) const;
  /// Why a torque of the row is suspect; empty if none is.
  std::string reason_against_torque(const std::vector<double>& row) const;
  /// Suspect torques of a short burst cannot be true.
  void quarantine_burst();

  ReadReport& report_;
  long max_listed_;
  LineSource lines_;
  Columns header_;
  std::size_t time_column_ = 0;
  long run_column_ = -1;
  std::array<long, 4> quaternion_{-1, -1, -1, -1};  ///< columns of x, y, z, w
  std::vector<double> limits_;                  ///< largest credible size per column
  std::vector<SuspectTorque> suspect_torques_;  ///< per column; never at a passive joint
  std::vector<long> text_cells_;
  std::deque<SuspectRow> burst_;     ///< rows with suspect torques, until it shows how many follow
  std::deque<SuspectRow> released_;  ///< a burst that was too long to be one
  bool in_long_burst_ = false, breaks_off_ = false;
};

}  // namespace diffnea::detail
