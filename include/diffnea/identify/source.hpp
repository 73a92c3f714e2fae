#pragma once
/// Where recordings come from: memory, or files that are read block by block, as often as needed.

#include <filesystem>
#include <functional>
#include <memory>

#include <diffnea/model/model.hpp>
#include <diffnea/recording/csv.hpp>
#include <diffnea/recording/joints.hpp>

namespace diffnea {

/// One run of a source.
struct RunDescription {
  std::string source;  ///< file and run, for messages
  RecordingInfo info;  ///< what its columns cannot hold
  /// What tells it from others, whichever file holds it: 16 hexadecimal digits (FNV-1a) of the
  /// times and positions of its first 1000 rows. Torques and the ball do not count: what is taken
  /// out of them makes no other recording.
  std::string motion;
  /// Likewise of all its rows: positions, torques, the ball's positions.
  std::string rows;
};

/// A stream of recordings whose joints are in the model's order and whose runs are numbered 0, 1, 2
/// ….
class RecordingSource {
 public:
  virtual ~RecordingSource() = default;
  /// Calls `use` with whole runs or blocks of them, in order, until it returns false.
  virtual void for_each(const std::function<bool(const Recording&)>& use) const = 0;
  /// Enough of the beginning to choose filters from.
  virtual std::vector<Recording> sample() const = 0;
  /// 0, 1, 2 …, one a recording.
  virtual std::vector<int> runs() const = 0;
  /// In order. Files that are streamed are read through, once.
  virtual std::vector<RunDescription> describe_runs() const = 0;
  /// Some recording says that the robot held a body.
  virtual bool holds_payload() const = 0;
  /// What reading brought up: quarantined rows, gaps, extra channels. Of files that are streamed:
  /// complete after the first for_each() that came to the end.
  virtual const ReadReport& report() const = 0;
  /// What looks wrong against the model: degrees where radians are expected, torque beyond limits.
  virtual const std::vector<ChannelWarning>& warnings() const = 0;
};

/// Recordings in memory; columns of joints that the model does not have are left out, and
/// continuous joints unwrapped. @throws DataError if joints of the model are missing (both sets
/// listed)
std::unique_ptr<RecordingSource> recordings_in_memory(const Model& model,
                                                      std::vector<Recording> recordings);

/// Files. Small ones are read once and kept; above `keep_bytes` in all they are streamed at every
/// pass.
/// @param options  of each file (name, columns, sidecar); one for all if its size is 1; joints are
///                 the model's
/// @throws FileError, DataError (recording/csv.hpp), naming file, line and column
std::unique_ptr<RecordingSource> recordings_in_files(
    const Model& model, const std::vector<std::filesystem::path>& paths,
    const std::vector<ReadOptions>& options, long keep_bytes = 64L << 20);

/// The model's joints as recording/ wants them.
std::vector<JointDescription> describe_joints(const Model& model);

}  // namespace diffnea
