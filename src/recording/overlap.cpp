#include "recording/overlap.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/text.hpp>

#include "core/constants.hpp"
#include "core/number_text.hpp"

namespace diffnea::detail {
namespace {

constexpr std::size_t kListed = 4;  ///< columns in a message
/// Share of the lost time from which a column has its part in it: two that end and begin where the
/// other does lose half each.
constexpr double kOfLost = 0.25;

struct ValueSpan {
  std::string column;
  double first = kInfinity, last = -kInfinity;  ///< times of its first and its last value [s]
};

/// Columns without which a row does not count.
std::vector<ValueSpan> value_spans(const Recording& r) {
  std::vector<ValueSpan> out;
  const auto add = [&](const std::string& column, const auto& values) {
    out.push_back({column});
    for (long i = 0; i < r.rows(); ++i)
      if (!std::isnan(values[i])) {
        out.back().first = std::min(out.back().first, r.time[i]);
        out.back().last = r.time[i];
      }
  };
  for (std::size_t j = 0; j < r.joint_names.size(); ++j) {
    const bool of_base = static_cast<long>(j) >= r.q.cols() - r.base.cols();  // base_x, …
    add((of_base ? "'" : "'q_") + r.joint_names[j] + "'", r.q.col(static_cast<long>(j)));
    if (r.has_tau[j]) add("'tau_" + r.joint_names[j] + "'", r.tau.col(static_cast<long>(j)));
  }
  return out;
}

std::string at(double seconds) { return number_text(seconds, 6) + " s"; }

}  // namespace

std::string uneven_columns(const std::vector<Recording>& recordings) {
  std::vector<std::string> out;
  for (const Recording& r : recordings) {
    if (r.rows() < 2) continue;
    const std::vector<ValueSpan> spans = value_spans(r);
    double begin = r.time[0], end = r.time[r.rows() - 1];
    for (const ValueSpan& s : spans) {
      begin = std::max(begin, s.first);
      end = std::min(end, s.last);
    }
    const double lost = r.time[r.rows() - 1] - r.time[0] - std::max(end - begin, 0.0);
    for (const ValueSpan& s : spans) {
      if (s.first > s.last || out.size() >= kListed) continue;
      if (s.first - r.time[0] > kOfLost * lost) out.push_back(s.column + " begins at " + at(s.first));
      if (r.time[r.rows() - 1] - s.last > kOfLost * lost)
        out.push_back(s.column + " ends at " + at(s.last));
    }
  }
  return out.empty() ? "" : join_or_none(out);
}

std::string why_no_rows(const std::vector<Recording>& recordings, int least) {
  long rows = 0;
  for (const Recording& r : recordings) rows = std::max(rows, r.rows());
  if (rows < least)
    return (recordings.size() > 1 ? "the longest run has " : "it has ") + std::to_string(rows) +
           (rows == 1 ? " row" : " rows") + ", expected the rows of a motion, ten seconds or more";
  for (const Recording& r : recordings)
    for (const ValueSpan& s : value_spans(r))
      if (s.first > s.last) return "column " + s.column + " has no value";
  const std::string uneven = uneven_columns(recordings);
  return "no " + (least == 2 ? std::string("two") : std::to_string(least)) +
         " rows that follow each other have a value in every column of positions and torques" +
         (uneven.empty() ? "" : ": " + uneven);
}

}  // namespace diffnea::detail
