#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <memory>
#include <set>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/csv.hpp>

#include "recording/columns.hpp"
#include "recording/foreign_file.hpp"
#include "recording/torque_spikes.hpp"

namespace diffnea {
namespace {

using detail::Channel;
using detail::Column;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct FileCloser {
  void operator()(std::FILE* f) const { std::fclose(f); }
};

/// Lines of a file, read in large pieces.
class LineSource {
 public:
  LineSource(const std::filesystem::path& path, const std::string& name) {
    detail::refuse_foreign_file(path, name);
    file_.reset(std::filesystem::is_directory(path) ? nullptr : std::fopen(path.c_str(), "rb"));
    if (!file_)
      throw FileError(name + ": the recording cannot be opened; expected a readable CSV file");
    buffer_.resize(1 << 20);
  }

  /// @param line  without its end  @return false at the end of the file
  bool next(std::string_view& line) {
    while (true) {
      const char* begin = buffer_.data() + begin_;
      const void* newline = std::memchr(begin, '\n', end_ - begin_);
      if (newline != nullptr || (at_end_ && begin_ < end_)) {
        terminated_ = newline != nullptr;
        const char* last = terminated_ ? static_cast<const char*>(newline) : buffer_.data() + end_;
        begin_ = last - buffer_.data() + (terminated_ ? 1 : 0);
        if (last > begin && last[-1] == '\r') --last;
        line = {begin, static_cast<std::size_t>(last - begin)};
        ++number_;
        return true;
      }
      if (at_end_) return false;
      std::memmove(buffer_.data(), begin, end_ - begin_);
      end_ -= begin_;
      begin_ = 0;
      if (end_ == buffer_.size()) buffer_.resize(2 * buffer_.size());
      const std::size_t got =
          std::fread(buffer_.data() + end_, 1, buffer_.size() - end_, file_.get());
      end_ += got;
      at_end_ = got == 0;
    }
  }

  long number() const { return number_; }          ///< of the last line, from 1
  bool terminated() const { return terminated_; }  ///< the last line had a line feed

 private:
  std::unique_ptr<std::FILE, FileCloser> file_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0, end_ = 0;
  bool at_end_ = false, terminated_ = true;
  long number_ = 0;
};

/// A cell that std::from_chars did not take whole: empty or NA is a gap, a number out of range is
/// infinite or 0.
/// @return false if it is no number
bool parse_odd_cell(std::string_view cell, double& out) {
  const auto drop = [&](std::string_view chars) {
    while (!cell.empty() && chars.find(cell.front()) != chars.npos) cell.remove_prefix(1);
    while (!cell.empty() && chars.find(cell.back()) != chars.npos) cell.remove_suffix(1);
  };
  drop(" \t\r");
  if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"') drop("\"");
  drop(" \t");
  out = kNaN;
  if (cell.empty() || cell == "NA" || cell == "N/A" || cell == "null") return true;
  if (cell.front() == '+') cell.remove_prefix(1);
  const char* end = cell.data() + cell.size();
  const auto [last, error] = std::from_chars(cell.data(), end, out);
  if (error == std::errc::result_out_of_range)
    out = std::strtod(std::string(cell).c_str(), nullptr);
  return error != std::errc::invalid_argument && last == end;
}

std::string number_text(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", x);
  return text;
}

}  // namespace

struct RecordingReader::Impl {
  struct WaitingRow {
    long line = 0;
    std::vector<double> values;
    std::string reason;  ///< why it is suspect
  };

