#pragma once
/// Measured recordings that are not part of the project.

#include <cstdlib>
#include <filesystem>

#include <catch2/catch_test_macros.hpp>

namespace diffnea::test {

/// The folder of measured recordings (DIFFNEA_DATA, or ../shared/data beside the project); skips
/// the test if it is not there.
inline std::filesystem::path data_folder() {
  const char* named = std::getenv("DIFFNEA_DATA");
  const std::filesystem::path folder =
      named != nullptr ? std::filesystem::path(named)
                       : std::filesystem::path(DIFFNEA_SOURCE_DIR) / ".." / "shared" / "data";
  if (!std::filesystem::is_directory(folder))
    SKIP("no measured recordings at " << folder << "; DIFFNEA_DATA may name their folder");
  return folder;
}

}  // namespace diffnea::test
