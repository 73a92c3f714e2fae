/// The pose of a base that floats, and its measured twist against the pose's derivative: in its own
/// axes or in those of the world, of which sign and size.

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "core/statistics.hpp"
#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"
#include "recording/axis_columns.hpp"
#include "recording/floating_base.hpp"

namespace diffnea::detail {
namespace {

/// Median |norm − 1| that is worth a note: quaternions of three digits have less.
constexpr double kWorthANote = 1e-3;
/// Blocks of the standard errors, so that their scores are independent [s].
constexpr double kBlockSeconds = 0.5;
/// Share of a stretch that is left out at either end, where filters forget.
constexpr long kTrim = 8;
/// Least share of the twist that one of both frames must explain for it to be a twist at all, and
/// how many times more the other must leave unexplained for the frame to be known.
constexpr double kExplains = 0.8, kTells = 4.0;
/// Least error of the scale, as of joints' velocities: ripple of the filter, stamps that jitter.
constexpr double kSmallScale = 0.005, kFaultyScale = 0.02;

/// One half of a twist, ω or v, of all stretches: measured, and derived from the pose in the base's
/// axes and in the world's, axis after axis.
struct Half {
  std::vector<double> measured, in_base, in_world;
  std::vector<int> block;
};

void look_at_quaternions(const AuditContext& c) {
  for (const Recording& r : c.recordings) {
    if (r.base.size() == 0) continue;
    std::vector<double> off;
    for (long k = 0; k < r.rows(); ++k)
      if (const double norm = r.base.row(k).tail<4>().norm(); std::isfinite(norm))
        off.push_back(std::abs(norm - 1.0));
    RowMatX<double> base = r.base;
    const long flips = SignKeeper().keep(base);
    if (const double usual = off.empty() ? 0.0 : median(off); usual > kWorthANote) {
      ChannelFault f = make_fault("quaternion_norm", "base", "base_q", usual, "1");
      f.severity = FaultSeverity::kNote;
      f.source = r.source;
      f.evidence =
          format("its norm is off 1 by %.3g in the median row; it is divided by it", usual);
      c.add(std::move(f));
    }
    if (flips > 0) {
      ChannelFault f =
          make_fault("quaternion_sign", "base", "base_q", static_cast<double>(flips), "rows");
      f.severity = FaultSeverity::kNote;
      f.source = r.source;
      f.evidence = format(
          "changes its sign %ld times: q and -q are one rotation, and it is turned "
          "round there",
          flips);
      c.add(std::move(f));
    }
  }
}

/// The measured twist through the filter of the pose.
Preprocessed filtered_twist(const Recording& r, const PreprocessPlan& plan) {
  Recording twist;
  twist.source = r.source;
  twist.time = r.time;
  twist.q = r.base_twist;
  twist.tau.setZero(r.rows(), r.base_twist.cols());
  for (long k = 0; k < r.base_twist.cols(); ++k) twist.joint_names.push_back(std::to_string(k));
  twist.has_tau.assign(twist.joint_names.size(), false);
  PreprocessPlan as_it_is = plan;
  as_it_is.refresh.clear();
  return preprocess(twist, as_it_is);
}

void add_stretches(const Preprocessed& pose, const Preprocessed& twist, double dt,
                   Half (&halves)[2], int& block) {
  for (long begin = 0, end = 0; begin < pose.rows(); begin = end) {
    while (end < pose.rows() && pose.segment[static_cast<std::size_t>(end)] ==
                                    pose.segment[static_cast<std::size_t>(begin)])
      ++end;
    const long from = begin + (end - begin) / kTrim, to = end - (end - begin) / kTrim;
    const auto number = [&](long k) {
      return static_cast<int>(static_cast<double>(k - from) * dt / kBlockSeconds);
    };
    for (int axis = 0; axis < 3; ++axis, block += number(to) + 1)
      for (long k = from; k < to; ++k) {
        const Eigen::Vector4d xyzw = pose.base.row(k).tail<4>().transpose();
        const Eigen::Matrix3d R = Eigen::Quaterniond(xyzw).toRotationMatrix();
        for (int h = 0; h < 2; ++h) {
          const Eigen::Vector3d own = pose.base_twist.row(k).segment<3>(3 * h).transpose();
          halves[h].measured.push_back(twist.q(k, 3 * h + axis));
          halves[h].in_base.push_back(own[axis]);
          halves[h].in_world.push_back((R * own)[axis]);
          halves[h].block.push_back(block + number(k));
        }
      }
  }
}

BlockFit fit_scale(const Half& half, const std::vector<double>& reference) {
  const long rows = static_cast<long>(reference.size());
  const MatX<double> x = Eigen::Map<const VecX<double>>(reference.data(), rows);
  const VecX<double> y = Eigen::Map<const VecX<double>>(half.measured.data(), rows);
  return fit_in_blocks(x, y, half.block);
}

void compare(const AuditContext& c, const Half& half, const AxisColumns& columns) {
  const BlockFit own = fit_scale(half, half.in_base), world = fit_scale(half, half.in_world);
  const std::string channel = columns.columns();
  const auto fault = [&](const char* name, double value) {
    return make_fault(name, "base", channel, value, "1");
  };
  if (world.explained > kExplains && 1.0 - own.explained > kTells * (1.0 - world.explained)) {
    ChannelFault f = fault("twist_frame", world.explained);
    f.evidence = format(
        "the pose's derivative in the world's axes explains %.3g %% of it, in the base's %.3g %%: "
        "expected the base's axes; turn each row by the pose, R transposed",
        100.0 * world.explained, 100.0 * std::max(own.explained, 0.0));
    c.add(std::move(f));
    return;
  }
  if (own.explained < kExplains) {
    ChannelFault f = fault("velocity_unrelated", own.explained);
    f.evidence = format(
        "the pose's derivative explains %.3g %% of it in the base's axes, %.3g %% in the world's",
        100.0 * std::max(own.explained, 0.0), 100.0 * std::max(world.explained, 0.0));
    c.add(std::move(f));
    return;
  }
  const double scale = own.coefficients[0], std = own.std[0];
  if (scale < 0.0) {
    ChannelFault f = fault("velocity_sign", scale);
    f.std = std;
    f.significance = -scale / std;
    f.evidence =
        format("is %.4g ± %.2g times the pose's derivative: the sign is flipped", scale, std);
    c.add(std::move(f));
  } else if (std::abs(scale - 1.0) > std::max(kSmallScale, c.limits.significance * std)) {
    ChannelFault f = fault("velocity_scale", scale);
    f.std = std;
    f.significance = std::abs(scale - 1.0) / std;
    f.severity =
        std::abs(scale - 1.0) > kFaultyScale ? FaultSeverity::kFault : FaultSeverity::kNote;
    f.evidence = format("is %.5g ± %.2g times the pose's derivative", scale, std);
    c.add(std::move(f));
  }
}

}  // namespace

void audit_base(AuditContext& c) {
  const bool floats =
      std::ranges::any_of(c.recordings, [](const Recording& r) { return r.base.size() > 0; });
  if (!floats) return;
  look_at_quaternions(c);
  c.check("base pose", true, "norm and sign of the quaternion");
  const std::string name = "measured twist";
  if (std::ranges::none_of(c.recordings,
                           [](const Recording& r) { return r.base_twist.size() > 0; })) {
    c.check(name, false, "there are no columns base_wx … base_vz");
    return;
  }
  if (!c.plan) {
    c.check(name, false, c.unfiltered_reason);
    return;
  }
  Half halves[2];
  int block = 0;
  for (const Recording& r : c.recordings) {
    if (r.base.size() == 0 || r.base_twist.size() == 0) continue;
    const Preprocessed pose = preprocess(r, *c.plan), twist = filtered_twist(r, *c.plan);
    if (pose.time.size() == twist.time.size() && pose.time == twist.time)
      add_stretches(pose, twist, c.plan->dt, halves, block);
  }
  if (halves[0].measured.empty()) {
    c.check(name, false, "no stretch of a recording has pose and twist in the same rows");
    return;
  }
  for (const AxisColumns& of : kAxisColumns)
    if (of.series == &Recording::base_twist) compare(c, halves[of.first / 3], of);
  c.check(name, true,
          format("compared with the pose's derivative, both low-passed at %.3g Hz without phase; a "
                 "lag is not looked for",
                 c.plan->filter_hz));
}

}  // namespace diffnea::detail