  Impl(const std::filesystem::path& path, const ReadOptions& opt)
      : name(path.string()), options(opt), lines(path, name) {
    std::string_view line;
    do {
      if (!lines.next(line))
        throw DataError(name + ": the file is empty, expected a header and rows");
    } while (line.find_first_not_of(" \t") == line.npos);
    header = detail::parse_header(line, name, options.info, options.joints);
    report.source = name;
    report.notes = header.notes;
    report.extra_channels = header.extra_names;
    const int n = static_cast<int>(header.joint_names.size());
    passive.assign(n, false);
    for (int j = 0; j < n; ++j)
      passive[j] = std::ranges::find(options.info.passive, header.joint_names[j]) !=
                   options.info.passive.end();
    largest_tau.assign(n, -1.0);
    for (std::size_t k = 0; k < header.columns.size(); ++k) {
      if (header.columns[k].channel == Channel::kTime) time_column = k;
      if (header.columns[k].channel == Channel::kRun) run_column = static_cast<long>(k);
      limits.push_back(detail::largest_credible(header.columns[k].channel));
    }
    suspect_torques = detail::suspect_torques(path, header, options.joints);
    gaps.assign(header.columns.size(), 0);
    text_extras.assign(header.extra_names.size(), 0);
    if (!header.extra_names.empty())
      report.notes.push_back("columns that are not of the format are kept as extra channels: " +
                             detail::join(header.extra_names));
    for (const Channel c : {Channel::kQd, Channel::kQdd, Channel::kQcmd}) note_missing(c);
  }

  void note_missing(Channel channel) {
    std::vector<std::string> missing = header.joint_names;
    for (const Column& c : header.columns)
      if (c.channel == channel) std::erase(missing, header.joint_names[c.index]);
    if (!missing.empty() && missing.size() < header.joint_names.size())
      report.notes.push_back(std::string("no ") + detail::channel_name(channel) +
                             " is measured at: " + detail::join(missing));
  }

  void quarantine(long line, std::string reason) {
    ++report.quarantined;
    if (static_cast<long>(report.quarantined_rows.size()) < options.max_listed)
      report.quarantined_rows.push_back({line, std::move(reason)});
  }

  [[noreturn]] void fail(std::size_t column, const std::string& what) const {
    throw DataError(name + ":" + std::to_string(lines.number()) + ":" + std::to_string(column + 1) +
                    ": " + what);
  }

  /// Parses a line into `row`, in SI. @return false if it is cut off at the end of the file
  bool parse(std::string_view line) {
    const std::size_t num_columns = header.columns.size();
    row.resize(num_columns);
    const char* p = line.data();
    const char* const end = p + line.size();
    std::size_t k = 0;
    while (k < num_columns) {
      while (p != end && *p == ' ') ++p;
      double x = kNaN;
      const auto [last, error] = std::from_chars(p, end, x);
      if (error == std::errc() && (last == end || *last == ',')) {
        p = last;
      } else {
        const void* comma = std::memchr(p, ',', end - p);
        const char* cell_end = comma != nullptr ? static_cast<const char*>(comma) : end;
        const std::string_view cell(p, cell_end - p);
        if (!parse_odd_cell(cell, x)) {
          const Column& c = header.columns[k];
          // "1e", "-" at the very end of the file: the beginning of a number.
          const bool is_beginning = cell.find_first_not_of("0123456789+-.eE") == cell.npos;
          if (!lines.terminated() && cell_end == end && is_beginning) return false;
          if (c.channel != Channel::kExtra)
            fail(k, "'" + std::string(cell.substr(0, 40)) + "' in column '" + c.name +
                        "' is no number; an empty cell or NaN marks a gap");
          ++text_extras[c.index];
          x = kNaN;
        }
        p = cell_end;
      }
      row[k] = x * header.columns[k].scale;
      ++k;
      if (p == end || k == num_columns) break;
      ++p;  // the comma
    }
    if (k == num_columns && p == end) return true;
    if (k < num_columns && !lines.terminated()) return false;
    const std::size_t got = 1 + std::ranges::count(line, ',');
    fail(std::min(got, num_columns), "the row has " + std::to_string(got) + " cells, the header " +
                                         std::to_string(num_columns));
  }

