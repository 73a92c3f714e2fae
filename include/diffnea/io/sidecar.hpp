#pragma once
/// The JSON file beside a recording that holds what columns cannot: `arm.json` (or `arm.csv.json`)
/// for `arm.csv`.
///
///     {"schema": "diffnea/recording/1",
///      "torque_side": "motor", "torque_sampling": "hold", "period": 10.0, "passive": ["wrist"],
///      "torque_constant": {"elbow": 0.119},
///      "controller": {"elbow": {"kp": 300.0, "kd": 12.0, "limit": 40.0}},
///      "payload": {"where": "tip", "mass": 2.8, "com": [0, 0, 0.05]}}
///
/// Every key may be missing. A .json of another diffnea schema (a model of the same name) is not
/// taken.

#include <filesystem>
#include <optional>

#include <diffnea/recording/csv.hpp>

namespace diffnea {

/// What the JSON file beside a recording says.
struct Sidecar {
  std::filesystem::path path;      ///< of the JSON file
  RecordingInfo info;              ///< what it gives; defaults for the rest
  std::vector<std::string> notes;  ///< keys that are not of the format
};

/// @param data  the recording's path; its sidecar need not exist
/// @throws DataError naming the file and key if a value is not what the format says; FileError
std::optional<Sidecar> read_sidecar(const std::filesystem::path& data);

/// `options` with the info of the recording's sidecar, if there is one; joints that `options` calls
/// passive stay so. @throws as read_sidecar
ReadOptions with_sidecar(const std::filesystem::path& data, ReadOptions options = {});

/// Where write_sidecar writes: the file that is read_sidecar's, or else `arm.json`. Ask before the
/// recording is written.
/// @throws FileError if something is there that is not a recording's, e.g. a model of the same
/// name; else as read_sidecar
std::filesystem::path sidecar_path(const std::filesystem::path& data);

/// First key in which the sidecars of two recordings differ, `payload`; empty if none does. Runs of
/// one file share a sidecar.
std::string sidecar_difference(const RecordingInfo& a, const RecordingInfo& b);

/// Writes the sidecar of a recording, atomically. @throws as sidecar_path
void write_sidecar(const RecordingInfo& info, const std::filesystem::path& data);

}  // namespace diffnea
