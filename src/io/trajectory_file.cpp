#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/trajectory_file.hpp>

#include "io/model_parts.hpp"
#include "recording/columns.hpp"
#include "recording/line_source.hpp"

namespace diffnea {
namespace {

/// Names are compared one by one; a row takes eight bytes a column however short its cells are.
constexpr std::size_t kMaxColumns = 5000;

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> out;
  for (std::size_t start = 0;;) {
    const std::size_t end = line.find(',', start);
    std::string_view cell = line.substr(start, end == line.npos ? line.npos : end - start);
    while (!cell.empty() && (cell.front() == ' ' || cell.front() == '\t')) cell.remove_prefix(1);
    while (!cell.empty() && (cell.back() == ' ' || cell.back() == '\t' || cell.back() == '\r'))
      cell.remove_suffix(1);
    out.push_back(cell);
    if (end == line.npos) return out;
    start = end + 1;
  }
}

double number(std::string_view cell, const std::string& where, std::string_view column) {
  double x = 0.0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), x);
  if (error != std::errc() || end != cell.data() + cell.size() || !std::isfinite(x))
    throw DataError(where + ": column '" + std::string(column) + "' holds '" +
                    std::string(cell.substr(0, 40)) + "', expected a finite number");
  return x;
}

/// Central differences, one-sided at the ends.
RowMatX<double> differentiate(const VecX<double>& t, const RowMatX<double>& x) {
  RowMatX<double> out = RowMatX<double>::Zero(x.rows(), x.cols());
  const long n = x.rows();
  for (long i = 0; n > 1 && i < n; ++i) {
    const long a = std::max(0L, i - 1), b = std::min(n - 1, i + 1);
    out.row(i) = (x.row(b) - x.row(a)) / (t[b] - t[a]);
  }
  return out;
}

}  // namespace

void check_trajectory_names(const std::vector<std::string>& joint_names) {
  for (const std::string& joint : joint_names)
    detail::require_plain_name("trajectory", joint, true);
}

void write_trajectory(const Trajectory& t, const std::filesystem::path& path) {
  check_trajectory_names(t.joint_names);
  std::string text = "time";
  for (const char* prefix : {"qcmd_", "qdcmd_", "qddcmd_"})
    for (const std::string& joint : t.joint_names) text += std::string(",") + prefix + joint;
  text += "\n";
  for (long row = 0; row < t.rows(); ++row) {
    text += io::exact(t.time[row]);
    for (const RowMatX<double>* m : {&t.q, &t.qd, &t.qdd})
      for (int j = 0; j < t.num_joints(); ++j) text += "," + io::exact((*m)(row, j));
    text += "\n";
  }
  write_file_atomically(path, text);
}

Trajectory read_trajectory(const std::filesystem::path& path) {
  const std::string where = path.string();
  detail::LineSource lines(path, "trajectory");
  std::string_view line;
  lines.next(line);
  const std::string first(line);
  const std::vector<std::string_view> header = split(first);
  if (header.size() > kMaxColumns)
    throw DataError(where + ":1: the header has " + std::to_string(header.size()) +
                    " columns; the limit is " + std::to_string(kMaxColumns));
  Trajectory out;
  out.source = where;
  const auto column = [&](const std::string& name) {
    return static_cast<long>(std::ranges::find(header, name) - header.begin());
  };
  const long none = static_cast<long>(header.size()), time = column("time");
  if (time == none) throw DataError(where + ":1: there is no column 'time'");
  std::vector<long> q, qd, qdd;
  for (long c = 0; c < none; ++c) {
    if (!header[c].starts_with("qcmd_")) continue;
    const std::string joint(header[c].substr(5));
    out.joint_names.push_back(joint);
    q.push_back(c);
    qd.push_back(column("qdcmd_" + joint));
    qdd.push_back(column("qddcmd_" + joint));
  }
  if (q.empty()) throw DataError(where + ":1: there is no column 'qcmd_<joint>'");
  const bool has_qd = std::ranges::find(qd, none) == qd.end();
  const bool has_qdd = std::ranges::find(qdd, none) == qdd.end();

  const long n = static_cast<long>(q.size());
  std::vector<double> values;  // per row: time, q, qd, qdd
  const long width = 1 + 3 * n;
  while (lines.next(line)) {
    const std::vector<std::string_view> cells = split(line);
    if (cells.size() == 1 && cells[0].empty()) continue;
    const std::string here = where + ":" + std::to_string(lines.number());
    if (cells.size() != header.size())
      throw DataError(here + ": has " + std::to_string(cells.size()) + " cells, the header " +
                      std::to_string(header.size()));
    const auto push = [&](long c, bool there) {
      values.push_back(there ? number(cells[c], here, header[c]) : 0.0);
    };
    push(time, true);
    for (const long c : q) push(c, true);
    for (const long c : qd) push(c, has_qd);
    for (const long c : qdd) push(c, has_qdd);
    const std::size_t last = values.size() - static_cast<std::size_t>(width);
    if (last > 0 && !(values[last] > values[last - static_cast<std::size_t>(width)]))
      throw DataError(here + ": time does not increase");
  }
  const long rows = static_cast<long>(values.size()) / width;
  if (rows < 2) throw DataError(where + ": a trajectory needs two rows or more");
  const Eigen::Map<const RowMatX<double>> all(values.data(), rows, width);
  out.time = all.col(0);
  out.q = all.middleCols(1, n);
  out.qd = has_qd ? RowMatX<double>(all.middleCols(1 + n, n)) : differentiate(out.time, out.q);
  out.qdd =
      has_qdd ? RowMatX<double>(all.middleCols(1 + 2 * n, n)) : differentiate(out.time, out.qd);
  return out;
}

}  // namespace diffnea
