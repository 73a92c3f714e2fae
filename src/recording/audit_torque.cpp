/// Torque channels without dynamics. Friction is the one term that every geared joint has, that
/// jumps with the sign of its own velocity, and whose sign is known: it tells whose torque a
/// channel is, and which way round. All that is smooth in q, q̇ and q̈ goes into a black box beside
/// it.

#include <algorithm>
#include <cmath>

#include <diffnea/recording/butterworth.hpp>

#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"

namespace diffnea::detail {
namespace {

/// Width of the sign's edge, over the joint's rms velocity.
constexpr double kEdge = 0.05;
/// Of the rms torque: smaller jumps are left to chance.
constexpr double kSmallJump = 0.03;

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

}  // namespace

void audit_torque(AuditContext& c) {
  const char* const kName = "sign and joint of torques";
  std::vector<int> measured, moving;
  if (!c.stretches.empty())
    for (int j = 0; j < c.num_joints(); ++j) {
      double low = std::numeric_limits<double>::infinity(), high = -low, square = 0.0, rows = 0.0;
      for (const FilteredStretch& s : c.stretches) {
        low = std::min(low, s.q.col(j).minCoeff());
        high = std::max(high, s.q.col(j).maxCoeff());
        square += s.qd.col(j).squaredNorm();
        rows += static_cast<double>(s.qd.rows());
      }
      if (!(high - low > 0.02 && std::sqrt(square / rows) > 20.0 * c.velocity_noise[j])) continue;
      moving.push_back(j);
      if (c.has_tau[j]) measured.push_back(j);
    }
  if (measured.empty()) {
    c.check(kName, false,
            !c.unfiltered_reason.empty() ? c.unfiltered_reason
                                         : "no joint with a torque moves by enough");
    return;
  }
  const Rows rows = choose_rows(c);
  const long num_rows = static_cast<long>(rows.at.size()), m = static_cast<long>(moving.size());
  const long runs = static_cast<long>(c.recordings.size());
  std::vector<double> edge(moving.size(), 0.0);
  for (std::size_t i = 0; i < moving.size(); ++i) {
    for (const auto& [k, row] : rows.at) edge[i] += std::pow(c.stretches[k].qd(row, moving[i]), 2);
    edge[i] = kEdge * std::sqrt(edge[i] / static_cast<double>(num_rows));
  }
  // Sign of every joint first, then what is smooth: q̇, q̈, and trigonometric terms of gravity,
  // products of two joints where there are rows enough for them.
  const long trigonometric = 2 * m, products = trigonometric * (trigonometric - 1) / 2;
  const long plain = 3 * m + trigonometric + runs;
  const bool with_products = plain + products < num_rows / 10;
  const long columns = plain + (with_products ? products : 0);
  if (columns * 5 > num_rows) {
    c.check(kName, false, format("%ld rows at 50 Hz are too few for %ld joints", num_rows, m));
    return;
  }
  // What the low-pass does to torques, it must do to the jumps; all else is smooth.
  const Butterworth filter(c.plan->order, c.plan->filter_hz, 1.0 / c.plan->dt);
  std::vector<RowMatX<double>> signs;
  for (const FilteredStretch& s : c.stretches) {
    RowMatX<double> sign(s.qd.rows(), m);
    for (long j = 0; j < m; ++j) sign.col(j) = (s.qd.col(moving[j]).array() / edge[j]).tanh();
    filter.filter_both_ways(sign);
    signs.push_back(std::move(sign));
  }
  MatX<double> x = MatX<double>::Zero(num_rows, columns);
  for (long i = 0; i < num_rows; ++i) {
    const auto& [k, row] = rows.at[i];
    const FilteredStretch& s = c.stretches[k];
    VecX<double> trig(trigonometric);
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
  struct Jump {
    double size = 0.0, z = 0.0;
  };
  const std::size_t num = measured.size();
  std::vector<std::vector<Jump>> jump(num, std::vector<Jump>(num));  // [channel][joint]
  std::vector<double> rms(num, 0.0);
  for (std::size_t k = 0; k < num; ++k) {
    VecX<double> tau(num_rows);
    for (long i = 0; i < num_rows; ++i)
      tau[i] = c.stretches[rows.at[i].first].tau(rows.at[i].second, measured[k]);
    rms[k] = std::sqrt((tau.array() - tau.mean()).square().mean());
    if (!(rms[k] > 0.0)) continue;
    const BlockFit fit = fit_in_blocks(x, tau, rows.block);
    for (std::size_t j = 0; j < num; ++j) {
      const long column = std::ranges::find(moving, measured[j]) - moving.begin();
      jump[k][j].size = fit.coefficients[column];
      jump[k][j].z = fit.std[column] > 0.0 ? fit.coefficients[column] / fit.std[column] : 0.0;
    }
  }
  // The black box is not the robot, so a jump must be clearer than other faults.
  const double sure = 2.0 * c.limits.significance;
  const auto clear = [&](std::size_t k, std::size_t j, double sign) {
    return sign * jump[k][j].z > sure && sign * jump[k][j].size > kSmallJump * rms[k];
  };
  int decided = 0;
  std::vector<bool> swapped(num, false);
  for (std::size_t k = 0; k < num; ++k) {
    const std::string& joint = c.joints[measured[k]].name;
    const std::string unit = c.torque_unit(measured[k]);
    if (clear(k, k, 1.0)) ++decided;
    if (swapped[k]) continue;
    std::size_t other = k;
    for (std::size_t j = k + 1; j < num; ++j)
      if (clear(k, j, 1.0) && clear(j, k, 1.0) &&
          jump[k][j].size > 4.0 * std::abs(jump[k][k].size) &&
          jump[j][k].size > 4.0 * std::abs(jump[j][j].size))
        other = j;
    if (other != k) {
      swapped[other] = true;
      const std::string& second = c.joints[measured[other]].name;
      ChannelFault f =
          make_fault("torque_swapped", joint, "tau_" + joint, jump[k][other].size, unit);
      f.significance = std::min(jump[k][other].z, jump[other][k].z);
      f.std = std::abs(jump[k][other].size / jump[k][other].z);
      f.evidence = format(
          "tau_%s jumps by %.3g %s where %s reverses and by %.2g where %s does; tau_%s "
          "the other way round (%.3g and %.2g): friction of each in the other's channel",
          joint.c_str(), 2.0 * jump[k][other].size, unit.c_str(), second.c_str(),
          2.0 * jump[k][k].size, joint.c_str(), second.c_str(), 2.0 * jump[other][k].size,
          2.0 * jump[other][other].size);
      c.add(std::move(f));
      continue;
    }
    if (!clear(k, k, -1.0)) continue;
    ++decided;
    ChannelFault f = make_fault("torque_sign", joint, "tau_" + joint, jump[k][k].size, unit);
    f.significance = -jump[k][k].z;
    f.std = std::abs(jump[k][k].size / jump[k][k].z);
    f.evidence = format(
        "drops by %.3g ± %.2g %s where %s turns from negative to positive velocity; "
        "friction makes it rise: the sign is flipped",
        -2.0 * jump[k][k].size, 2.0 * f.std, unit.c_str(), joint.c_str());
    c.add(std::move(f));
  }
  c.check(
      kName, true,
      format(
          "friction shows whose torque it is, and its sign, at %d of %zu joints; whether torques "
          "are shifted in time against positions needs the dynamics (diagnose)",
          decided, num));
}

}  // namespace diffnea::detail
