#pragma once
/// A movement as an animated GIF, where the library that writes them was there (libgif).

#include <filesystem>

#include <diffnea/runs/policy_result.hpp>

namespace diffnea {

/// Whether this build can.
bool can_write_gif();

/// The best success of a transfer, or else the worst failure: arm, cup, string, the ball, and as it
/// was imagined, 25 frames a second. The file appears complete, or not at all.
/// @param run  with figures, as read_transfer_run gives it
/// @return whether there is a file: not if there is nothing to draw, or the build cannot
/// @throws FileError
bool write_movement_gif(const TransferRun& run, const std::filesystem::path& path);

}  // namespace diffnea
