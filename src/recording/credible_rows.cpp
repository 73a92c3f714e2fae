#include "recording/credible_rows.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/foreign_file.hpp>

#include "core/number_text.hpp"
#include "recording/csv_row.hpp"
#include "recording/floating_base.hpp"

namespace diffnea::detail {
namespace {

/// The path itself, unless Python would have to convert the file first.
const std::filesystem::path& of_csv(const std::filesystem::path& path) {
  refuse_foreign_file(path, path.string());
  return path;
}

}  // namespace

CredibleRows::CredibleRows(const std::filesystem::path& path, const ReadOptions& options,
                           ReadReport& report)
    : report_(report),
      max_listed_(options.max_listed),
      lines_(of_csv(path), "recording", options.name) {
  std::string_view line;
  do {
    if (!lines_.next(line))
      throw DataError(lines_.name() + ": the file is empty, expected a header and rows");
  } while (line.find_first_not_of(" \t") == line.npos);
  header_ = parse_header(line, lines_.name(), options);
  time_column_ = static_cast<std::size_t>(header_.find(Channel::kTime));
  run_column_ = header_.find(Channel::kRun);
  for (const Column& c : header_.columns) limits_.push_back(largest_credible(c.channel));
  for (std::size_t k = 0; k < header_.columns.size(); ++k)
    if (const Column& c = header_.columns[k]; c.channel == Channel::kBaseQuaternion)
      quaternion_[static_cast<std::size_t>(c.index - 3)] = static_cast<long>(k);
  suspect_torques_ = suspect_torques(path, header_, options.joints);
  for (std::size_t k = 0; k < header_.columns.size(); ++k)
    if (const Column& c = header_.columns[k];
        c.channel == Channel::kTau && header_.passive[c.index])
      suspect_torques_[k] = {};  // it is not used
  text_cells_.assign(header_.extra_names.size(), 0);
}

void CredibleRows::quarantine(long line, std::string reason) {
  ++report_.quarantined;
  if (static_cast<long>(report_.quarantined_rows.size()) < max_listed_)
    report_.quarantined_rows.push_back({line, std::move(reason)});
}

std::string CredibleRows::reason_against_row(const std::vector<double>& row) const {
  if (std::isnan(row[time_column_])) return "the time is missing";
  for (std::size_t k = 0; k < row.size(); ++k) {
    const double size = std::abs(row[k]);
    if (!(size > limits_[k])) continue;  // NaN is a gap
    return "'" + header_.columns[k].name + "' is " + number_text(row[k], 6) + ", " +
           (std::isinf(size) ? "infinite" : "absurdly large");
  }
  if (quaternion_[0] >= 0)
    if (std::string reason =
            reason_against_quaternion(row[static_cast<std::size_t>(quaternion_[0])],
                                      row[static_cast<std::size_t>(quaternion_[1])],
                                      row[static_cast<std::size_t>(quaternion_[2])],
                                      row[static_cast<std::size_t>(quaternion_[3])]);
        !reason.empty())
      return reason;
  if (run_column_ >= 0 && std::nearbyint(row[run_column_]) != row[run_column_])
    return "`run` is " + number_text(row[run_column_], 6) + ", expected an integer";
  return {};
}

std::string CredibleRows::reason_against_torque(const std::vector<double>& row) const {
  for (std::size_t k = 0; k < row.size(); ++k)
    if (std::abs(row[k]) > suspect_torques_[k].above)
      return "'" + header_.columns[k].name + "' is " + number_text(row[k], 6) + ", " +
             suspect_torques_[k].than + ", and its neighbours are not";
  return {};
}

void CredibleRows::quarantine_burst() {
  for (SuspectRow& w : burst_) quarantine(w.row.line, std::move(w.reason));
  burst_.clear();
}

bool CredibleRows::next(Row& row) {
  std::string_view line;
  while (released_.empty()) {
    if (!lines_.next(line)) {
      quarantine_burst();
      return false;
    }
    if (line.find_first_not_of(" \t") == line.npos) continue;
    ++report_.rows;
    row.line = lines_.number();
    if (!parse_row(line, lines_, header_, row.values, text_cells_)) {
      quarantine(row.line, "the file ends in the middle of the row");
      breaks_off_ = true;
      continue;
    }
    if (std::string reason = reason_against_row(row.values); !reason.empty()) {
      quarantine(row.line, std::move(reason));
      continue;
    }
    std::string suspicion = reason_against_torque(row.values);
    if (suspicion.empty()) {
      quarantine_burst();
      in_long_burst_ = false;
      return true;
    }
    if (in_long_burst_) return true;
    burst_.push_back({row, std::move(suspicion)});
    if (burst_.size() > kLongestBurst) {
      released_.swap(burst_);
      in_long_burst_ = true;
    }
  }
  row = std::move(released_.front().row);
  released_.pop_front();
  return true;
}

}  // namespace diffnea::detail
