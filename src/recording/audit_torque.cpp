/// Torque channels without dynamics. Two terms have a known sign: friction, which every geared
/// joint has and which jumps with the sign of its own velocity, and a joint's own inertia. Friction
/// tells whose torque a channel is, and which way round; inertia the latter, where there is too
/// little friction. All else that is smooth goes into a black box beside them.

#include <algorithm>
#include <cmath>


#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"
#include "recording/path_smoother.hpp"

namespace diffnea::detail {
namespace {

/// Width of the sign's edge, over the joint's rms velocity.
constexpr double kEdge = 0.05;
/// Of the rms torque: smaller jumps are left to chance.
constexpr double kSmallJump = 0.03;
/// Of the rms torque: what a joint's own acceleration must account for, to be told by.
constexpr double kSmallInertia = 0.1;

/// Rows about 50 Hz apart, of all stretches.
struct Rows {
  std::vector<std::pair<std::size_t, long>> at;  ///< stretch, row
  std::vector<int> block;
};

Rows choose_rows(const AuditContext& c) {
  Rows out;
  const long step = std::max(1L, std::lround(0.02 / c.plan->dt));
  int block = 0;
  for (std::size_t k = 0; k < c.stretches.size(); ++k) {
    const long rows = c.stretches[k].time.size();
    for (long i = 0; i < rows; i += step) {
      out.at.emplace_back(k, i);
      out.block.push_back(block + static_cast<int>(static_cast<double>(i) * c.plan->dt / 0.5));
    }
    if (!out.block.empty()) block = out.block.back() + 1;
  }
  return out;
}

/// Joints that move by more than their noise.
std::vector<int> moving_joints(const AuditContext& c) {
  std::vector<int> out;
  if (c.stretches.empty()) return out;
  for (int j = 0; j < c.num_joints(); ++j) {
    double low = std::numeric_limits<double>::infinity(), high = -low, square = 0.0, rows = 0.0;
    for (const FilteredStretch& s : c.stretches) {
      low = std::min(low, s.q.col(j).minCoeff());
      high = std::max(high, s.q.col(j).maxCoeff());
      square += s.qd.col(j).squaredNorm();
      rows += static_cast<double>(s.qd.rows());
    }
    if (high - low > 0.02 && std::sqrt(square / rows) > 20.0 * c.velocity_noise[j])
      out.push_back(j);
  }
  return out;
}

/// Columns that a torque is made of: the sign of q̇, q̇ and q̈ of each moving joint first, then sines
/// and cosines of the positions for gravity, an offset per recording; products of two joints where
/// there are rows enough for them.
struct BlackBox {
  Rows rows;
  std::vector<int> moving;
  MatX<double> x;  ///< empty: too few rows

  BlackBox(const AuditContext& c, std::vector<int> joints)
      : rows(choose_rows(c)), moving(std::move(joints)) {
    const long num_rows = static_cast<long>(rows.at.size()), m = static_cast<long>(moving.size());
    const long trigonometric = 2 * m, positions = trigonometric * (trigonometric - 1) / 2;
    const long plain = 3 * m + trigonometric + static_cast<long>(c.recordings.size());
    const long all = plain + positions;
    const bool with_products = all < num_rows / 10;
    const long columns = with_products ? all : plain;
    if (columns * 5 > num_rows) return;
    const std::vector<RowMatX<double>> signs = velocity_signs(c);
    x.setZero(num_rows, columns);
    VecX<double> trig(trigonometric);
    for (long i = 0; i < num_rows; ++i) {
      const auto& [k, row] = rows.at[i];
      const FilteredStretch& s = c.stretches[k];
      for (long j = 0; j < m; ++j) {
        const int joint = moving[j];
        x(i, j) = signs[k](row, j);
        x(i, m + j) = s.qd(row, joint);
        x(i, 2 * m + j) = s.qdd(row, joint);
        trig[2 * j] = std::sin(s.q(row, joint));
        trig[2 * j + 1] = std::cos(s.q(row, joint));
      }
      x.row(i).segment(3 * m, trigonometric) = trig.transpose();
      x(i, 3 * m + trigonometric + static_cast<long>(s.recording)) = 1.0;
      if (!with_products) continue;
      long at = plain;
      for (long a = 0; a < trigonometric; ++a)
        for (long b = a + 1; b < trigonometric; ++b) x(i, at++) = trig[a] * trig[b];
    }
  }

  long column(int joint) const { return std::ranges::find(moving, joint) - moving.begin(); }

