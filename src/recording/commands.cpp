#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/recording/commands.hpp>

#include "recording/command_lag.hpp"
#include "recording/time_unit.hpp"

namespace diffnea {
namespace {

constexpr double kSignificance = 5.0;  // standard errors, as of an audit's faults

}  // namespace

bool is_logged(const RowMatX<double>& series, long joint) {
  return joint < series.cols() && series.col(joint).array().isFinite().any();
}

bool is_of_drive(const std::string& column, const std::string& name, const std::string& joint) {
  return column == name || column == name + "_" + joint;
}

RowMatX<double> live_commands(const Recording& recording) {
  RowMatX<double> out = recording.qcmd;
  for (long j = 0; j < out.cols(); ++j)
    for (const ExtraChannel& channel : recording.extra)
      if (is_of_drive(channel.name, "torque_enable",
                      recording.joint_names[static_cast<std::size_t>(j)]))
        for (long k = 0; k < out.rows(); ++k)
          if (!(channel.values[k] > 0.0)) out(k, j) = std::nan("");
  return out;
}

std::vector<ChannelWarning> find_early_responses(const std::vector<JointDescription>& joints,
                                                 const std::vector<Recording>& recordings) {
  std::vector<ChannelWarning> out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const bool has_torque = std::ranges::any_of(
        recordings, [&](const Recording& r) { return j < r.has_tau.size() && r.has_tau[j]; });
    if (has_torque || joints[j].passive) continue;  // its command is not used
    const auto lag = detail::find_command_lag(recordings, static_cast<int>(j));
    if (lag && lag->is_early(kSignificance))
      out.push_back({joints[j].name, detail::early_text(*lag, joints[j].name)});
  }
  return out;
}

void require_commands(const std::vector<JointDescription>& joints,
                      const std::vector<Recording>& recordings) {
  if (recordings.empty()) return;
  const std::string& source = recordings.front().source;
  if (const std::string slow = detail::slow_rows(recordings); !slow.empty())
    throw DataError(source + ": " + slow);
  for (const auto find : {find_degrees, find_early_responses})
    if (const std::vector<ChannelWarning> found = find(joints, recordings); !found.empty())
      throw DataError(source + ": " + found.front().text);
}

std::string why_no_torque(const std::vector<Recording>& recordings) {
  std::vector<std::string> q, qd, command, torque, extra;
  bool driven = false;
  for (const Recording& r : recordings) {
    if (r.base_wrench.size() > 0) return "";
    const auto add = [](std::vector<std::string>& list, const std::string& name) {
      if (std::ranges::find(list, name) == list.end()) list.push_back(name);
    };
    for (std::size_t j = 0; j < r.joint_names.size(); ++j) {
      const std::string& name = r.joint_names[j];
      if (r.has_tau[j]) return "";
      driven = driven || std::ranges::find(r.info.passive, name) == r.info.passive.end();
      add(q, name);
      if (is_logged(r.qd, static_cast<long>(j))) add(qd, name);
      if (is_logged(r.qcmd, static_cast<long>(j))) add(command, name);
      if (is_logged(r.taucmd, static_cast<long>(j))) add(torque, name);
    }
    for (const ExtraChannel& e : r.extra) add(extra, e.name);
  }
  if (!driven) return "";
  std::string out =
      "no joint has a torque column (tau_JOINT), so there is no torque to explain; "
      "there are positions (q_) of " +
      detail::join(q);
  if (!qd.empty()) out += "; velocities (qd_) of " + detail::join(qd);
  if (!command.empty())
    out += "; desired positions (qcmd_) of " + detail::join(command) +
           ", to which `diffnea identify` and `diffnea diagnose` fit drives";
  else
    out += "; positions that were commanded (columns qcmd_JOINT) would do as well";
  if (!torque.empty() && command.empty())
    out += "; torques that were commanded (taucmd_) of " + detail::join(torque) +
           " are torques if the drives give them: --map \"taucmd_" + torque.front() + "=tau_" +
           torque.front() + "\"";
  if (!extra.empty()) out += "; extra channels " + detail::join(extra);
  return out;
}

void require_torque(const std::vector<JointDescription>& joints,
                    const std::vector<Recording>& recordings) {
  const std::string why = why_no_torque(recordings);
  if (why.empty()) return;
  require_commands(joints, recordings);
  throw DataError(recordings.front().source + ": " + why);
}

}  // namespace diffnea
