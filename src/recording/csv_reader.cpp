#include <algorithm>
#include <set>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/csv.hpp>

#include "core/number_text.hpp"
#include "recording/column_census.hpp"
#include "recording/credible_rows.hpp"
#include "recording/row_block.hpp"

namespace diffnea {

using detail::Channel;
using detail::number_text;
using detail::Row;

/// Step over the one before it from which a row came early, and those behind it are not late.
constexpr double kLate = 1.5;

/// Runs, the clock, and blocks of rows: what needs more than one row to be seen.
struct RecordingReader::Impl {
  Impl(const std::filesystem::path& path, const ReadOptions& opt)
      : name(opt.name.empty() ? path.string() : opt.name), options(opt), rows(path, opt, report) {
    report.source = name;
    report.notes = options.notes;
    report.notes.insert(report.notes.end(), header.notes.begin(), header.notes.end());
    report.extra_channels = header.extra_names;
    if (!header.extra_names.empty())
      report.notes.push_back("columns that are not of the format are kept as extra channels: " +
                             detail::join_or_none(header.extra_names));
    for (const Channel c :
         {Channel::kQd, Channel::kQdd, Channel::kQcmd, Channel::kQdcmd, Channel::kTaucmd})
      note_missing(c);
  }

  void note_missing(Channel channel) {
    std::vector<std::string> missing = header.joint_names;
    for (const detail::Column& c : header.columns)
      if (c.channel == channel) std::erase(missing, header.joint_names[c.index]);
    if (!missing.empty() && missing.size() < header.joint_names.size())
      report.notes.push_back(std::string("no ") + detail::channel_name(channel) +
                             " is measured at: " + detail::join_or_none(missing));
  }

  /// The run of a row that passed.
  int run_of(const Row& r) const {
    return run_column < 0 ? 0 : static_cast<int>(r.values[run_column]);
  }

  void set_pending() {
    std::swap(pending, row);
    has_pending = true;
  }

  void commit_pending() {
    if (!has_pending) return;
    const double time = pending.values[time_column];
    if (rows_in_run > 0) last_step = time - committed_time;
    committed_time = time;
    ++rows_in_run;
    accepted.insert(accepted.end(), pending.values.begin(), pending.values.end());
    ++num_accepted;
    has_pending = false;
  }

  /// Two rows behind the clock that follow each other: it goes on from there, and what it had
  /// counted lies on both sides. Stitched together, the motion would jump.
  /// @return whether it is so
  /// @throws DataError if it is, unless every row may be impossible
  bool refuse_set_back(double before, double now) {
    const bool goes_on = behind_line + 1 == row.line && behind_time < now;
    if (!goes_on) {
      behind_line = first_behind = row.line;
      behind_time = now;
      return false;
    }
    if (options.max_quarantined_share < 1.0)
      throw DataError(
          name + ":" + std::to_string(first_behind) + ": the clock is set back, from " +
          number_text(before, 6) + " to " + number_text(behind_time, 6) +
          " s, and goes on from there: what is before and after is no one motion; give the rows "
          "from this line on another number in a column `run`, or leave them out");
    behind_line = row.line;
    behind_time = now;
    return true;
  }

  /// Weighs `row` against the row before it. One row waits, because time that jumps ahead shows as
  /// wrong only when it jumps back.
  void offer_row() {
    if (has_pending) {
      const double before = pending.values[time_column], now = row.values[time_column];
      if (now > before) {
        commit_pending();
      } else {
        // More than 100 steps ahead and back to where the clock should be: the row before was
        // wrong.
        const double jump = before - committed_time, step = now - committed_time;
        const bool before_is_wrong =
            rows_in_run > 1 && step > 0.0 && jump > 100.0 * last_step && step < 10.0 * last_step;
        repeated += now == before ? 1 : 0;
        const bool set_back = (now < before || row.line == behind_line + 1) &&
                              !(jump > kLate * last_step) && refuse_set_back(before, now);
        rows.quarantine(
            before_is_wrong ? pending.line : row.line,
            before_is_wrong ? "time jumps ahead to " + number_text(before, 6) + " and back"
            : set_back ? detail::kSetBack + number_text(before, 6) + " to " + number_text(now, 6)
            : now == before ? "time repeats (" + number_text(now, 6) + ")"
                            : "time runs backward, from " + number_text(before, 6) + " to " +
                                  number_text(now, 6));
        if (!before_is_wrong) return;
      }
    }
    set_pending();
  }

