#pragma once
/// Logs that have more or fewer joints than the model: what is not logged is locked, what the model
/// does not have is left out, and one line says so.
///
///     const ServedModel served = serve_joints(model, logged_joints(files), {.lock =
///     {"head=0.2"}}); auto source = recordings_in_files(served.model, files);   // the other
///     columns are left out

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <diffnea/model/model.hpp>
#include <diffnea/recording/csv.hpp>

namespace diffnea {

/// Joints as a user chooses them.
struct JointChoice {
  std::vector<std::string> joints;  ///< these alone move; empty: those that are logged
  std::vector<std::string> lock;    ///< JOINT or JOINT=VALUE [rad, m]: does not move
};

/// Where a logged joint was.
struct LoggedPosition {
  double median = 0.0;   ///< middle of all rows [rad, m]
  double lowest = 0.0;   ///< least of all rows [rad, m]
  double highest = 0.0;  ///< largest of all rows [rad, m]
};

/// A model whose moving joints are those of the recordings.
struct ServedModel {
  Model model;       ///< with the others locked
  std::string note;  ///< joints locked, where, and columns left out; empty: none
};

/// Locks the joints that are not logged, and those that the choice does not let move: at the stated
/// position; else, where they are logged, at the median of their column; else where the model rests
/// (resting_position).
/// @param logged    joints of the recordings; empty: none is (a ball alone), nothing is locked
/// @param position  of a logged joint; may be null
/// @throws ModelError if the choice names a joint that the model does not have, or a position
///         beyond its limits
/// @throws DataError if the recordings lack joints of the model and have others that it does not
///         have (a name may be spelt in two ways), or a passive joint, which nothing holds, is not
///         logged: the message names both sets and the options
ServedModel serve_joints(
    const Model& model, const std::vector<std::string>& logged, const JointChoice& choice,
    const std::function<std::optional<LoggedPosition>(const std::string&)>& position = nullptr);

/// The same of files, which must have the same joints of the model.
/// @param options  of each file; one for all if its size is 1
/// @throws DataError also naming the file whose joints are not the first one's
ServedModel serve_joints(const Model& model, const std::vector<std::filesystem::path>& files,
                         const std::vector<ReadOptions>& options, const JointChoice& choice);

/// The same of recordings in memory.
ServedModel serve_joints(const Model& model, const std::vector<Recording>& recordings,
                         const JointChoice& choice);

}  // namespace diffnea
