#pragma once
/// Cases of a robot that swings a ball on a string: what is hidden acts on ball, string or camera.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace hidden {

struct BallOptions {
  double smallest = 0.3, largest = 3.0;  ///< size of the effect over its unit, drawn (logarithm)
  double duration = 40.0;                ///< of either recording [s]
  double camera_noise = 1.5e-3;          ///< along one axis [m]
};

/// "ball_none" and "ball_" + effect.
std::vector<std::string> ball_families();

/// Writes seen/model.json, train.csv, test.csv and truth/truth.json.
/// @throws std::invalid_argument for a family that there is not
void generate_ball(std::uint64_t seed, const std::string& family, const BallOptions& options,
                   const std::filesystem::path& folder);

}  // namespace hidden
