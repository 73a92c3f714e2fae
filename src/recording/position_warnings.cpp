#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <diffnea/recording/position_warnings.hpp>

#include "core/c_numbers.hpp"
#include "recording/audit_statistics.hpp"

namespace diffnea {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
/// Steps of a joint that is sampled well enough to tell a wrap from motion [rad].
constexpr double kLargestStep = 0.5;

struct Wraps {
  long count = 0;
  double first = 0.0;  ///< [s]
};

void count_wraps(const Recording& r, long joint, Wraps& out) {
  std::vector<double> sizes, gaps;
  for (long i = 1; i < r.rows(); ++i) {
    const double step = std::abs(r.q(i, joint) - r.q(i - 1, joint));
    if (std::isfinite(step)) sizes.push_back(step);
    gaps.push_back(r.time[i] - r.time[i - 1]);
  }
  if (sizes.size() < 20) return;
  const double usual = quantile(sizes, 0.95), dt = quantile(gaps, 0.5);
  if (usual > kLargestStep) return;
  const auto turns = [&](long i) {  // by how many the row is beyond the one before
    if (i < 1 || i >= r.rows() || !(r.time[i] - r.time[i - 1] < 2.5 * dt)) return 0.0;
    const double step = r.q(i, joint) - r.q(i - 1, joint);
    return std::isfinite(step) && std::abs(std::abs(step) - kTurn) < 0.05 + 3.0 * usual
               ? std::copysign(1.0, step)
               : 0.0;
  };
  for (long i = 1; i < r.rows(); ++i) {
    if (turns(i) == 0.0) continue;
    if (turns(i) + turns(i + 1) == 0.0) {  // back again
      ++i;
      continue;
    }
    if (out.count++ == 0) out.first = r.time[i];
  }
}

}  // namespace

std::vector<ChannelWarning> find_wrapped(const std::vector<JointDescription>& joints,
                                         const std::vector<Recording>& recordings) {
  std::vector<ChannelWarning> out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].prismatic) continue;
    Wraps found;
    for (const Recording& r : recordings) count_wraps(r, static_cast<long>(j), found);
    if (found.count == 0) continue;
    char text[320];
    detail::print(
        text, sizeof text,
        "q_%s jumps by a whole turn %ld time%s, first at t = %.6g s: the encoder wraps. %s",
        joints[j].name.c_str(), found.count, found.count == 1 ? "" : "s", found.first,
        joints[j].continuous
            ? "Fits unwrap it: the joint has no limits"
            : "Unwrap it (numpy.unwrap) before it is used; every jump passes for motion");
    out.push_back({joints[j].name, text});
  }
  return out;
}

std::vector<ChannelWarning> find_other_lengths(const std::vector<JointDescription>& joints,
                                               const std::vector<Recording>& recordings) {
  std::vector<ChannelWarning> out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const JointDescription& joint = joints[j];
    const double range = joint.upper - joint.lower;
    if (!joint.prismatic || !std::isfinite(range) || !(range > 0.0)) continue;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const Recording& r : recordings)
      for (const double q : r.q.col(static_cast<long>(j)))
        if (std::isfinite(q)) {
          low = std::min(low, q);
          high = std::max(high, q);
        }
    if (!(low <= high)) continue;
    if (!(high > joint.upper + 0.5 * range || low < joint.lower - 0.5 * range)) continue;
    for (const auto& [unit, metres] : {std::pair("cm", 1e-2), std::pair("mm", 1e-3)}) {
      const double slack = 0.05 * range;
      if (high * metres > joint.upper + slack || low * metres < joint.lower - slack) continue;
      char text[320];
      detail::print(text, sizeof text,
                    "q_%s runs from %.4g to %.4g m, outside its limits %.3g to %.3g m, and would "
                    "fit in %s; if so, name the column `q_%s [%s]`",
                    joint.name.c_str(), low, high, joint.lower, joint.upper, unit,
                    joint.name.c_str(), unit);
      out.push_back({joint.name, text});
      break;
    }
  }
  return out;
}

}  // namespace diffnea