 private:
  /// What the low-pass does to torques, it must do to the jumps; all else is smooth.
  std::vector<RowMatX<double>> velocity_signs(const AuditContext& c) const {
    const detail::PathSmoother filter(c.plan->filter_hz, 1.0 / c.plan->dt);
    std::vector<double> edge(moving.size(), 0.0);
    for (std::size_t i = 0; i < moving.size(); ++i) {
      for (const auto& [k, row] : rows.at)
        edge[i] += std::pow(c.stretches[k].qd(row, moving[i]), 2);
      edge[i] = kEdge * std::sqrt(edge[i] / static_cast<double>(rows.at.size()));
    }
    std::vector<RowMatX<double>> out;
    for (const FilteredStretch& s : c.stretches) {
      RowMatX<double> sign(s.qd.rows(), static_cast<long>(moving.size()));
      for (std::size_t j = 0; j < moving.size(); ++j)
        sign.col(static_cast<long>(j)) = (s.qd.col(moving[j]).array() / edge[j]).tanh();
      RowMatX<double> smooth, rate, acceleration;
      filter.smooth(sign, smooth, rate, acceleration);
      out.push_back(std::move(smooth));
    }
    return out;
  }
};

/// What a joint's motion has to do with a channel.
struct Coefficient {
  double size = 0.0, z = 0.0;
  double share = 0.0;  ///< of the channel's rms

