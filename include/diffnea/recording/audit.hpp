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

#include <limits>
#include <string>
#include <utility>
#include <vector>

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
};

/// Whether a finding biases what is fitted, or is worth knowing.
enum class FaultSeverity {
  kNote,   ///< worth knowing; identification copes with it
  kFault,  ///< biases what is identified or diagnosed from this channel
};

/// One thing that is wrong with a channel, as data.
struct ChannelFault {
  std::string fault;    ///< name, e.g. "velocity_filter_lag"; audit_fault_names() lists all
  std::string where;    ///< joint, or "time", "ball", "all"
  std::string channel;  ///< column, e.g. "qd_elbow"
  double value = 0.0;   ///< size of the fault
  std::string unit;     ///< of the value, "1" for none
  double std =
      std::numeric_limits<double>::quiet_NaN();  ///< standard error; NaN: a count or an exact value
  double significance =
      std::numeric_limits<double>::quiet_NaN();    ///< size over its standard error; NaN likewise
  FaultSeverity severity = FaultSeverity::kFault;  ///< of this fault at this size
  std::string source;    ///< recording and run; empty: all of them together
  std::string evidence;  ///< one sentence with numbers
};

/// How a motion repeats.
struct Period {
  double seconds = 0.0;  ///< smallest; 0: does not repeat
  double std = 0.0;      ///< of `seconds`
  double repeats = 0.0;  ///< how often the recording holds it
  /// Rms difference of positions one period apart, over √2 times the motion's rms: 1 if unrelated.
  double mismatch = 0.0;
};

/// A family of checks: what it looked at, or why it could not.
struct AuditCheck {
  std::string name;   ///< of the family, e.g. "time", "spikes", "measured velocity"
  bool done = false;  ///< false: it could not look
  std::string text;   ///< what it looked at, or why it could not
};

/// What an audit found, and what it looked at.
struct AuditReport {
  std::vector<ChannelFault> faults;  ///< faults first, then notes; by significance
  std::vector<AuditCheck> checks;    ///< done or not
  std::vector<Period> periods;       ///< per recording
  long rows = 0;                     ///< of all recordings
  double rate_hz = 0.0;              ///< of the rows; 0: unknown
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
