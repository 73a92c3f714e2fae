/// Commands: which comes first, command or position, and what one stamp for both hides.

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "recording/audit_parts.hpp"
#include "recording/audit_statistics.hpp"
#include "recording/command_lag.hpp"
#include "recording/held_rows.hpp"

namespace diffnea::detail {
namespace {

/// A row's stamp is taken once; drives on a bus are written and read one after the other.
void note_one_stamp(const AuditContext& c, const std::vector<std::pair<int, CommandLag>>& lags) {
  if (lags.size() < 2) return;
  const auto by_lag = [](const auto& a, const auto& b) {
    return a.second.seconds < b.second.seconds;
  };
  const auto [least, most] = std::ranges::minmax(lags, by_lag);
  ChannelFault f = make_fault("one_time_stamp", "all", "time", c.dt, "s");
  f.severity = FaultSeverity::kNote;
  f.evidence = format(
      "commands and positions of %zu drives share one stamp a row, %.3g ms apart: on a bus that is "
      "written and read drive by drive, each is up to a row later than stamped. Positions follow "
      "their commands by %.3g ms (%s) to %.3g ms (%s), drive, bus and stamp together: let every "
      "joint have a delay of its own",
      lags.size(), 1e3 * c.dt, 1e3 * least.second.seconds, c.joints[least.first].name.c_str(),
      1e3 * most.second.seconds, c.joints[most.first].name.c_str());
  c.add(std::move(f));
}

/// A joint that something holds while its command goes on.
void find_held_joint(const AuditContext& c, int joint) {
  const std::vector<HeldRows> held = find_held(c.recordings, joint);
  if (held.empty()) return;
  const std::string& name = c.joints[static_cast<std::size_t>(joint)].name;
  const HeldRows& most =
      *std::ranges::max_element(held, {}, [](const HeldRows& h) { return std::abs(h.beyond); });
  ChannelFault f = make_fault("held", name, "q_" + name, most.beyond, c.position_unit(joint));
  f.source = c.recordings[most.recording].source;
  f.severity = FaultSeverity::kNote;
  f.evidence = held_text(c.recordings, held, c.position_unit(joint));
  c.add(std::move(f));
}

}  // namespace

void audit_command(AuditContext& c) {
  const char* const kName = "commands";
  std::vector<std::pair<int, CommandLag>> lags;
  int blind = 0;
  for (int j = 0; j < c.num_joints(); ++j) {
    if (!c.is_driven_blind(j)) continue;
    ++blind;
    find_held_joint(c, j);
    if (const auto lag = find_command_lag(c.recordings, j)) lags.emplace_back(j, *lag);
  }
  if (lags.empty()) {
    c.check(kName, false,
            blind == 0 ? "torques are recorded; commands are not used beside them"
                       : "no joint follows a recorded command for five seconds");
    return;
  }
  for (const auto& [joint, lag] : lags) {
    if (!lag.is_early(c.limits.significance)) continue;
    const std::string& name = c.joints[static_cast<std::size_t>(joint)].name;
    ChannelFault f = make_fault(lag.is_swapped() ? "command_swapped" : "command_late", name,
                                "qcmd_" + name, lag.seconds, "s");
    f.std = lag.std;
    f.significance =
        lag.std > 0.0 ? -lag.seconds / lag.std : std::numeric_limits<double>::infinity();
    f.evidence = early_text(lag, name);
    c.add(std::move(f));
  }
  note_one_stamp(c, lags);
  c.check(kName, true,
          format("which comes first, at %zu of %d joints without a torque", lags.size(), blind));
}

}  // namespace diffnea::detail
