#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/recording/joints.hpp>

#include "core/c_numbers.hpp"
#include "core/constants.hpp"
#include "recording/columns.hpp"
#include "recording/torque_spikes.hpp"
#include "recording/twos_complement.hpp"

namespace diffnea {

void match_joints(const std::vector<JointDescription>& joints, std::vector<Recording>& recordings,
                  std::vector<ChannelWarning>* deviations) {
  for (Recording& r : recordings) merge_followers(joints, r, deviations);
  std::vector<std::string> wanted;
  for (const JointDescription& j : joints) wanted.push_back(j.name);
  for (Recording& r : recordings) {
    std::vector<int> from;  // column of the recording per joint of the model
    for (const std::string& name : wanted)
      if (const auto it = std::ranges::find(r.joint_names, name); it != r.joint_names.end())
        from.push_back(static_cast<int>(it - r.joint_names.begin()));
    if (wanted.empty() && !r.joint_names.empty())
      throw DataError(r.source + ": the model has no joint, the recording has " +
                      detail::join_or_none(r.joint_names) +
                      "; leave the columns of joints out, or give the model of the robot");
    if (from.size() != wanted.size())
      throw DataError(r.source + ": the joints are not the model's; recording: " +
                      detail::join_or_none(r.joint_names) +
                      "; model: " + detail::join_or_none(wanted) +
                      "; --lock JOINT=VALUE (lock=) holds a joint of the model that is not logged");
    for (const auto member : kJointSeries) {
      RowMatX<double>& m = r.*member;
      if (m.size() > 0) m = RowMatX<double>(m(Eigen::all, from));
    }
    std::vector<bool> has_tau(joints.size());
    for (std::size_t j = 0; j < joints.size(); ++j) {
      has_tau[j] = r.has_tau[from[j]] && !joints[j].passive;
      if (!joints[j].passive) continue;
      auto tau = r.tau.col(static_cast<long>(j));
      const bool said = std::ranges::find(r.info.passive, joints[j].name) != r.info.passive.end();
      // What is known already stays: a ball's pull, say, that was taken out of it.
      if (r.has_tau[from[j]] || !said || !tau.allFinite()) tau.setZero();
      if (!said) r.info.passive.push_back(joints[j].name);
    }
    r.has_tau = has_tau;
    r.joint_names = wanted;
  }
}

namespace {

/// One sentence on positions of a joint that leave its range and would fit as degrees; empty: none.
/// @param column   as the log names it
/// @param channel  Recording::q or Recording::qcmd
std::string degrees_text(const JointDescription& joint, const std::string& column, long j,
                         const std::vector<Recording>& recordings,
                         RowMatX<double> Recording::* channel) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Recording& r : recordings) {
    if (j >= (r.*channel).cols()) continue;
    for (const double q : (r.*channel).col(j)) {
      if (std::isnan(q)) continue;
      low = std::min(low, q);
      high = std::max(high, q);
    }
  }
  if (!(low <= high)) return "";
  const bool limited = std::isfinite(joint.lower) && std::isfinite(joint.upper);
  const double lower = limited ? joint.lower : -2.0 * kPi,
               upper = limited ? joint.upper : 2.0 * kPi;
  // Out of the range by half of its width is no calibration error; a twentieth of a radian in
  // degrees would be no motion at all.
  const double slack = 0.5 * (upper - lower), to_rad = kPi / 180.0;
  const bool leaves = high > upper + slack || low < lower - slack;
  const bool fits = high * to_rad <= upper + 0.05 && low * to_rad >= lower - 0.05;
  if (!leaves || !fits) return "";
  char text[280];
  detail::print(text, sizeof text,
                "%s runs from %.4g to %.4g rad, outside %s %.3g to %.3g rad, and would fit as "
                "degrees; if so, name the column `%s [deg]`",
                column.c_str(), low, high, limited ? "its limits" : "the usual", lower, upper,
                column.c_str());
  return text;
}

}  // namespace

