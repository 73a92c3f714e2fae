#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <map>

#include <diffnea/core/error.hpp>
#include <diffnea/io/world.hpp>

#include "io/json.hpp"

namespace diffnea {
namespace {

struct WorldKey {
  const char *name, *meaning;
};
constexpr WorldKey kWorldKeys[] = {
    {"perturb", "how far the robot is from its description: none, A (default) or B, about twice A"},
    {"seed", "of the perturbation and the noise; default: that of the command"},
    {"noise", "factor on the noise of the sensors, default 1"}};

template <class Number>
Number number(const std::string& world, const std::string& key, const std::string& text) {
  Number x{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), x);
  if (text.empty() || error != std::errc() || end != text.data() + text.size())
    throw Error("world '" + world + "': " + key + " = '" + text + "' is not a number it can take");
  return x;
}

Perturbation perturbation(const std::string& world, const std::string& level) {
  static const std::map<std::string, Perturbation> kLevels{
      {"none", {}}, {"A", surrogate_a()}, {"B", surrogate_b()}};
  const auto it = kLevels.find(level);
  if (it == kLevels.end())
    throw Error("world '" + world + "': perturb = '" + level + "'; choices: none, A, B");
  return it->second;
}

}  // namespace

WorldSpec parse_world(const std::string& text) {
  const std::size_t colon = text.find(':');
  if (text.substr(0, colon) != "mujoco" || colon == text.npos)
    throw Error("world '" + text + "': expected mujoco:NAME[,key=value…]");
  WorldSpec out;
  out.perturbation = surrogate_a();
  std::string rest = text.substr(colon + 1), name;
  for (bool first = true; first || !rest.empty(); first = false) {
    const std::size_t comma = rest.find(',');
    const std::string part = rest.substr(0, comma);
    rest = comma == rest.npos ? "" : rest.substr(comma + 1);
    if (first) {
      name = part;
      continue;
    }
    const std::size_t equals = part.find('=');
    const std::string key = part.substr(0, equals),
                      value = equals == part.npos ? "" : part.substr(equals + 1);
    if (key == "perturb")
      out.perturbation = perturbation(text, value);
    else if (key == "seed")
      out.seed = number<std::uint64_t>(text, key, value);
    else if (key == "noise")
      out.noise = number<double>(text, key, value);
    else
      throw Error("world '" + text + "': unknown key '" + key + "'; keys: perturb, seed, noise");
  }
  if (!(out.noise >= 0.0)) throw Error("world '" + text + "': noise must not be negative");
  out.mjcf = find_model_file(name, {".xml"});
  return out;
}

std::vector<std::filesystem::path> model_folders() {
  std::vector<std::filesystem::path> out;
  if (const char* folder = std::getenv("DIFFNEA_MODELS"); folder && *folder)
    out.emplace_back(folder);
  std::error_code error;  // an installation that was moved: beside the command
  const std::filesystem::path command = std::filesystem::read_symlink("/proc/self/exe", error);
  if (!error) out.push_back(command.parent_path().parent_path() / "share" / "diffnea" / "models");
  out.emplace_back(DIFFNEA_INSTALLED_MODELS);
  out.emplace_back(DIFFNEA_SOURCE_MODELS);
  return out;
}

std::map<std::string, std::filesystem::path> list_models(
    const std::vector<std::string>& extensions) {
  std::map<std::string, std::filesystem::path> out;
  std::error_code ignored;
  for (const std::filesystem::path& folder : model_folders())
    for (std::filesystem::directory_iterator it(folder, ignored), end; it != end;
         it.increment(ignored))
      if (std::ranges::find(extensions, it->path().extension().string()) != extensions.end())
        out.emplace(it->path().stem().string(), it->path());
  return out;
}

std::string worlds_text() {
  std::string out = "worlds\n";
  for (const auto& [name, path] : list_models({".xml"}))
    out += "  mujoco:" + name + "  " + path.string() + "\n";
  out += "  mujoco:PATH  an MJCF of your own\n\nkeys, as in mujoco:wam4,perturb=A,seed=3\n";
  for (const WorldKey& key : kWorldKeys)
    out += std::string("  ") + key.name + "  " + key.meaning + "\n";
  return out;
}

std::string worlds_json() {
  io::Json worlds = io::Json::array(), keys = io::Json::array();
  for (const auto& [name, path] : list_models({".xml"}))
    worlds.push_back({{"world", "mujoco:" + name}, {"file", path.string()}});
  for (const WorldKey& key : kWorldKeys)
    keys.push_back({{"key", key.name}, {"meaning", key.meaning}});
  const io::Json out{{"schema", "diffnea/worlds/1"}, {"worlds", worlds}, {"keys", keys}};
  return out.dump(1, ' ', false, io::Json::error_handler_t::replace) + "\n";
}

std::filesystem::path find_model_file(const std::string& name,
                                      const std::vector<std::string>& extensions) {
  std::error_code ignored;
  if (!name.empty() && std::filesystem::is_regular_file(name, ignored)) return name;
  const std::map<std::string, std::filesystem::path> known = list_models(extensions);
  if (const auto it = known.find(name); it != known.end()) return it->second;
  std::string names;
  for (const auto& [k, path] : known) names += (names.empty() ? "" : ", ") + k;
  throw FileError("there is no model '" + name + "'; a path to a file, or one of: " +
                  (names.empty() ? "(none found; set DIFFNEA_MODELS to their folder)" : names));
}

}  // namespace diffnea