  /// Why the row cannot be true, looked at alone; empty if it can.
  std::string reason_against_row() const {
    if (std::isnan(row[time_column])) return "the time is missing";
    for (std::size_t k = 0; k < row.size(); ++k) {
      const double size = std::abs(row[k]);
      if (!(size > limits[k])) continue;  // NaN is a gap
      return "'" + header.columns[k].name + "' is " + number_text(row[k]) + ", " +
             (std::isinf(size) ? "infinite" : "absurdly large");
    }
    if (run_column >= 0 && std::nearbyint(row[run_column]) != row[run_column])
      return "`run` is " + number_text(row[run_column]) + ", expected an integer";
    return {};
  }

  /// Why a torque of the row is suspect; empty if none is.
  std::string reason_against_torque() const {
    for (std::size_t k = 0; k < row.size(); ++k)
      if (std::abs(row[k]) > suspect_torques[k].above &&
          !passive[header.columns[k].index])  // a passive joint's torque is not used
        return "'" + header.columns[k].name + "' is " + number_text(row[k]) + ", " +
               suspect_torques[k].than + ", and its neighbours are not";
    return {};
  }

  /// Suspect torques of a short burst cannot be true.
  void quarantine_burst() {
    for (WaitingRow& w : burst) quarantine(w.line, std::move(w.reason));
    burst.clear();
  }

  /// The next row that can be true, into `row` and `row_line`. @return false at the end of the file
  bool read_row() {
    std::string_view line;
    while (released.empty()) {
      if (!lines.next(line)) {
        quarantine_burst();
        return false;
      }
      if (line.find_first_not_of(" \t") == line.npos) continue;
      ++report.rows;
      row_line = lines.number();
      if (!parse(line)) {
        quarantine(row_line, "the file ends in the middle of the row");
        breaks_off = true;
        continue;
      }
      if (std::string reason = reason_against_row(); !reason.empty()) {
        quarantine(row_line, std::move(reason));
        continue;
      }
      std::string suspicion = reason_against_torque();
      if (suspicion.empty()) {
        quarantine_burst();
        in_long_burst = false;
        return true;
      }
      if (in_long_burst) return true;
      burst.push_back({row_line, row, std::move(suspicion)});
      if (burst.size() > detail::kLongestBurst) {
        released.swap(burst);
        in_long_burst = true;
      }
    }
    row_line = released.front().line;
    row = std::move(released.front().values);
    released.pop_front();
    return true;
  }

  /// The run of a row that passed.
  int run_of(const std::vector<double>& r) const {
    return run_column < 0 ? 0 : static_cast<int>(r[run_column]);
  }

  void commit_pending() {
    if (!has_pending) return;
    const double time = pending[time_column];
    if (rows_in_run > 0) last_step = time - committed_time;
    committed_time = time;
    ++rows_in_run;
    accepted.insert(accepted.end(), pending.begin(), pending.end());
    ++num_accepted;
    has_pending = false;
  }

  /// Weighs `row` against the row before it. One row waits, because time that jumps ahead shows as
  /// wrong only when it jumps back.
  void offer_row() {
    if (has_pending) {
      const double before = pending[time_column], now = row[time_column];
      if (now > before) {
        commit_pending();
      } else {
        // More than 100 steps ahead and back to where the clock should be: the row before was
        // wrong.
        const double jump = before - committed_time, step = now - committed_time;
        const bool before_is_wrong =
            rows_in_run > 1 && step > 0.0 && jump > 100.0 * last_step && step < 10.0 * last_step;
        quarantine(before_is_wrong ? pending_line : row_line,
                   before_is_wrong ? "time jumps ahead to " + number_text(before) + " and back"
                   : now == before ? "time repeats (" + number_text(now) + ")"
                                   : "time runs backward, from " + number_text(before) + " to " +
                                         number_text(now));
        if (!before_is_wrong) return;
      }
    }
    std::swap(pending, row);
    pending_line = row_line;
    has_pending = true;
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
      if (finished || !read_row()) {
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
      note_values();
      if (has_pending && run_of(row) != run_of(pending)) {
        commit_pending();
        std::swap(pending, row);
        pending_line = row_line;
        has_pending = true;
        new_run = true;
        break;
      }
      if (!has_pending && rows_in_run == 0) {
        std::swap(pending, row);
        pending_line = row_line;
        has_pending = true;
        begin_run();
        continue;
      }
      offer_row();
    }
    build(block);
    return true;
  }