  bool next(Recording& block, long max_rows) {
    if (max_rows < 1)
      throw DataError(name + ": a block of " + std::to_string(max_rows) +
                      " rows was asked for, expected 1 or more");
    accepted.clear();
    num_accepted = 0;
    while (num_accepted < max_rows) {
      // The first row of a new run waited until the run before was handed out.
      if (has_pending && num_accepted == 0 && new_run) begin_run();
      if (finished || !rows.next(row)) {
        finished = true;
        if (has_pending) {
          commit_pending();
          break;
        }
        if (num_accepted == 0) {
          check_whole_file();
          return false;
        }
        break;
      }
      census.count(row.values, header);
      if (has_pending && run_of(row) != run_of(pending)) {
        commit_pending();
        set_pending();
        new_run = true;
        break;
      }
      if (!has_pending && rows_in_run == 0) {
        set_pending();
        begin_run();
        continue;
      }
      offer_row();
    }
    block = detail::recording_of_rows(accepted, header);
    block.run = present_run;
    block.source = run_column < 0 ? name : name + " run " + std::to_string(present_run);
    block.info = options.info;
    return true;
  }

  void begin_run() {
    new_run = false;
    rows_in_run = 0;
    present_run = run_of(pending);
    if (!runs_seen.insert(present_run).second)
      throw DataError(name + ":" + std::to_string(pending.line) + ": run " +
                      std::to_string(present_run) +
                      " begins a second time; the rows of a run must follow each other");
  }

  /// What only the end of the file can tell.
  void check_whole_file() {
    if (checked) return;
    checked = true;
    if (report.rows == 0)
      throw DataError(name + ": there is a header and no row, expected measured rows");
    check_quarantined_share();
    detail::check_measured(census, header, options, report);
    if (report.quarantined > 0)
      report.notes.push_back(
          std::to_string(report.quarantined) + " of " + std::to_string(report.rows) +
          " recorded rows cannot be true and were quarantined, first line " +
          std::to_string(report.quarantined_rows.empty() ? 0
                                                         : report.quarantined_rows.front().line));
    if (rows.breaks_off())
      report.notes.push_back("the file breaks off in the middle of its last row, line " +
                             std::to_string(rows.last_line()) + ": is the copy complete?");
    detail::note_gaps(census, header, rows.text_cells(), report);
  }

  void check_quarantined_share() const {
    if (!(static_cast<double>(report.quarantined) >
          options.max_quarantined_share * static_cast<double>(report.rows)))
      return;
    std::string message = name + ": " + std::to_string(report.quarantined) + " of " +
                          std::to_string(report.rows) + " rows cannot be true, expected at most " +
                          number_text(100.0 * options.max_quarantined_share, 6) + " %:";
    for (std::size_t i = 0; i < std::min<std::size_t>(3, report.quarantined_rows.size()); ++i)
      message += (i == 0 ? " line " : "; line ") + std::to_string(report.quarantined_rows[i].line) +
                 ": " + report.quarantined_rows[i].reason;
    if (2 * repeated > report.quarantined)
      message +=
          " (stamps that are coarser than the rows: write `time` with more digits, or keep "
          "one row of each time)";
    else if (run_column < 0)
      message += " (several recordings in one file need a column `run`)";
    throw DataError(message);
  }

  std::string name;
  ReadOptions options;
  ReadReport report;
  detail::CredibleRows rows;
  const detail::Columns& header = rows.header();
  const long time_column = header.find(Channel::kTime), run_column = header.find(Channel::kRun);
  detail::ColumnCensus census{header};

  Row row, pending;  ///< the row just read, and the one before it, which waits
  bool has_pending = false, new_run = false, finished = false, checked = false;
  std::vector<double> accepted;  ///< rows of the block, row-major
  long num_accepted = 0;
  int present_run = 0;
  long rows_in_run = 0;
  double committed_time = 0.0, last_step = 0.0;
  long repeated = 0;                       ///< rows with the time of the row before
  long behind_line = 0, first_behind = 0;  ///< last and first row behind the clock
  double behind_time = 0.0;
  std::set<int> runs_seen;
};

RecordingReader::RecordingReader(const std::filesystem::path& path, const ReadOptions& options)
    : impl_(std::make_unique<Impl>(path, options)) {}
RecordingReader::~RecordingReader() = default;
RecordingReader::RecordingReader(RecordingReader&&) noexcept = default;
RecordingReader& RecordingReader::operator=(RecordingReader&&) noexcept = default;

bool RecordingReader::next(Recording& block, long max_rows) { return impl_->next(block, max_rows); }
const std::vector<std::string>& RecordingReader::joint_names() const {
  return impl_->header.joint_names;
}
const ReadReport& RecordingReader::report() const { return impl_->report; }

}  // namespace diffnea
