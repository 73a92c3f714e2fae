#pragma once
/// Learned policies and unfinished searches as files (docs/schema/policy.md).

#include <filesystem>
#include <optional>
#include <string>

#include <diffnea/experiment/ball_in_cup.hpp>

namespace diffnea {

/// Schema "diffnea/policy/1": primitive, Gaussian, start, controller, and how it was learned.
std::string policy_json(const LearnedPolicy& policy);
/// @throws FileError
void write_policy(const LearnedPolicy& policy, const std::filesystem::path& path);
/// @throws FileError; ModelError naming file and key
LearnedPolicy read_policy(const std::filesystem::path& path);

/// "policy_<seed>.json": how a run's folder names it.
std::string policy_file_name(std::uint64_t seed);
/// `recording_<seed>.csv`: what sensors saw of it.
std::string recording_file_name(std::uint64_t seed);

/// What a search depends on, as a checksum: model, controller, options but for when it stops. Two
/// runs with the same one and the same seed are the same, as long as both go on.
std::string fingerprint(const BallInCup& task);

/// Schema "diffnea/checkpoint/1": a search between two iterations, every number exact.
/// @throws FileError, also when the disk is full: what was there before stays
void write_checkpoint(const SearchState& state, const std::string& fingerprint,
                      const std::filesystem::path& path);
/// Goes on from a checkpoint.
/// @param first  the search before its first iteration (first_search)
/// @return nothing if there is no such file
/// @throws FileError; ModelError if it is of another task, or cannot be read
std::optional<SearchState> read_checkpoint(const std::filesystem::path& path,
                                           const std::string& fingerprint, const Ereps& first);

}  // namespace diffnea
