#pragma once
/// Faults of the channels, found before any dynamics: velocities that are not the derivative of the
/// positions, clocks that pause or run at two rates, torques at a limit, channels that are dead,
/// swapped, sampled more slowly than their rows, or in another unit. docs/recordings.md lists the
/// faults with their thresholds.
///
///     const AuditReport report = audit(read_recordings("arm.csv"), {.joints =
///     describe_joints(m)}); for (const ChannelFault& f : report.faults) use(f.fault, f.channel,
///     f.value, f.evidence);
///
/// A fault needs both: it is significant (its size against a standard error that knows of
/// correlation in time), and large enough to matter. Works on recordings in memory; the scratch is
/// of their size.

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/recording/csv.hpp>
#include <diffnea/recording/joints.hpp>
#include <diffnea/recording/recording.hpp>

namespace diffnea {

/// What is known of the robot beside its recordings, and how sure a fault must be.
struct AuditLimits {
  /// The model's joints; empty: no model, then whatever needs a limit is not checked. Joints are
  /// matched by name, others are ignored.
  std::vector<JointDescription> joints;
  double significance = 5.0;  ///< least size of a fault over its standard error
  /// Torques that the model needs for a motion of `joints`, in their order (rows × n): q, q̇, q̈
  /// [rad, rad/s, rad/s²] → τ [N·m]. Empty: the size of torques is not checked.
  std::function<RowMatX<double>(const RowMatX<double>&, const RowMatX<double>&,
                                const RowMatX<double>&)>
      model_torque = {};
};

/// Whether a finding biases what is fitted, or is worth knowing.
enum class FaultSeverity {
  kNote,   ///< worth knowing; identification copes with it
  kFault,  ///< biases what is identified or diagnosed from this channel
};

/// Names in result files.
template <>
struct EnumNames<FaultSeverity> {
  /// Both severities.
  static constexpr NamedValue<FaultSeverity> list[] = {{FaultSeverity::kFault, "fault"},
                                                       {FaultSeverity::kNote, "note"}};
};

/// One thing that is wrong with a channel, as data.
struct ChannelFault {
  std::string fault;
  std::string where;
  std::string channel;
  double value = 0.0;
  std::string unit;
  double std = std::numeric_limits<double>::quiet_NaN();
  double significance = std::numeric_limits<double>::quiet_NaN();
  FaultSeverity severity = FaultSeverity::kFault;
  std::string source;
  std::string evidence;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ChannelFault", "One thing that is wrong with a channel.");
    list.field("fault", &ChannelFault::fault, "Name, e.g. ``velocity_filter_lag``.");
    list.field("where", &ChannelFault::where, "Joint, or ``time``, ``ball``, ``all``.");
    list.field("channel", &ChannelFault::channel, "Column, e.g. ``qd_elbow``.", {.optional = true});
    list.field("value", &ChannelFault::value, "Size of the fault.", {.unit = "unit"});
    list.field("unit", &ChannelFault::unit, "Of the value; ``1`` for none.", {.optional = true});
    list.field("std", &ChannelFault::std, "Standard error; NaN: a count or an exact value.");
    list.field("significance", &ChannelFault::significance,
               "Size over its standard error; NaN likewise.");
    list.field("severity", &ChannelFault::severity,
               "``fault``: biases what is fitted; ``note``: identification copes with it.",
               {.optional = true});
    list.field("source", &ChannelFault::source, "Recording and run; empty: all of them together.",
               {.empty_is_null = true});
    list.field("evidence", &ChannelFault::evidence, "One sentence with numbers.",
               {.optional = true});
  }
};

/// How a motion repeats.
struct Period {
  double seconds = 0.0;
  double std = 0.0;
  double repeats = 0.0;
  double mismatch = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Period", "How a motion repeats.");
    list.field("seconds", &Period::seconds, "The smallest period [s]; 0: none.");
    list.field("std", &Period::std, "Standard error of ``seconds``.", {.unit = "s"});
    list.field("repeats", &Period::repeats, "How often the recording holds it.");
    list.field("mismatch", &Period::mismatch,
               "Rms difference of positions one period apart, over √2 times the motion's rms: 1 if "
               "unrelated.");
  }
};

/// A family of checks: what it looked at, or why it could not.
struct AuditCheck {
  std::string name;
  bool done = false;
  std::string text;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("AuditCheck", "What was looked at, or why it could not be.");
    list.field("name", &AuditCheck::name,
               "Of the family, e.g. ``time``, ``spikes``, ``measured velocity``.",
               {.key = "check"});
    list.field("done", &AuditCheck::done, "False: it could not look.");
    list.field("text", &AuditCheck::text, "What it looked at, or why it could not.");
  }
};

/// What an audit found, and what it looked at.
struct AuditReport {
  std::vector<ChannelFault> faults;
  std::vector<AuditCheck> checks;
  std::vector<Period> periods;
  long rows = 0;
  double rate_hz = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("AuditReport", "What an audit found, and what it looked at.");
    list.field("rows", &AuditReport::rows, "Of all recordings.");
    list.field("rate_hz", &AuditReport::rate_hz, "Of the rows; 0: unknown.",
               {.unit = "Hz", .empty_is_null = true});
    list.field("faults", &AuditReport::faults,
               "Faults first, then notes; each by its significance.", {.key = "audit"});
    list.field("checks", &AuditReport::checks, "What was looked at.");
    list.field("periods", &AuditReport::periods, "Per recording.");
  }
};

/// Looks at all recordings of one robot. Recordings too short or without motion are no error: the
/// checks say what they could not do.
/// @throws DataError if there is no recording, or the recordings differ in joints
AuditReport audit(const std::vector<Recording>& recordings, const AuditLimits& limits = {});

/// What the reader left out, as faults ("impossible_rows", "repeated_time"), put into `report`.
void add_reading(const ReadReport& reading, AuditReport& report);

/// Every name that ChannelFault::fault can take, with one line of what it means.
std::vector<std::pair<std::string, std::string>> audit_fault_names();

/// The smallest period of the positions' motion; at least two periods must lie in the longest
/// stretch without a gap.
Period detect_period(const Recording& recording);

}  // namespace diffnea
