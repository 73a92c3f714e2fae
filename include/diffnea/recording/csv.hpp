#pragma once
/// Recordings as CSV files: the contract's columns, checked while they are read. docs/recordings.md
/// has the format and every message.
///
///     RecordingReader reader("arm.csv");
///     for (Recording block; reader.next(block, 10'000);) use(block);     // bounded memory
///     const std::vector<Recording> runs = read_recordings("arm.csv");   // all of it

#include <filesystem>
#include <memory>

#include <diffnea/core/fields.hpp>
#include <diffnea/recording/joints.hpp>
#include <diffnea/recording/recording.hpp>

namespace diffnea {

/// A column by another name than the file's.
struct ColumnName {
  std::string from;  ///< name in the file, with or without its unit
  std::string to;    ///< name of the format, "q_gripper [deg]"; empty: left out
};

/// What is known of a recording besides its file.
struct ReadOptions {
  std::string name;                 ///< file's name in messages; empty: its path
  std::vector<ColumnName> columns;  ///< columns with other names in the file
  std::vector<std::string> notes;   ///< first of the report: what a converter said
  RecordingInfo info;               ///< what columns cannot hold (sidecar, command line)
  /// Model's, where it is known: a unit that a joint cannot have is refused, effort limits
  /// help to tell which torques are absurd, and columns of other joints are left out if all of the
  /// model's are there.
  std::vector<JointDescription> joints;
  double max_quarantined_share = 0.01;  ///< above this share of the rows the file is refused
  /// A torque that is zero or empty throughout at a joint that nobody declared passive is refused.
  bool refuse_silent_torque = true;
  long max_listed = 1000;  ///< quarantined rows listed one by one; all are counted
};

/// A row that cannot be true and was left out.
struct QuarantinedRow {
  long line = 0;
  std::string reason;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("QuarantinedRow", "A row that cannot be true and was left out.");
    list.field("line", &QuarantinedRow::line, "In the file; 1 is the header.");
    list.field("reason", &QuarantinedRow::reason, "Why, e.g. ``time repeats (0.25)``.",
               {.optional = true});
  }
};

/// What reading a file brought up, as data.
struct ReadReport {
  std::string source;
  long rows = 0;
  long quarantined = 0;
  std::vector<QuarantinedRow> quarantined_rows;
  std::vector<std::string> extra_channels;
  std::vector<std::string> notes;

  void add(const ReadReport& other);  ///< of several files, one report

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ReadReport", "What reading a file brought up.");
    list.field("source", &ReadReport::source, "Path of the file; of several all, with commas.");
    list.field("rows", &ReadReport::rows, "Rows read, the quarantined included.");
    list.field("quarantined", &ReadReport::quarantined, "How many of them were left out.");
    list.field("quarantined_rows", &ReadReport::quarantined_rows, "The first of each file.");
    list.field("extra_channels", &ReadReport::extra_channels,
               "Columns that the contract does not know, kept.");
    list.field("notes", &ReadReport::notes, "One sentence each, for people.");
  }
};

/// Reads a file block by block, in memory that does not grow with it.
class RecordingReader {
 public:
  /// Opens the file and checks its header.
  /// @throws FileError if it cannot be read; DataError `file:line:column: what` for a header that
  /// the
  ///         contract does not allow
  explicit RecordingReader(const std::filesystem::path& path, const ReadOptions& options = {});
  ~RecordingReader();
  /// Can be moved, not copied.
  ///@{
  RecordingReader(RecordingReader&&) noexcept;
  RecordingReader& operator=(RecordingReader&&) noexcept;
  ///@}

  /// The next rows of one run; a block never spans two runs. Rows that cannot be true are left out.
  /// @param block     overwritten; between 1 and max_rows rows
  /// @param max_rows  above 0
  /// @return false at the end of the file
  /// @throws DataError for a cell that is no number, a row of another length, a run that comes
  /// twice;
  ///         and, since only the end tells, with the last block: too many quarantined rows, a
  ///         torque that is zero throughout at a joint that nobody declared passive
  bool next(Recording& block, long max_rows);

  /// Joints of the columns that are read, in the file's order.
  const std::vector<std::string>& joint_names() const;

  /// Complete once next() has returned false.
  const ReadReport& report() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// All runs of a file, in its order. @throws as RecordingReader  @param report  overwritten if
/// given
std::vector<Recording> read_recordings(const std::filesystem::path& path,
                                       const ReadOptions& options = {},
                                       ReadReport* report = nullptr);

/// All runs of several files; runs are renumbered 0, 1, 2 … in order, `source` keeps file and run.
std::vector<Recording> read_recordings(const std::vector<std::filesystem::path>& paths,
                                       const ReadOptions& options = {},
                                       ReadReport* report = nullptr);

/// Writes SI columns with names of the contract, numbers to the last bit, a gap as an empty cell; a
/// `run` column if there are several. The file appears complete or not at all.
/// @throws FileError; DataError if recordings of other joints or channels would share the file
void write_recording(const Recording& recording, const std::filesystem::path& path);
/// Writes recordings of one robot into one file, as its runs; whole or not at all. @throws
/// FileError, DataError
void write_recordings(const std::vector<Recording>& recordings, const std::filesystem::path& path);

}  // namespace diffnea