  void begin_run() {
    new_run = false;
    rows_in_run = 0;
    present_run = run_of(pending);
    if (!runs_seen.insert(present_run).second)
      throw DataError(name + ":" + std::to_string(pending_line) + ": run " +
                      std::to_string(present_run) +
                      " begins a second time; the rows of a run must follow each other");
  }

  void note_values() {
    ++num_noted;
    for (std::size_t k = 0; k < row.size(); ++k) {
      gaps[k] += std::isnan(row[k]) ? 1 : 0;
      if (header.columns[k].channel == Channel::kTau) {
        double& largest = largest_tau[header.columns[k].index];
        largest = std::max(largest, std::isnan(row[k]) ? -1.0 : std::abs(row[k]));
      }
    }
  }

  /// Whether the file has columns for the ball, and one of them never holds a number.
  bool never_seen() const {
    for (std::size_t k = 0; k < gaps.size(); ++k)
      if (header.columns[k].channel == Channel::kBall && gaps[k] == num_noted) return true;
    return false;
  }

  /// Columns of joints that lack values in some rows, each with their number.
  std::string gaps_text() const {
    std::string out;
    for (std::size_t k = 0; k < gaps.size(); ++k) {
      const Channel channel = header.columns[k].channel;
      if (gaps[k] > 0 && (channel == Channel::kQ || channel == Channel::kTau))
        out += (out.empty() ? "'" : ", '") + header.columns[k].name + "' in " +
               std::to_string(gaps[k]);
    }
    return out;
  }

  void build(Recording& r) const {
    const long n = static_cast<long>(header.joint_names.size()), rows = num_accepted;
    r = Recording{};
    r.run = present_run;
    r.source = run_column < 0 ? name : name + " run " + std::to_string(r.run);
    r.joint_names = header.joint_names;
    r.info = options.info;
    r.has_tau.assign(n, false);
    r.time.resize(rows);
    r.q.resize(rows, n);
    r.tau.setConstant(rows, n, kNaN);
    for (long j = 0; j < n; ++j) {
      r.has_tau[j] = header.has_tau[j] && !passive[j];
      if (passive[j]) r.tau.col(j).setZero();
    }
    for (const std::string& extra : header.extra_names)
      r.extra.push_back({extra, VecX<double>(rows)});
    const auto target = [&](RowMatX<double>& m, long columns) -> RowMatX<double>& {
      if (m.cols() != columns) m.setConstant(rows, columns, kNaN);
      return m;
    };
    const long num_columns = static_cast<long>(header.columns.size());
    for (long k = 0; k < num_columns; ++k) {
      const Column& c = header.columns[k];
      const Eigen::Map<const VecX<double>, 0, Eigen::InnerStride<>> x(
          accepted.data() + k, rows, Eigen::InnerStride<>(num_columns));
      switch (c.channel) {
        case Channel::kTime:
          r.time = x;
          break;
        case Channel::kRun:
          break;
        case Channel::kQ:
          r.q.col(c.index) = x;
          break;
        case Channel::kQd:
          target(r.qd, n).col(c.index) = x;
          break;
        case Channel::kQdd:
          target(r.qdd, n).col(c.index) = x;
          break;
        case Channel::kQcmd:
          target(r.qcmd, n).col(c.index) = x;
          break;
        case Channel::kTau:
          if (r.has_tau[c.index]) r.tau.col(c.index) = x;
          break;
        case Channel::kBall:
          target(r.ball, 3).col(c.index) = x;
          break;
        case Channel::kSpin:
          target(r.spin, 3).col(c.index) = x;
          break;
        case Channel::kExtra:
          r.extra[c.index].values = x;
          break;
      }
    }
  }

