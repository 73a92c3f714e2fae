#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/sidecar.hpp>

#include "core/edit_distance.hpp"
#include "io/json.hpp"
#include "io/schema.hpp"

namespace diffnea {
namespace {

using io::Json;

constexpr const char* kSidecarSchema = "diffnea/recording/1";
constexpr const char* kKeys[] = {"schema",  "torque_side",     "torque_sampling", "period",
                                 "passive", "torque_constant", "controller",      "payload"};

/// Letters that a key may be off a known one, and still be another.
constexpr std::size_t kMisspelt = 2;

/// One of the words, as its index. @throws ModelError that lists them
int choice(const Json& value, const std::string& where, const std::vector<std::string>& words) {
  const std::string word = io::json_string(value, where);
  const auto it = std::ranges::find(words, word);
  if (it != words.end()) return static_cast<int>(it - words.begin());
  std::string list;
  for (const std::string& w : words) list += (list.empty() ? "" : ", ") + w;
  throw ModelError(where + ": got '" + word + "'; choices: " + list);
}

const Json& object(const Json& value, const std::string& where) {
  if (!value.is_object()) throw ModelError(where + ": expected an object with a key per joint");
  return value;
}

template <std::size_t N>
std::array<double, N> numbers(const Json& value, const std::string& where) {
  const std::vector<double> list = io::json_numbers(value, where, static_cast<int>(N));
  std::array<double, N> out;
  std::ranges::copy(list, out.begin());
  return out;
}

HeldBody held_body(const Json& json, const std::string& where) {
  io::JsonObject o(json, where);
  HeldBody out;
  if (const Json* name = o.optional("name")) out.name = io::json_string(*name, o.at("name"));
  if (const Json* place = o.optional("where")) out.where = io::json_string(*place, o.at("where"));
  if (const Json* mass = o.optional("mass")) out.mass = io::json_number(*mass, o.at("mass"));
  if (const Json* com = o.optional("com")) out.com = numbers<3>(*com, o.at("com"));
  if (const Json* I = o.optional("about_com")) out.about_com = numbers<6>(*I, o.at("about_com"));
  o.finish();
  if (out.mass && !(*out.mass >= 0.0)) throw ModelError(o.at("mass") + ": expected 0 kg or more");
  if ((out.com && !out.mass) || (out.about_com && !out.com))
    throw ModelError(where + ": a center of mass needs the mass, an inertia about it needs both");
  return out;
}

Sidecar parse(const Json& json, const std::filesystem::path& path) {
  const std::string file = path.string();
  if (!json.is_object()) throw ModelError(file + ": expected an object");
  Sidecar out;
  out.path = path;
  RecordingInfo& info = out.info;
  const auto at = [&](const char* key) { return file + ": " + key; };
  if (json.contains("torque_side"))
    info.torque_side = choice(json["torque_side"], at("torque_side"), {"motor", "link"}) == 0
                           ? TorqueSide::kMotor
                           : TorqueSide::kLink;
  // A drive holds its torque for a period; a joint torque sensor is sampled with the encoders.
  info.torque_sampling =
      info.torque_side == TorqueSide::kMotor ? TorqueSampling::kHold : TorqueSampling::kInstant;
  if (json.contains("torque_sampling"))
    info.torque_sampling =
        choice(json["torque_sampling"], at("torque_sampling"), {"hold", "instant"}) == 0
            ? TorqueSampling::kHold
            : TorqueSampling::kInstant;
  if (json.contains("period")) {
    info.period = io::json_number(json["period"], at("period"));
    constexpr double kLongest = 1e9;  // [s]
    if (!(info.period >= 0.0 && info.period <= kLongest))
      throw ModelError(at("period") + ": expected a time of 0 s or more, at most 1e9 s");
  }
  if (json.contains("passive"))
    for (const Json& joint : io::json_array(json["passive"], at("passive")))
      info.passive.push_back(io::json_string(joint, at("passive")));
  if (json.contains("torque_constant"))
    for (const auto& [joint, value] :
         object(json["torque_constant"], at("torque_constant")).items())
      info.torque_constant.emplace_back(
          joint, io::json_number(value, at("torque_constant") + "." + joint));
  if (json.contains("controller"))
    for (const auto& [joint, values] : object(json["controller"], at("controller")).items())
      for (const auto& [name, value] : object(values, at("controller") + "." + joint).items())
        info.controller.push_back(
            {joint, name, io::json_number(value, at("controller") + "." + joint + "." + name)});
  if (json.contains("payload")) info.payload = held_body(json["payload"], at("payload"));
  for (const auto& [key, value] : json.items()) {
    if (std::ranges::find(kKeys, key) != std::end(kKeys)) continue;
    for (const char* known : kKeys)
      if (edit_distance(key, known) <= kMisspelt)
        throw ModelError(file + ": got the key '" + key + "'; did you mean '" + known + "'?");
    out.notes.push_back(file + ": key '" + key + "' is not of the format and was not used");
  }
  return out;
}

/// Where a sidecar may lie: the first that is one is read.
std::vector<std::filesystem::path> places(const std::filesystem::path& data) {
  std::filesystem::path beside = data, behind = data;
  beside.replace_extension(".json");
  behind += ".json";
  if (beside == data) return {behind};
  return {behind, beside};
}

/// Whether a file, which is JSON or a folder, is what write_sidecar leaves.
bool is_ours(const std::filesystem::path& path) {
  if (!std::filesystem::is_regular_file(path)) return false;
  const Json json = io::parse_json(read_text_file(path), path.string());
  return json.is_object() && json.contains("schema") && json["schema"] == kSidecarSchema;
}

Json to_json(const RecordingInfo& info) {
  Json json;
  json["schema"] = kSidecarSchema;
  json["torque_side"] = info.torque_side == TorqueSide::kMotor ? "motor" : "link";
  json["torque_sampling"] = info.torque_sampling == TorqueSampling::kHold ? "hold" : "instant";
  if (info.period > 0.0) json["period"] = info.period;
  if (!info.passive.empty()) json["passive"] = info.passive;
  for (const auto& [joint, value] : info.torque_constant) json["torque_constant"][joint] = value;
  for (const JointValue& c : info.controller) json["controller"][c.joint][c.name] = c.value;
  if (const std::optional<HeldBody>& body = info.payload) {
    Json& out = json["payload"] = {{"where", body->where}};
    if (!body->name.empty()) out["name"] = body->name;
    if (body->mass) out["mass"] = *body->mass;
    if (body->com) out["com"] = *body->com;
    if (body->about_com) out["about_com"] = *body->about_com;
  }
  return json;
}

}  // namespace

std::optional<Sidecar> read_sidecar(const std::filesystem::path& data) {
  for (const std::filesystem::path& path : places(data)) {
    if (!std::filesystem::is_regular_file(path)) continue;
    try {
      const Json json = io::parse_json(read_text_file(path), path.string());
      if (json.is_object() && json.contains("schema") && json["schema"] != kSidecarSchema) {
        io::JsonObject root(json, path.string());
        if (json["schema"].is_string() && io::is_newer(root.string("schema"), kSidecarSchema))
          io::require_schema(root, path.string(), kSidecarSchema);
        continue;  // of something else
      }
      return parse(json, path);
    } catch (const ModelError& error) {
      throw DataError(error.what());
    }
  }
  return std::nullopt;
}

ReadOptions with_sidecar(const std::filesystem::path& data, ReadOptions options) {
  const std::optional<Sidecar> sidecar = read_sidecar(data);
  if (!sidecar) return options;
  std::vector<std::string> passive = sidecar->info.passive;
  for (const std::string& joint : options.info.passive)
    if (std::ranges::find(passive, joint) == passive.end()) passive.push_back(joint);
  options.info = sidecar->info;
  options.info.passive = passive;
  return options;
}

std::filesystem::path sidecar_path(const std::filesystem::path& data) {
  const std::optional<Sidecar> read = read_sidecar(data);
  std::filesystem::path path = read ? read->path : places(data).back();
  if (std::filesystem::exists(path) && !is_ours(path))
    throw FileError(path.string() +
                    ": was not left by diffnea with a recording, and what the columns of " +
                    data.filename().string() +
                    " cannot hold would replace it; choose another name for the recording, or "
                    "move that file");
  return path;
}

std::string sidecar_difference(const RecordingInfo& a, const RecordingInfo& b) {
  const Json x = to_json(a), y = to_json(b);
  for (const char* key : kKeys)
    if (x.value(key, Json()) != y.value(key, Json())) return key;
  return "";
}

void write_sidecar(const RecordingInfo& info, const std::filesystem::path& data) {
  write_file_atomically(sidecar_path(data), to_json(info).dump(2) + "\n");
}

}  // namespace diffnea
