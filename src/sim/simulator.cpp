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

std::vector<std::string> channel_names(const std::vector<std::string>& joints, bool ball, bool cup,
                                       bool phase) {
  std::vector<std::string> out;
  for (const char* kind : {"q_", "qd_"})
    for (const std::string& joint : joints) out.push_back(kind + joint);
  const auto add = [&](const std::string& what) {
    for (const char* axis : {"x", "y", "z"}) out.push_back(what + axis);
  };
  if (ball) add("ball_");
  if (ball) add("ball_v");
  if (cup) add("cup_");
  if (cup) add("axis_");
  if (phase) out.emplace_back("phase");
  return out;
}

}  // namespace diffnea