  /// What only the end of the file can tell.
  void check_whole_file() {
    if (checked) return;
    checked = true;
    if (report.rows == 0)
      throw DataError(name + ": there is a header and no row, expected measured rows");
    if (static_cast<double>(report.quarantined) >
        options.max_quarantined_share * static_cast<double>(report.rows)) {
      std::string message = name + ": " + std::to_string(report.quarantined) + " of " +
                            std::to_string(report.rows) +
                            " rows cannot be true, expected at most " +
                            number_text(100.0 * options.max_quarantined_share) + " %:";
      for (std::size_t i = 0; i < std::min<std::size_t>(3, report.quarantined_rows.size()); ++i)
        message += (i == 0 ? " line " : "; line ") +
                   std::to_string(report.quarantined_rows[i].line) + ": " +
                   report.quarantined_rows[i].reason;
      throw DataError(message + (run_column < 0
                                     ? " (several recordings in one file need a column `run`)"
                                     : ""));
    }
    for (std::size_t j = 0; j < header.joint_names.size(); ++j) {
      const std::string column = "'tau_" + header.joint_names[j] + "'";
      if (!header.has_tau[j]) continue;
      if (passive[j]) {
        if (largest_tau[j] > 0.0)
          report.notes.push_back("the joint is declared passive, so its " + column + " (up to " +
                                 number_text(largest_tau[j]) + ") is not used");
      } else if (!options.refuse_silent_torque) {
        continue;
      } else if (largest_tau[j] < 0.0) {
        throw DataError(
            name + ": column " + column +
            " has no value; without the column the joint's motion is taken as prescribed");
      } else if (largest_tau[j] == 0.0) {
        throw DataError(
            name + ": column " + column +
            " is 0 in every row; declare the joint passive if its torque is known to be zero, or "
            "leave the column out if it was not measured");
      }
    }
    if (never_seen()) {
      if (header.joint_names.empty() && options.refuse_silent_torque)
        throw DataError(name +
                        ": the ball is seen in no row (ball_x, ball_y, ball_z), and there is no "
                        "joint (q_<joint>): nothing was measured");
      report.notes.emplace_back("the ball is seen in no row");
    }
    if (report.quarantined > 0)
      report.notes.push_back(
          std::to_string(report.quarantined) + " of " + std::to_string(report.rows) +
          " recorded rows cannot be true and were quarantined, first line " +
          std::to_string(report.quarantined_rows.empty() ? 0
                                                         : report.quarantined_rows.front().line));
    if (breaks_off)
      report.notes.push_back("the file breaks off in the middle of its last row, line " +
                             std::to_string(lines.number()) + ": is the copy complete?");
    if (const std::string missing = gaps_text(); !missing.empty())
      report.notes.push_back("values are missing: " + missing + " of " +
                             std::to_string(report.rows) +
                             " rows; a short gap is bridged by interpolation, a long one splits "
                             "the recording");
    for (std::size_t i = 0; i < text_extras.size(); ++i)
      if (text_extras[i] > 0)
        report.notes.push_back("extra channel '" + header.extra_names[i] + "' holds " +
                               std::to_string(text_extras[i]) + " cells that are no numbers: NaN");
  }

  std::string name;
  ReadOptions options;
  LineSource lines;
  detail::Columns header;
  ReadReport report;
  std::size_t time_column = 0;
  long run_column = -1;
  std::vector<double> limits;                          ///< largest credible size per column
  std::vector<detail::SuspectTorque> suspect_torques;  ///< per column
  std::vector<long> gaps;                              ///< per column: rows without a value
  long num_noted = 0;                                  ///< rows that were counted for it
  std::vector<bool> passive;                           ///< per joint
  std::vector<double> largest_tau;                     ///< per joint, −1: no value yet
  std::vector<long> text_extras;  ///< per extra channel: cells that are no numbers

