#include "recording/torque_spikes.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>

#include "core/constants.hpp"
#include "core/number_text.hpp"

namespace diffnea::detail {
namespace {

/// |τ| of one line's torque cells, appended to those of their columns; cells that are no plain
/// number are passed over, the reader judges them.
void collect(std::string_view line, const Columns& header,
             std::vector<std::vector<double>>& sizes) {
  for (std::size_t k = 0; k < header.columns.size(); ++k) {
    const std::size_t comma = line.find(',');
    const Column& column = header.columns[k];
    if (column.channel == Channel::kTau) {
      std::string_view cell = line.substr(0, comma);
      cell.remove_prefix(std::min(cell.find_first_not_of(' '), cell.size()));
      double x = 0.0;
      if (std::from_chars(cell.data(), cell.data() + cell.size(), x).ec == std::errc() &&
          std::isfinite(x))
        sizes[k].push_back(std::abs(column.conversion(x)));
    }
    if (comma == std::string_view::npos) return;
    line.remove_prefix(comma + 1);
  }
}

}  // namespace

SuspectTorque suspect_torque(std::vector<double>& sizes, double effort) {
  constexpr double kOfUsual = 1000.0, kOfEffort = 100.0, kOfUsualToo = 10.0;
  constexpr std::size_t kFewest = 100;  // values that 98 % have a meaning for
  std::erase_if(sizes, [](double x) { return !(x > 0.0); });
  double usual = 0.0;
  if (sizes.size() >= kFewest) {
    const auto at = sizes.begin() + static_cast<long>(sizes.size() * 98 / 100);
    std::nth_element(sizes.begin(), at, sizes.end());
    usual = *at;
  }
  SuspectTorque out;
  if (usual > 0.0)
    out = {kOfUsual * usual,
           "more than 1000 times what 98 % of the rows stay below (" + number_text(usual) + ")"};
  // Ten times the usual as well: a limit that all rows exceed is wrong, or in another unit.
  if (effort > 0.0 && std::isfinite(effort))
    if (const double above = std::max(kOfEffort * effort, kOfUsualToo * usual); above < out.above)
      out = {above, "more than 100 times the joint's effort limit (" + number_text(effort) + ")"};
  return out;
}

std::vector<SuspectTorque> suspect_torques(const std::filesystem::path& path, const Columns& header,
                                           const std::vector<JointDescription>& joints) {
  constexpr std::uintmax_t kStretches = 16, kBytes = 1 << 16;  // of a stretch
  std::vector<SuspectTorque> out(header.columns.size());
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return out;  // a pipe is read once
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file) return out;
  std::vector<std::vector<double>> sizes(header.columns.size());
  const bool whole = size <= kStretches * kBytes;
  std::string buffer;
  for (std::uintmax_t s = 0; s < (whole ? 1 : kStretches); ++s) {
    buffer.resize(whole ? size : kBytes);
    file.clear();
    file.seekg(static_cast<std::streamoff>(whole ? 0 : s * (size - kBytes) / (kStretches - 1)));
    file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    std::string_view rest(buffer.data(), static_cast<std::size_t>(file.gcount()));
    // The first line is the header, or began before the stretch; the last may go on behind it.
    for (std::size_t end = rest.find('\n'); end != rest.npos; end = rest.find('\n')) {
      rest.remove_prefix(end + 1);
      collect(rest.substr(0, rest.find('\n')), header, sizes);
    }
  }
  for (std::size_t k = 0; k < header.columns.size(); ++k) {
    if (header.columns[k].channel != Channel::kTau) continue;
    const auto joint = std::ranges::find(joints, header.joint_names[header.columns[k].index],
                                         &JointDescription::name);
    out[k] = suspect_torque(sizes[k], joint == joints.end() ? kInfinity : joint->effort);
  }
  return out;
}

}  // namespace diffnea::detail
