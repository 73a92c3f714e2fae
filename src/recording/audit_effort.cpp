/// Torque channels that hold something else: a current, told by the torques that the model's
/// links need; counts of a signed number that were read as unsigned.

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"
#include "recording/twos_complement.hpp"

namespace diffnea::detail {
namespace {

/// Ratio of recorded to needed torque from which the channel holds something else: masses and gears
/// of descriptions are seldom off by as much.
constexpr double kOther = 3.0;
/// Share of the torque's mean square, friction aside, that the links must account for.
constexpr double kLoaded = 0.5;

struct Ratio {
  int joint = 0;
  double value = 0.0, std = 0.0;
};

/// Recorded over needed torque of one joint, beside its friction, rotor and offset.
std::optional<Ratio> ratio_of(const AuditContext& c, const std::vector<RowMatX<double>>& needed,
                              int joint) {
  const long step = std::max(1L, std::lround(0.02 / c.plan->dt));
  std::vector<double> tau, links, rate, acceleration;
  std::vector<int> block;
  int first = 0;
  for (std::size_t k = 0; k < c.stretches.size(); ++k) {
    const FilteredStretch& s = c.stretches[k];
    for (long i = 0; i < s.time.size(); i += step) {
      tau.push_back(s.tau(i, joint));
      links.push_back(needed[k](i, joint));
      rate.push_back(s.qd(i, joint));
      acceleration.push_back(s.qdd(i, joint));
      block.push_back(first + static_cast<int>(static_cast<double>(i) * c.plan->dt / 0.5));
    }
    if (!block.empty()) first = block.back() + 1;
  }
  const long rows = static_cast<long>(tau.size());
  constexpr long kColumns = 5;
  if (rows < 10 * kColumns) return std::nullopt;
  const auto as_vector = [](const std::vector<double>& x) {
    return Eigen::Map<const VecX<double>>(x.data(), static_cast<long>(x.size()));
  };
  const VecX<double> y = as_vector(tau), qd = as_vector(rate);
  const double edge = 0.05 * std::sqrt(qd.squaredNorm() / static_cast<double>(rows));
  if (!(edge > 0.0) || !y.allFinite()) return std::nullopt;
  MatX<double> x(rows, kColumns);
  x.col(0) = as_vector(links);
  x.col(1).setOnes();
  x.col(2) = (qd.array() / edge).tanh();
  x.col(3) = qd;
  x.col(4) = as_vector(acceleration);
  const BlockFit fit = fit_in_blocks(x, y, block);
  const VecX<double> by_links = fit.coefficients[0] * (x.col(0).array() - x.col(0).mean());
  const double left = fit.residual.squaredNorm();
  if (!(by_links.squaredNorm() * (1.0 - kLoaded) > kLoaded * left)) return std::nullopt;
  return Ratio{joint, fit.coefficients[0], fit.std[0]};
}

void find_current(AuditContext& c, const std::vector<int>& unsigned_torques) {
  const char* const kName = "size of torques";
  if (!c.limits.model_torque || c.stretches.empty()) {
    c.check(kName, false,
            c.limits.model_torque ? c.unfiltered_reason
                                  : "without a model nothing says how large torques must be");
    return;
  }
  std::vector<RowMatX<double>> needed;
  for (const FilteredStretch& s : c.stretches)
    needed.push_back(c.limits.model_torque(s.q, s.qd, s.qdd));
  std::vector<Ratio> told;
  for (int j = 0; j < c.num_joints(); ++j) {
    if (!c.has_tau[static_cast<std::size_t>(j)] ||
        std::ranges::find(unsigned_torques, j) != unsigned_torques.end())
      continue;
    const std::optional<Ratio> ratio = ratio_of(c, needed, j);
    if (ratio && ratio->std > 0.0 && std::abs(ratio->value) > c.limits.significance * ratio->std)
      told.push_back(*ratio);
  }
  c.check(kName, !told.empty(),
          told.empty() ? "no joint carries enough of its links' weight and inertia"
                       : format("against what the model's links need, at %zu joints", told.size()));
  std::vector<Ratio> off;
  for (const Ratio& r : told) {
    const double away = std::abs(std::log(std::abs(r.value))) - std::log(kOther);
    if (away > 0.0 && away * std::abs(r.value) > c.limits.significance * r.std) off.push_back(r);
  }
  // One joint among many that is off is the model's link; all of them are the log's unit.
  if (off.empty() || 2 * off.size() <= told.size()) return;
  std::string each, constants;
  std::vector<double> values;
  for (const Ratio& r : off) {
    const std::string& joint = c.joints[static_cast<std::size_t>(r.joint)].name;
    const char* comma = each.empty() ? "" : ", ";
    each += format("%s%s %.3g ± %.2g", comma, joint.c_str(), r.value, r.std);
    constants += format("%s%s %.3g", comma, joint.c_str(), 1.0 / r.value);
    values.push_back(std::abs(r.value));
  }
  const bool one = off.size() == 1;
  ChannelFault f =
      make_fault("effort_is_current", one ? c.joints[off[0].joint].name : "all",
                 one ? "tau_" + c.joints[off[0].joint].name : "tau", quantile(values, 0.5), "1");
  f.std = off[0].std;
  f.significance = std::numeric_limits<double>::infinity();
  for (const Ratio& r : off) f.significance = std::min(f.significance, std::abs(r.value) / r.std);
  f.evidence = format(
      "recorded over needed torque is %s: a current [A], counts, or a torque before the "
      "gear? If a current, name the columns [A] and state torque_constant (at the joint, "
      "by the model's masses: %s N*m/A); or the model's masses are off",
      each.c_str(), constants.c_str());
  c.add(std::move(f));
}

/// @return joints whose torque is such a number: its size tells nothing
std::vector<int> find_unsigned(const AuditContext& c) {
  std::vector<int> torques;
  for_each_channel(c, [&](const ChannelView& view) {
    if (view.kind == 'x') return;
    const std::optional<TwosComplement> found = find_twos_complement(view.values);
    if (!found) return;
    ChannelFault f =
        make_fault("twos_complement", view.where, view.channel, found->modulus, view.unit);
    f.source = c.recordings[view.recording].source;
    f.evidence = twos_complement_text(*found, view.channel, view.kind == 't');
    c.add(std::move(f));
    if (view.kind == 't') torques.push_back(view.joint);
  });
  return torques;
}

}  // namespace

void audit_effort(AuditContext& c) { find_current(c, find_unsigned(c)); }

}  // namespace diffnea::detail
