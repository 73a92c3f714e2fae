#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/sim/simulator.hpp>

namespace diffnea {

int find_channel(const Simulator& simulator, const std::string& name) {
  const std::vector<std::string>& channels = simulator.channels();
  const auto it = std::ranges::find(channels, name);
  if (it != channels.end()) return static_cast<int>(it - channels.begin());
  std::string known;
  for (const std::string& c : channels) known += (known.empty() ? "" : ", ") + c;
  throw Error("simulator: it shows no channel '" + name + "'; channels: " + known);
}

}  // namespace diffnea
