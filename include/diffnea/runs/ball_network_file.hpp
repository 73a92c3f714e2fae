#pragma once
/// Networks of a ball as files (docs/schema/ball_network.md): numbers alone, no code.

#include <filesystem>
#include <memory>
#include <string>

#include <diffnea/effects/ball_network.hpp>

namespace diffnea {

/// How a run's folder names the network that its policies were learned in.
inline constexpr const char* kBallNetworkFile = "ball_network.json";

/// @param where  for messages, and the network's source
/// @throws ModelError naming `where` and the key: schema "diffnea/ball-network/1" is broken, or
///         sizes do not fit one another
BallNetwork ball_network_from_json(const std::string& text, const std::string& where);

/// @throws FileError, and as above
std::shared_ptr<const BallNetwork> read_ball_network(const std::filesystem::path& path);

}  // namespace diffnea
