/// Values at, beyond and far from their limits: clipping, limits of the model, units.

#include <algorithm>
#include <cmath>
#include <map>

#include <diffnea/recording/commands.hpp>
#include <diffnea/recording/position_warnings.hpp>

#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"

namespace diffnea::detail {
namespace {

/// Rows at the extreme value against rows in each of the next steps below it; a smooth crest
/// gives 3.
constexpr double kFlatTop = 10.0;

struct FlatTop {
  double at = 0.0;
  long rows = 0, tops = 0, longest = 0;
};

/// A plateau at the largest value of `x`, entered with speed (a joint at rest is none).
/// @param command  of the same rows; empty: none. Where it stands still, so may a joint
FlatTop find_flat_top(const VecX<double>& x, const VecX<double>& command, double sign,
                      double quantum) {
  FlatTop out;
  double high = -std::numeric_limits<double>::infinity(), low = -high;
  for (const double v : x)
    if (std::isfinite(v)) {
      high = std::max(high, sign * v);
      low = std::min(low, sign * v);
    }
  const double range = high - low;
  if (!(range > 64.0 * quantum) || !(range > 0.0)) return out;
  const double step = std::max(quantum, 2e-3 * range);
  const double same = std::max(0.5 * quantum, 1e-9 * range);
  long below = 0, run = 0, top = 0;
  double entry = 0.0, typical_entry = 0.0;
  const auto is_led = [&](long end) {
    if (command.size() == 0 || run < 2) return true;
    const auto told = command.segment(end - run, run);
    return told.maxCoeff() - told.minCoeff() > 2.0 * step;
  };
  const auto leave = [&](long end) {
    if (run > 0 && is_led(end)) {
      top += run;
      out.longest = std::max(out.longest, run);
      if (run >= 3) {
        ++out.tops;
        typical_entry = std::max(typical_entry, entry);
      }
    }
    run = 0;
  };
  for (long i = 0; i < x.size(); ++i) {
    const double depth = high - sign * x[i];
    if (depth > same && depth <= same + 3.0 * step) ++below;
    if (depth <= same) {
      if (run == 0) entry = i > 0 ? std::abs(x[i] - x[i - 1]) : 0.0;
      ++run;
    } else {
      leave(i);
    }
  }
  const double before = typical_entry;  // the last one has no other side
  leave(x.size());
  typical_entry = before;
  out.at = sign * high;
  out.rows = top;
  const bool flat = top >= 10 && out.longest >= 4 && out.tops >= 1 &&
                    static_cast<double>(top) > kFlatTop * static_cast<double>(below) / 3.0 &&
                    typical_entry > std::max(2.0 * quantum, 1e-4 * range);
  if (!flat) out.rows = 0;
  return out;
}

void find_clipping(const AuditContext& c, const ChannelView& view) {
  if (view.kind != 't' && view.kind != 'q') return;
  const double quantum = find_quantum(view.values);
  const Recording& r = c.recordings[view.recording];
  VecX<double> command;
  if (view.kind == 'q' && view.joint >= 0 && is_logged(r.qcmd, view.joint)) {
    // Friction holds a servo at its turns; what else does is told by its commands (`held`).
    if (c.is_driven_blind(view.joint)) return;
    command = r.qcmd.col(view.joint);
  }
  for (const double sign : {1.0, -1.0}) {
    const FlatTop top = find_flat_top(view.values, command, sign, quantum);
    if (top.rows == 0) continue;
    const double share = static_cast<double>(top.rows) / static_cast<double>(r.rows());
    const bool torque = view.kind == 't';
    ChannelFault f = make_fault(torque ? "torque_clipped" : "position_clipped", view.where,
                                view.channel, top.at, view.unit);
    f.source = r.source;
    f.severity = torque && share < 0.001 ? FaultSeverity::kNote : FaultSeverity::kFault;
    f.evidence = format(
        "%ld rows (%.2g %%) hold exactly %.6g %s, its %s value, in %ld flat top%s "
        "of up to %ld rows",
        top.rows, 100.0 * share, top.at, view.unit.c_str(), sign > 0.0 ? "largest" : "smallest",
        top.tops, top.tops == 1 ? "" : "s", top.longest);
    if (torque && view.joint >= 0 && std::isfinite(c.joints[view.joint].effort))
      f.evidence += format("; the model's limit is %.4g", c.joints[view.joint].effort);
    if (!torque) f.evidence += ": the end of the sensor's range, or a mechanical stop";
    c.add(std::move(f));
  }
}

}  // namespace

void audit_limits(AuditContext& c) {
  std::map<std::string, std::pair<double, double>> extremes;  // channel → lowest, highest
  for_each_channel(c, [&](const ChannelView& view) {
    find_clipping(c, view);
    auto [it, fresh] = extremes.try_emplace(view.channel, std::numeric_limits<double>::infinity(),
                                            -std::numeric_limits<double>::infinity());
    for (const double x : view.values)
      if (std::isfinite(x)) {
        it->second.first = std::min(it->second.first, x);
        it->second.second = std::max(it->second.second, x);
      }
  });
  std::vector<std::string> explained;  // joints whose positions beyond limits have a name
  const auto add_warnings = [&](const std::vector<ChannelWarning>& warnings, const char* name,
                                const char* unit) {
    for (const ChannelWarning& warning : warnings) {
      const auto& [low, high] = extremes["q_" + warning.joint];
      ChannelFault f = make_fault(name, warning.joint, "q_" + warning.joint,
                                  std::max(std::abs(low), std::abs(high)), unit);
      f.evidence = warning.text;
      const auto joint = std::ranges::find(c.joints, warning.joint, &JointDescription::name);
      if (f.fault == "position_wrapped" && joint != c.joints.end() && joint->continuous)
        f.severity = FaultSeverity::kNote;
      explained.push_back(warning.joint);
      c.add(std::move(f));
    }
  };
  add_warnings(find_degrees(c.joints, c.recordings), "degrees", "rad");
  add_warnings(find_other_lengths(c.joints, c.recordings), "length_unit", "m");
  const std::vector<ChannelWarning> wrapped = find_wrapped(c.joints, c.recordings);
  add_warnings(wrapped, "position_wrapped", "rad");
  for (const ChannelWarning& w : wrapped)  // dq/dt has the jumps, too: it is no measure of q̇ there
    for (int j = 0; j < c.num_joints(); ++j)
      if (c.joints[static_cast<std::size_t>(j)].name == w.joint)
        c.has_qd[static_cast<std::size_t>(j)] = c.has_qdd[static_cast<std::size_t>(j)] = false;
  int limited = 0;
  std::vector<double> share_of_effort;
  for (int j = 0; j < c.num_joints(); ++j) {
    const JointDescription& joint = c.joints[j];
    const auto q = extremes.find("q_" + joint.name), tau = extremes.find("tau_" + joint.name);
    if (q != extremes.end() && std::isfinite(joint.lower) && std::isfinite(joint.upper) &&
        std::ranges::find(explained, joint.name) == explained.end()) {
      ++limited;
      const auto [low, high] = q->second;
      const double beyond = std::max(high - joint.upper, joint.lower - low);
      // Stops give way, and models round their limits.
      if (beyond > 0.02 * (joint.upper - joint.lower)) {
        ChannelFault f = make_fault("position_beyond_limit", joint.name, "q_" + joint.name, beyond,
                                    c.position_unit(j));
        f.evidence = format(
            "runs from %.4g to %.4g %s, beyond the model's limits %.4g to %.4g: "
            "another zero or sign of the joint, another unit, or the limits are wrong",
            low, high, f.unit.c_str(), joint.lower, joint.upper);
        c.add(std::move(f));
      }
    }
    if (tau == extremes.end() || !std::isfinite(joint.effort) || joint.effort <= 0.0) continue;
    const double peak = std::max(std::abs(tau->second.first), std::abs(tau->second.second));
    const double share = peak / joint.effort;
    if (!std::isfinite(share)) continue;
    if (share > 0.0) share_of_effort.push_back(share);
    if (share <= 1.2) continue;
    ChannelFault f =
        make_fault("torque_beyond_limit", joint.name, "tau_" + joint.name, peak, c.torque_unit(j));
    f.evidence = format("up to %.4g %s, %.3g times the model's limit of %.4g", peak, f.unit.c_str(),
                        share, joint.effort);
    if (share > 10.0) {
      f.fault = "torque_unit";
      f.evidence += share > 100.0 ? ": in millinewtons, or raw counts of the drive?"
                                  : ": a current, or torque on the other side of the gear?";
    }
    f.severity = share > 2.0 ? FaultSeverity::kFault : FaultSeverity::kNote;
    c.add(std::move(f));
  }
  // All joints together far below their limits: gravity alone usually takes more than 1/200.
  if (share_of_effort.size() > 1 && std::ranges::max(share_of_effort) < 0.005) {
    ChannelFault f =
        make_fault("torque_unit", "all", "tau", std::ranges::max(share_of_effort), "1");
    f.severity = FaultSeverity::kNote;
    f.evidence = format(
        "no torque exceeds %.2g %% of its joint's limit: currents [A], or torques "
        "before the gear?",
        100.0 * f.value);
    c.add(std::move(f));
  }
  c.check("limits", true,
          c.has_model ? format("flat tops; positions of %d joints and torques of %zu against the "
                               "model's limits",
                               limited, share_of_effort.size())
                      : "flat tops; without a model no limits to compare with");
}

}  // namespace diffnea::detail
