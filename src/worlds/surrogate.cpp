#include <algorithm>
#include <cctype>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/worlds/surrogate.hpp>
#include <diffnea/worlds/world.hpp>

#include "io/json.hpp"
#include "io/schema.hpp"

namespace diffnea {
namespace {

const char kSchema[] = "diffnea/surrogate/1";
const std::string kPrefix = "surrogate_";

/// Two numbers, ascending, none below `least`.
void take_range(io::JsonObject& object, const char* key, double least, double& low, double& high) {
  const io::Json* value = object.optional(key);
  if (!value) return;
  const std::vector<double> x = io::json_numbers(*value, object.at(key), 2);
  if (!(x[0] >= least) || !(x[0] <= x[1]))
    throw ModelError(object.at(key) + ": got " + value->dump() +
                     ", expected [low, high] with low <= high, none below " +
                     io::Json(least).dump());
  low = x[0];
  high = x[1];
}

void take_most(io::JsonObject& object, const char* key, double& most) {
  most = object.number_or(key, 0.0);
  if (!(most >= 0.0))
    throw ModelError(object.at(key) + ": got " + io::Json(most).dump() +
                     ", expected the largest size, 0 or more");
}

}  // namespace

Surrogate read_surrogate(const std::filesystem::path& path) {
  const io::Json json = io::parse_json(read_text_file(path), path.string());
  io::JsonObject object(json, path.string());
  io::require_schema(object, path.string(), kSchema);
  constexpr double kLost = -0.99;  // of a mass: a link keeps some
  Surrogate out;
  Perturbation& p = out.ranges;
  out.summary = object.string_or("summary", "");
  take_range(object, "mass", kLost, p.mass_low, p.mass_high);
  take_range(object, "inertia", kLost, p.inertia_low, p.inertia_high);
  take_most(object, "com", p.com);
  take_range(object, "coulomb", 0.0, p.coulomb_low, p.coulomb_high);
  take_range(object, "viscous", 0.0, p.viscous_low, p.viscous_high);
  take_range(object, "armature", 0.0, p.armature_low, p.armature_high);
  take_most(object, "attachment", p.attachment);
  take_most(object, "string", p.string);
  take_most(object, "cup_tilt", p.cup_tilt);
  take_range(object, "wind_up", 0.0, p.wind_up_low, p.wind_up_high);
  take_range(object, "spring_relaxation", 0.0, p.relaxation_low, p.relaxation_high);
  take_range(object, "stiction", 0.0, p.stiction_low, p.stiction_high);
  take_range(object, "stribeck_velocity", 0.0, p.stribeck_low, p.stribeck_high);
  take_range(object, "actuation_delay", 0.0, p.delay_low, p.delay_high);
  take_most(object, "actuation_noise", p.actuation_noise);
  take_range(object, "camera_delay", 0.0, p.camera_delay_low, p.camera_delay_high);
  object.finish();
  if (p.stiction_high > 0.0 && !(p.stribeck_low > 0.0))
    throw ModelError(object.at("stribeck_velocity") +
                     ": stiction fades with speed; expected [low, high] above 0 [rad/s]");
  return out;
}

std::map<std::string, std::filesystem::path> list_surrogates() {
  std::map<std::string, std::filesystem::path> out;
  std::error_code ignored;
  for (const std::filesystem::path& folder : model_folders())
    for (std::filesystem::directory_iterator it(folder, ignored), end; it != end;
         it.increment(ignored)) {
      std::string name = it->path().stem().string();
      if (it->path().extension() != ".json" || !name.starts_with(kPrefix)) continue;
      name.erase(0, kPrefix.size());
      std::ranges::transform(name, name.begin(),
                             [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
      out.emplace(name, it->path());
    }
  return out;
}

Perturbation find_surrogate(const std::string& name) {
  if (name == "none") return {};
  const std::map<std::string, std::filesystem::path> known = list_surrogates();
  if (const auto it = known.find(name); it != known.end()) return read_surrogate(it->second).ranges;
  if (name.ends_with(".json")) return read_surrogate(name).ranges;
  std::string names = "none";
  for (const auto& [k, path] : known) names += ", " + k;
  throw Error("perturb = '" + name + "'; choices: " + names +
              ", or the path of a file of ranges, PATH.json");
}

}  // namespace diffnea