std::vector<ChannelWarning> find_degrees(const std::vector<JointDescription>& joints,
                                         const std::vector<Recording>& recordings) {
  std::vector<ChannelWarning> out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].prismatic) continue;
    for (const auto& [prefix, channel] :
         {std::pair("q_", &Recording::q), std::pair("qcmd_", &Recording::qcmd)}) {
      const std::string text = degrees_text(joints[j], prefix + joints[j].name,
                                            static_cast<long>(j), recordings, channel);
      if (text.empty()) continue;
      out.push_back({joints[j].name, text});
      break;
    }
  }
  return out;
}

std::vector<std::string> blank_absurd_torque(const std::vector<JointDescription>& joints,
                                             std::vector<Recording>& recordings) {
  std::vector<std::string> out;
  for (Recording& r : recordings)
    for (std::size_t j = 0; j < joints.size(); ++j) {
      if (!r.has_tau[j]) continue;
      auto tau = r.tau.col(static_cast<long>(j));
      std::vector<double> sizes(static_cast<std::size_t>(tau.size()));
      for (long i = 0; i < tau.size(); ++i) sizes[static_cast<std::size_t>(i)] = std::abs(tau[i]);
      const detail::SuspectTorque suspect = detail::suspect_torque(sizes, joints[j].effort);
      long blanked = 0, first = 0;
      double value = 0.0;
      for (long i = 0; i < tau.size(); ++i) {
        long end = i;
        while (end < tau.size() && std::abs(tau[end]) > suspect.above) ++end;
        if (end == i) continue;
        if (end - i <= static_cast<long>(detail::kLongestBurst)) {
          if (blanked == 0) {
            first = i;
            value = tau[i];
          }
          blanked += end - i;
          tau.segment(i, end - i).setConstant(std::numeric_limits<double>::quiet_NaN());
        }
        i = end;
      }
      if (blanked == 0) continue;
      char text[240];
      detail::print(text, sizeof text, "tau_%s is %.6g at %.6g s, %s: %ld such %s taken as gaps",
                    joints[j].name.c_str(), value, r.time[first], suspect.than.c_str(), blanked,
                    blanked == 1 ? "value is" : "values are");
      out.push_back((r.source.empty() ? "" : r.source + ": ") + text);
    }
  return out;
}

std::vector<ChannelWarning> find_twos_complement_torque(const std::vector<JointDescription>& joints,
                                                        const std::vector<Recording>& recordings) {
  std::vector<ChannelWarning> out;
  for (std::size_t j = 0; j < joints.size(); ++j)
    for (const Recording& r : recordings) {
      if (j >= r.has_tau.size() || !r.has_tau[j]) continue;
      const auto found = detail::find_twos_complement(r.tau.col(static_cast<long>(j)));
      if (!found) continue;
      const std::string channel = "tau_" + joints[j].name;
      out.push_back(
          {joints[j].name, channel + ": " + detail::twos_complement_text(*found, channel, true)});
      break;
    }
  return out;
}

std::vector<ChannelWarning> find_excess_torque(const std::vector<JointDescription>& joints,
                                               const std::vector<Recording>& recordings) {
  constexpr double kBeyond = 2.0;  // limits of continuous torque are passed for moments
  std::vector<ChannelWarning> out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const JointDescription& joint = joints[j];
    if (!(joint.effort > 0.0) || !std::isfinite(joint.effort)) continue;
    double largest = 0.0;
    for (const Recording& r : recordings)
      for (long i = 0; r.has_tau[j] && i < r.rows(); ++i)
        largest = std::max(largest, std::abs(r.tau(i, static_cast<long>(j))));  // passes NaN over
    if (!(largest > kBeyond * joint.effort)) continue;
    const char* unit = joint.prismatic ? "N" : "N*m";
    char text[240];
    detail::print(text, sizeof text,
                  "tau_%s reaches %.4g %s, %.3g times the model's effort limit of %.4g: is it in "
                  "%s, and of the joint (not a current, not on the motor's side of a gear)?",
                  joint.name.c_str(), largest, unit, largest / joint.effort, joint.effort, unit);
    out.push_back({joint.name, text});
  }
  return out;
}

}  // namespace diffnea
