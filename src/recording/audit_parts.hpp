#pragma once
/// The families of checks behind audit(), and what they share. Internal to recording/.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <diffnea/recording/audit.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea::detail {

/// Series of every joint that go through the same filter without phase, so that they can be
/// compared: one entry per recording and stretch without a gap.
struct FilteredStretch {
  std::size_t recording = 0;
  VecX<double> time;                          ///< (N) [s]
  RowMatX<double> q, qd, qdd;                 ///< (N, n) from positions
  RowMatX<double> tau;                        ///< (N, n); a channel that is not there: 0
  RowMatX<double> measured_qd, measured_qdd;  ///< likewise; empty if the recording has none
};

struct AuditContext {
  AuditContext(const std::vector<Recording>& r, const AuditLimits& l, AuditReport& out)
      : recordings(r), limits(l), report(out) {}

  const std::vector<Recording>& recordings;
  const AuditLimits& limits;
  AuditReport& report;
  std::vector<JointDescription> joints;  ///< in the recordings' order; without a model: names alone
  bool has_model = false;
  double dt = 0.0;  ///< median interval [s]; 0: unknown

  // Of the filtered series; `unfiltered_reason` says why there are none.
  std::optional<PreprocessPlan> plan;
  std::vector<FilteredStretch> stretches;
  std::string unfiltered_reason;
  std::vector<bool> has_qd, has_qdd, has_tau;  ///< per joint: enough values to compare
  std::vector<double> velocity_noise;          ///< per joint: rms noise of the filtered qd

  void add(ChannelFault fault) const { report.faults.push_back(std::move(fault)); }
  void check(std::string name, bool done, std::string text) const {
    report.checks.push_back({std::move(name), done, std::move(text)});
  }
  /// Tells whether nobody knows the torque of a drive: its commands are what is fitted then.
  bool is_driven_blind(int joint) const {
    return !has_tau[static_cast<std::size_t>(joint)] &&
           !joints[static_cast<std::size_t>(joint)].passive;
  }
  int num_joints() const { return static_cast<int>(joints.size()); }
  /// "rad" or "m"; "N*m" or "N".
  std::string position_unit(int joint) const { return joints[joint].prismatic ? "m" : "rad"; }
  std::string torque_unit(int joint) const { return joints[joint].prismatic ? "N" : "N*m"; }
};

/// One column of one recording.
struct ChannelView {
  std::string where, channel, unit;
  char kind = 'x';  ///< q, v(elocity), a(cceleration), c(ommand), t(orque); x: of an axis, no joint
  int joint = -1;
  std::size_t recording = 0;
  VecX<double> values;
};
/// Calls `look` with every measured column of every recording, one at a time.
void for_each_channel(const AuditContext& context,
                      const std::function<void(const ChannelView&)>& look);

/// A fault without a standard error, to be completed.
ChannelFault make_fault(std::string fault, std::string where, std::string channel, double value,
                        std::string unit);

void filter_channels(AuditContext& context);

void audit_time(AuditContext& context);
void audit_dead(AuditContext& context);
void audit_stuck(AuditContext& context);
void audit_spikes(AuditContext& context);
void audit_limits(AuditContext& context);
void audit_velocity(AuditContext& context);
void audit_base(AuditContext& context);
void audit_torque(AuditContext& context);
void audit_effort(AuditContext& context);
void audit_command(AuditContext& context);
void audit_period(AuditContext& context);

}  // namespace diffnea::detail