  std::vector<double> row, pending;  ///< the row just read, and the one before it, which waits
  long row_line = 0, pending_line = 0;
  std::deque<WaitingRow> burst;     ///< rows with suspect torques, until it shows how many follow
  std::deque<WaitingRow> released;  ///< a burst that was too long to be one
  bool in_long_burst = false, breaks_off = false;
  bool has_pending = false, new_run = false, finished = false, checked = false;
  std::vector<double> accepted;  ///< rows of the block, row-major
  long num_accepted = 0;
  int present_run = 0;
  long rows_in_run = 0;
  double committed_time = 0.0, last_step = 0.0;
  std::set<int> runs_seen;
};

RecordingReader::RecordingReader(const std::filesystem::path& path, const ReadOptions& options)
    : impl_(std::make_unique<Impl>(path, options)) {}
RecordingReader::~RecordingReader() = default;
RecordingReader::RecordingReader(RecordingReader&&) noexcept = default;
RecordingReader& RecordingReader::operator=(RecordingReader&&) noexcept = default;

bool RecordingReader::next(Recording& block, long max_rows) { return impl_->next(block, max_rows); }
const ReadReport& RecordingReader::report() const { return impl_->report; }

void ReadReport::add(const ReadReport& other) {
  source += (source.empty() ? "" : ", ") + other.source;
  rows += other.rows;
  quarantined += other.quarantined;
  quarantined_rows.insert(quarantined_rows.end(), other.quarantined_rows.begin(),
                          other.quarantined_rows.end());
  for (const std::string& name : other.extra_channels)
    if (std::ranges::find(extra_channels, name) == extra_channels.end())
      extra_channels.push_back(name);
  for (const std::string& note : other.notes) notes.push_back(other.source + ": " + note);
}

namespace {

/// Blocks of one run, end to end.
Recording concatenate(std::vector<Recording>& blocks) {
  if (blocks.size() == 1) return std::move(blocks.front());
  long rows = 0;
  for (const Recording& b : blocks) rows += b.rows();
  Recording out = blocks.front();
  const auto stack = [&](RowMatX<double> Recording::* member) {
    RowMatX<double>& m = out.*member;
    if (m.rows() == 0) return;  // not measured; without joints, q has rows and no columns
    m.resize(rows, m.cols());
    long at = 0;
    for (const Recording& b : blocks) {
      m.middleRows(at, b.rows()) = b.*member;
      at += b.rows();
    }
  };
  for (auto member : {&Recording::q, &Recording::qd, &Recording::qdd, &Recording::qcmd,
                      &Recording::tau, &Recording::ball, &Recording::spin})
    stack(member);
  out.time.resize(rows);
  for (ExtraChannel& e : out.extra) e.values.resize(rows);
  long at = 0;
  for (const Recording& b : blocks) {
    out.time.segment(at, b.rows()) = b.time;
    for (std::size_t i = 0; i < out.extra.size(); ++i)
      out.extra[i].values.segment(at, b.rows()) = b.extra[i].values;
    at += b.rows();
  }
  return out;
}

}  // namespace

std::vector<Recording> read_recordings(const std::filesystem::path& path,
                                       const ReadOptions& options, ReadReport* report) {
  constexpr long kBlockRows = 1 << 16;
  RecordingReader reader(path, options);
  std::vector<Recording> out, blocks;
  for (Recording block; reader.next(block, kBlockRows);) {
    if (!blocks.empty() && blocks.front().run != block.run) {
      out.push_back(concatenate(blocks));
      blocks.clear();
    }
    blocks.push_back(std::move(block));
  }
  if (!blocks.empty()) out.push_back(concatenate(blocks));
  if (report != nullptr) *report = reader.report();
  return out;
}

std::vector<Recording> read_recordings(const std::vector<std::filesystem::path>& paths,
                                       const ReadOptions& options, ReadReport* report) {
  std::vector<Recording> out;
  if (report != nullptr) *report = {};
  for (const std::filesystem::path& path : paths) {
    ReadReport one;
    for (Recording& r : read_recordings(path, options, &one)) {
      r.run = static_cast<int>(out.size());
      out.push_back(std::move(r));
    }
    if (report != nullptr) report->add(one);
  }
  return out;
}

}  // namespace diffnea