  double std() const { return std::abs(size / z); }
};

/// A channel's dependence on every joint: where it reverses, and on its q̇ and q̈.
struct LoggedTorque {
  std::vector<Coefficient> jump, viscous, inertia;  ///< by joint, as in `measured`
};

VecX<double> torque_of(const AuditContext& c, const BlackBox& box, int joint) {
  VecX<double> tau(box.x.rows());
  for (long i = 0; i < tau.size(); ++i)
    tau[i] = c.stretches[box.rows.at[i].first].tau(box.rows.at[i].second, joint);
  return tau;
}

/// How surely a channel has a column of the black box, by the runs in which a joint turns one way:
/// what the black box lacks is as slow as gravity, and has a size of its own in each of them.
double sureness_by_runs(const AuditContext& c, const BlackBox& box, int channel, int joint,
                        long column) {
  const long sign = box.column(joint);
  std::vector<int> run{0};
  for (long i = 1; i < box.x.rows(); ++i)
    run.push_back(run.back() + (box.rows.at[i].first != box.rows.at[i - 1].first ||
                                box.x(i, sign) * box.x(i - 1, sign) < 0.0));
  return jackknife_z(box.x, torque_of(c, box, channel), run, column);
}

LoggedTorque fit_channel(const AuditContext& c, const BlackBox& box,
                         const std::vector<int>& measured, int joint) {
  const std::size_t num = measured.size();
  const long m = static_cast<long>(box.moving.size());
  LoggedTorque out{std::vector<Coefficient>(num), std::vector<Coefficient>(num),
                   std::vector<Coefficient>(num)};
  const VecX<double> tau = torque_of(c, box, joint);
  const double rms = std::sqrt((tau.array() - tau.mean()).square().mean());
  if (!(rms > 0.0)) return out;
  const BlockFit fit = fit_in_blocks(box.x, tau, box.rows.block);
  const auto at = [&](long column) {
    const double size = fit.coefficients[column], std = fit.std[column];
    return Coefficient{
        size, std > 0.0 ? size / std : 0.0,
        std::abs(size) * std::sqrt(box.x.col(column).squaredNorm() / double(tau.size())) / rms};
  };
  for (std::size_t j = 0; j < num; ++j) {
    const long column = box.column(measured[j]);
    out.jump[j] = at(column);
    out.jump[j].share = std::abs(out.jump[j].size) / rms;
    out.viscous[j] = at(m + column);
    out.inertia[j] = at(2 * m + column);
  }
  return out;
}

}  // namespace

void audit_torque(AuditContext& c) {
  const char* const kName = "sign and joint of torques";
  std::vector<int> measured, moving = moving_joints(c);
  for (const int j : moving)
    if (c.has_tau[j]) measured.push_back(j);
  if (measured.empty()) {
    c.check(kName, false,
            !c.unfiltered_reason.empty() ? c.unfiltered_reason
                                         : "no joint with a torque moves by enough");
    return;
  }
  const BlackBox box(c, std::move(moving));
  if (box.x.size() == 0) {
    c.check(kName, false,
            format("%zu rows at 50 Hz are too few for %zu joints", box.rows.at.size(),
                   box.moving.size()));
    return;
  }
  const std::size_t num = measured.size();
  std::vector<LoggedTorque> channel;
  for (const int j : measured) channel.push_back(fit_channel(c, box, measured, j));
  // The black box is not the robot, so a jump must be clearer than other faults.
  const double sure = 2.0 * c.limits.significance;
  const auto jumps = [&](std::size_t k, std::size_t j, double sign) {
    const Coefficient& jump = channel[k].jump[j];
    return sign * jump.z > sure && jump.share > kSmallJump;
  };
  const auto in_all_runs = [&](std::size_t k, std::size_t j, double sign) {
    return jumps(k, j, sign) &&
           sign * sureness_by_runs(c, box, measured[k], measured[j], box.column(measured[j])) >
               c.limits.significance;
  };
  int by_friction = 0, by_inertia = 0;
  std::vector<bool> swapped(num, false);
  for (std::size_t k = 0; k < num; ++k) {
    const std::string& joint = c.joints[measured[k]].name;
    const std::string unit = c.torque_unit(measured[k]);
    const Coefficient &jump = channel[k].jump[k], &inertia = channel[k].inertia[k];
    if (jumps(k, k, 1.0)) ++by_friction;
    if (swapped[k]) continue;
    std::size_t other = k;
    for (std::size_t j = k + 1; j < num; ++j)
      if (in_all_runs(k, j, 1.0) && in_all_runs(j, k, 1.0) &&
          channel[k].jump[j].size > 4.0 * std::abs(jump.size) &&
          channel[j].jump[k].size > 4.0 * std::abs(channel[j].jump[j].size))
        other = j;
    if (other != k) {
      swapped[other] = true;
      const std::string& second = c.joints[measured[other]].name;
      const Coefficient &here = channel[k].jump[other], &there = channel[other].jump[k];
      ChannelFault f = make_fault("torque_swapped", joint, "tau_" + joint, here.size, unit);
      f.significance = std::min(here.z, there.z);
      f.std = here.std();
      f.evidence = format(
          "tau_%s jumps by %.3g %s where %s reverses and by %.2g where %s does; tau_%s "
          "the other way round (%.3g and %.2g): friction of each in the other's channel",
          joint.c_str(), 2.0 * here.size, unit.c_str(), second.c_str(), 2.0 * jump.size,
          joint.c_str(), second.c_str(), 2.0 * there.size, 2.0 * channel[other].jump[other].size);
      c.add(std::move(f));
      continue;
    }
    const auto flipped = [&](const Coefficient& by, const std::string& per, std::string evidence) {
      ChannelFault f = make_fault("torque_sign", joint, "tau_" + joint, by.size, per);
      f.significance = -by.z;
      f.std = by.std();
      f.evidence = std::move(evidence);
      c.add(std::move(f));
    };
    if (in_all_runs(k, k, -1.0)) {
      ++by_friction;
      flipped(jump, unit,
              format("drops by %.3g ± %.2g %s where %s turns from negative to positive velocity; "
                     "friction makes it rise: the sign is flipped",
                     -2.0 * jump.size, 2.0 * jump.std(), unit.c_str(), joint.c_str()));
      continue;
    }
    // A late torque takes friction's share off the inertia, but does not turn friction round.
    if (jumps(k, k, 1.0) || std::abs(inertia.z) < sure || inertia.share < kSmallInertia ||
        channel[k].viscous[k].z > c.limits.significance)
      continue;
    ++by_inertia;
    const long column = 2 * static_cast<long>(box.moving.size()) + box.column(measured[k]);
    if (inertia.size > 0.0 ||
        -sureness_by_runs(c, box, measured[k], measured[k], column) < c.limits.significance)
      continue;
    const std::string per = unit + "/(" + c.position_unit(measured[k]) + "/s^2)";
    flipped(inertia, per,
            format("falls by %.3g ± %.2g %s as %s accelerates, where a mass makes it rise (its "
                   "friction is too small to be seen): the sign of the torque, or of the position, "
                   "is flipped",
                   -inertia.size, inertia.std(), per.c_str(), joint.c_str()));
  }
  c.check(
      kName, true,
      format("friction shows whose torque it is, and its sign, at %d of %zu joints, and inertia "
             "its sign at %d of the others; whether torques are shifted in time against "
             "positions needs the dynamics (diagnose)",
             by_friction, num, by_inertia));
}

}  // namespace diffnea::detail
