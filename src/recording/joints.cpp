#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/joints.hpp>

#include "recording/columns.hpp"

namespace diffnea {

void match_joints(const std::vector<JointDescription>& joints, std::vector<Recording>& recordings) {
  std::vector<std::string> wanted;
  for (const JointDescription& j : joints) wanted.push_back(j.name);
  for (Recording& r : recordings) {
    std::vector<int> from;  // column of the recording per joint of the model
    for (const std::string& name : wanted)
      if (const auto it = std::ranges::find(r.joint_names, name); it != r.joint_names.end())
        from.push_back(static_cast<int>(it - r.joint_names.begin()));
    if (from.size() != wanted.size() || from.size() != r.joint_names.size())
      throw DataError(r.source + ": the joints are not the model's; recording: " +
                      detail::join(r.joint_names) + "; model: " + detail::join(wanted));
    for (auto member :
         {&Recording::q, &Recording::qd, &Recording::qdd, &Recording::qcmd, &Recording::tau}) {
      RowMatX<double>& m = r.*member;
      if (m.size() > 0) m = RowMatX<double>(m(Eigen::all, from));
    }
    std::vector<bool> has_tau(joints.size());
    for (std::size_t j = 0; j < joints.size(); ++j) {
      has_tau[j] = r.has_tau[from[j]] && !joints[j].passive;
      if (!joints[j].passive) continue;
      r.tau.col(static_cast<long>(j)).setZero();
      if (std::ranges::find(r.info.passive, joints[j].name) == r.info.passive.end())
        r.info.passive.push_back(joints[j].name);
    }
    r.has_tau = has_tau;
    r.joint_names = wanted;
  }
}

std::vector<ChannelWarning> find_degrees(const std::vector<JointDescription>& joints,
                                         const std::vector<Recording>& recordings) {
  constexpr double kPi = std::numbers::pi;
  std::vector<ChannelWarning> out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const JointDescription& joint = joints[j];
    if (joint.prismatic) continue;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const Recording& r : recordings)
      for (long i = 0; i < r.rows(); ++i) {
        const double q = r.q(i, static_cast<long>(j));
        if (std::isnan(q)) continue;
        low = std::min(low, q);
        high = std::max(high, q);
      }
    if (!(low <= high)) continue;
    const bool limited = std::isfinite(joint.lower) && std::isfinite(joint.upper);
    const double lower = limited ? joint.lower : -2.0 * kPi,
                 upper = limited ? joint.upper : 2.0 * kPi;
    // Out of the range by half of its width is no calibration error; a twentieth of a radian in
    // degrees would be no motion at all.
    const double slack = 0.5 * (upper - lower), to_rad = kPi / 180.0;
    const bool leaves = high > upper + slack || low < lower - slack;
    const bool fits = high * to_rad <= upper + 0.05 && low * to_rad >= lower - 0.05;
    if (!leaves || !fits) continue;
    char text[240];
    std::snprintf(text, sizeof text,
                  "q_%s runs from %.4g to %.4g rad, outside %s %.3g to %.3g rad, and would fit as "
                  "degrees; if so, name the column `q_%s [deg]`",
                  joint.name.c_str(), low, high, limited ? "its limits" : "the usual", lower, upper,
                  joint.name.c_str());
    out.push_back({joint.name, text});
  }
  return out;
}

}  // namespace diffnea
