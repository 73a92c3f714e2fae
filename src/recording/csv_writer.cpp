#include <charconv>
#include <cmath>

#include <diffnea/core/atomic_file.hpp>
#include <diffnea/core/error.hpp>
#include <diffnea/recording/csv.hpp>

#include "recording/axis_columns.hpp"
#include "recording/columns.hpp"

namespace diffnea {
namespace {

/// Columns of a recording in the order they are written: name and where the values are.
struct OutColumn {
  std::string name;
  const double* first;
  long stride;
};

std::vector<OutColumn> columns_of(const Recording& r) {
  for (const std::string& joint : r.joint_names)
    detail::require_plain_name("write_recording", joint, true);
  for (const ExtraChannel& e : r.extra)
    detail::require_plain_name("write_recording", e.name, false);
  std::vector<OutColumn> out;
  out.push_back({"time", r.time.data(), 1});
  const auto add_joints = [&](const char* prefix, const RowMatX<double>& m, bool torque) {
    if (m.size() == 0) return;
    for (int j = 0; j < r.num_joints(); ++j)
      if (!torque || r.has_tau[j])
        out.push_back({prefix + r.joint_names[j], m.data() + j, m.cols()});
  };
  add_joints("q_", r.q, false);
  add_joints("qd_", r.qd, false);
  add_joints("qdd_", r.qdd, false);
  add_joints("qcmd_", r.qcmd, false);
  add_joints("qdcmd_", r.qdcmd, false);
  add_joints("taucmd_", r.taucmd, false);
  add_joints("tau_", r.tau, true);
  for (const detail::AxisColumns& of : detail::kAxisColumns) {
    const RowMatX<double>& m = r.*of.series;
    for (std::size_t axis = 0; m.size() > 0 && axis < of.axes.size(); ++axis)
      out.push_back({of.column(axis), m.data() + of.first + static_cast<long>(axis), m.cols()});
  }
  for (const ExtraChannel& e : r.extra) out.push_back({e.name, e.values.data(), 1});
  return out;
}

std::string header_of(const std::vector<OutColumn>& columns, bool with_run) {
  std::string out = with_run ? "run" : "";
  for (const OutColumn& c : columns) out += (out.empty() ? "" : ",") + c.name;
  return out + "\n";
}

template <class N>
void append(std::string& text, N x) {
  char digits[40];
  text.append(digits,
              std::to_chars(digits, digits + sizeof digits, x).ptr);  // shortest that reads back
}

}  // namespace

void write_recording(const Recording& recording, const std::filesystem::path& path) {
  write_recordings({recording}, path);
}

void write_recordings(const std::vector<Recording>& recordings, const std::filesystem::path& path) {
  if (recordings.empty())
    throw DataError(path.string() + ": there is no recording to write, expected one or more");
  const bool with_run = recordings.size() > 1;
  const std::string header = header_of(columns_of(recordings.front()), with_run);
  for (const Recording& r : recordings)
    if (const std::string other = header_of(columns_of(r), with_run); other != header)
      throw DataError(path.string() + ": recordings of other columns cannot share a file: '" +
                      header.substr(0, header.size() - 1) + "' and '" +
                      other.substr(0, other.size() - 1) + "'");

  AtomicFile file(path);
  constexpr std::size_t kChunk = 1 << 20;
  std::string text = header;
  for (const Recording& r : recordings) {
    const std::vector<OutColumn> columns = columns_of(r);
    for (long i = 0; i < r.rows(); ++i) {
      if (with_run) append(text, r.run);
      for (std::size_t k = 0; k < columns.size(); ++k) {
        if (k > 0 || with_run) text += ',';
        const double x = columns[k].first[i * columns[k].stride];
        if (!std::isnan(x)) append(text, x);
      }
      text += '\n';
      if (text.size() < kChunk) continue;
      file.write(text);
      text.clear();
    }
  }
  file.write(text);
  file.commit();
}

}  // namespace diffnea
