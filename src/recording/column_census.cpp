#include "recording/column_census.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <diffnea/core/error.hpp>

#include "core/number_text.hpp"

namespace diffnea::detail {
namespace {

/// Whether the file has columns for the ball, and one of them never holds a number.
bool never_seen(const ColumnCensus& census, const Columns& header) {
  for (std::size_t k = 0; k < census.gaps.size(); ++k)
    if (header.columns[k].channel == Channel::kBall && census.gaps[k] == census.rows) return true;
  return false;
}

/// Where most of a column's gaps are, if it ends early or begins late.
std::string where_text(const ColumnCensus& census, std::size_t k) {
  const long before = census.before[k], after = census.after[k];
  if (census.gaps[k] == census.rows || 2 * (before + after) < census.gaps[k]) return "";
  std::string out;
  if (before > 1) out += "begins at " + number_text(census.first[k], 6) + " s";
  if (after > 1)
    out += (out.empty() ? "" : ", ") + ("ends at " + number_text(census.last[k], 6) + " s");
  return out.empty() ? "" : " (it " + out + ")";
}

/// Columns of joints that lack values in some rows, each with their number.
std::string gaps_text(const ColumnCensus& census, const Columns& header) {
  std::string out;
  for (std::size_t k = 0; k < census.gaps.size(); ++k) {
    const Channel channel = header.columns[k].channel;
    if (census.gaps[k] > 0 && (channel == Channel::kQ || channel == Channel::kTau))
      out += (out.empty() ? "'" : ", '") + header.columns[k].name + "' in " +
             std::to_string(census.gaps[k]) + where_text(census, k);
  }
  return out;
}

}  // namespace

void ColumnCensus::count(const std::vector<double>& row, const Columns& header) {
  ++rows;
  const double time = row[time_column];
  for (std::size_t k = 0; k < row.size(); ++k) {
    if (std::isnan(row[k])) {
      ++gaps[k];
      ++after[k];
    } else {
      if (gaps[k] + 1 == rows) {  // the first
        before[k] = gaps[k];
        first[k] = time;
      }
      after[k] = 0;
      last[k] = time;
    }
    if (header.columns[k].channel == Channel::kTau) {
      double& largest = largest_tau[header.columns[k].index];
      largest = std::max(largest, std::isnan(row[k]) ? -1.0 : std::abs(row[k]));
    }
  }
}

/// Tells whether a joint follows another: it may well have no drive.
bool follows(const std::vector<JointDescription>& joints, const std::string& name) {
  return std::ranges::any_of(joints, [&](const JointDescription& j) {
    return std::ranges::find(j.followers, name, &FollowerDescription::name) != j.followers.end();
  });
}

void check_measured(const ColumnCensus& census, const Columns& header, const ReadOptions& options,
                    ReadReport& report) {
  for (std::size_t k = 0; k < census.gaps.size(); ++k)
    if (options.refuse_silent_torque && header.columns[k].channel == Channel::kQ &&
        census.gaps[k] == census.rows)
      throw DataError(report.source + ": column '" + header.columns[k].name +
                      "' has no value; a joint's position is always needed");
  for (std::size_t j = 0; j < header.joint_names.size(); ++j) {
    const std::string column = "'tau_" + header.joint_names[j] + "'";
    if (!header.has_tau[j]) continue;
    if (header.passive[j]) {
      if (census.largest_tau[j] > 0.0)
        report.notes.push_back("the joint is declared passive, so its " + column + " (up to " +
                               number_text(census.largest_tau[j], 6) + ") is not used");
    } else if (!options.refuse_silent_torque || follows(options.joints, header.joint_names[j])) {
      continue;
    } else if (census.largest_tau[j] < 0.0) {
      throw DataError(
          report.source + ": column " + column +
          " has no value; without the column the joint's motion is taken as prescribed");
    } else if (census.largest_tau[j] == 0.0) {
      throw DataError(
          report.source + ": column " + column +
          " is 0 in every row; declare the joint passive if its torque is known to be zero, or "
          "leave the column out if it was not measured");
    }
  }
  if (never_seen(census, header)) {
    if (header.joint_names.empty() && options.refuse_silent_torque)
      throw DataError(report.source +
                      ": the ball is seen in no row (ball_x, ball_y, ball_z), and there is no "
                      "joint (q_<joint>): nothing was measured");
    report.notes.emplace_back("the ball is seen in no row");
  }
}

void note_gaps(const ColumnCensus& census, const Columns& header,
               const std::vector<long>& text_cells, ReadReport& report) {
  if (const std::string missing = gaps_text(census, header); !missing.empty())
    report.notes.push_back("values are missing: " + missing + " of " + std::to_string(report.rows) +
                           " rows; a short gap is bridged by interpolation, a long one splits "
                           "the recording; rows count where all these columns have a value");
  for (std::size_t i = 0; i < text_cells.size(); ++i)
    if (text_cells[i] > 0)
      report.notes.push_back("extra channel '" + header.extra_names[i] + "' holds " +
                             std::to_string(text_cells[i]) + " cells that are no numbers: NaN");
}

}  // namespace diffnea::detail
