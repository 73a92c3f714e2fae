#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <dlfcn.h>
#include <map>
#include <numbers>

#include <diffnea/core/error.hpp>
#include <diffnea/core/parallel.hpp>
#include <diffnea/effects/bound_effect.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/worlds/world.hpp>

#include "core/c_numbers.hpp"
#include "io/json.hpp"
#include "io/xml.hpp"
#include "worlds/string_chain.hpp"

namespace diffnea {
namespace {

struct WorldKey {
  const char *name, *meaning;
};
constexpr WorldKey kWorldKeys[] = {
    {"perturb",
     "how far the robot is from its description: none, A (default), B (about twice A), C (B with "
     "cables that give, drives that stick and act late and with noise, a late camera), or "
     "PATH.json, a file of ranges"},
    {"seed",
     "of the perturbation, and of the noise with the command's seed; default: that of the command "
     "alone"},
    {"noise", "factor on the noise of the sensors, default 1"},
    {"effect",
     "that the robot has and its description lacks, once for each: "
     "effect=NAME@WHERE:PARAMETER=VALUE+PARAMETER=VALUE, as in "
     "effect=cogging@arm:sine=0.002+cycles=8 (see `diffnea effects`); in place of what perturb "
     "drew of it"},
    {"repetitions",
     "of the motion, each from rest: positions, torques and ball are their means, row by row"},
    {"ball",
     "what the ball hangs on: tendon (default), without mass, or chain, capsules that touch cup "
     "and forearm; the ball is seen at 100 Hz with 1.5 mm of noise; none: the robot without it"},
    {"rope",
     "of a chain: heavy (2.25 g, hinges 1e-4 N*m*s/rad), mid (1.2 g, 5e-5; default), light (0.5 g, "
     "1e-5), none (a tendon)"},
    {"string",
     "length of the ball's string in the world [m], from where it is tied to the ball's centre; "
     "default: the description's, changed by perturb"},
    {"nominal_string",
     "length of the ball's string that perturb changes [m]; default: the "
     "description's"},
    {"tilt",
     "of the cup about where the string is tied: the largest that is drawn [rad]; default: that of "
     "perturb, A 0.035, B and C 0.07"}};

/// All of them are kept until they are averaged.
constexpr int kMostRepetitions = 10000;

std::string key_names() {
  std::string out;
  for (const WorldKey& key : kWorldKeys) out += (out.empty() ? "" : ", ") + std::string(key.name);
  return out;
}

template <class Number>
Number number(const std::string& world, const std::string& key, const std::string& text) {
  Number x{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), x);
  if (text.empty() || error != std::errc() || end != text.data() + text.size())
    throw Error("world '" + world + "': " + key + " = '" + text + "' is not a number it can take");
  return x;
}

/// NAME@WHERE:PARAMETER=VALUE+PARAMETER=VALUE; names and places are checked when the robot is made.
EffectSpec effect(const std::string& world, const std::string& text) {
  const std::size_t at = text.find('@'), colon = text.find(':');
  if (at == text.npos || colon == text.npos || colon < at)
    throw Error("world '" + world + "': effect = '" + text +
                "'; expected NAME@WHERE:PARAMETER=VALUE+PARAMETER=VALUE");
  EffectSpec out{text.substr(0, at), text.substr(at + 1, colon - at - 1), {}};
  for (std::string rest = text.substr(colon + 1); !rest.empty();) {
    std::size_t plus = rest.find('+');  // before a name: 1e+3 has one, too
    while (plus != rest.npos && plus + 1 < rest.size() &&
           !std::isalpha(static_cast<unsigned char>(rest[plus + 1])))
      plus = rest.find('+', plus + 1);
    const std::string part = rest.substr(0, plus);
    rest = plus == rest.npos ? "" : rest.substr(plus + 1);
    const std::size_t equals = part.find('=');
    const std::string name = part.substr(0, equals),
                      value = equals == part.npos ? "" : part.substr(equals + 1);
    out.parameters.push_back({name, number<double>(world, "effect: " + name, value), ""});
  }
  return out;
}

Perturbation perturbation(const std::string& world, const std::string& name) {
  try {
    return find_surrogate(name);
  } catch (const Error& e) {
    throw Error("world '" + world + "': " + e.what());
  }
}

template <class T>
T choice(const std::string& world, const std::string& key, const std::string& value,
         const std::vector<std::pair<std::string, T>>& choices) {
  std::string names;
  for (const auto& [name, meaning] : choices) {
    if (name == value) return meaning;
    names += (names.empty() ? "" : ", ") + name;
  }
  throw Error("world '" + world + "': " + key + " = '" + value + "'; choices: " + names);
}

}  // namespace

WorldSpec parse_world(const std::string& text) {
  const std::size_t colon = text.find(':');
  if (text.substr(0, colon) != "mujoco" || colon == text.npos)
    throw Error("world '" + text + "': expected mujoco:NAME[,key=value…]");
  WorldSpec out;
  std::string perturb = "A";
  std::string rest = text.substr(colon + 1), name;
  std::optional<std::string> ball;
  std::optional<std::optional<Rope>> rope;
  std::optional<double> tilt;
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
      perturb = value;
    else if (key == "seed")
      out.seed = number<std::uint64_t>(text, key, value);
    else if (key == "noise")
      out.noise = number<double>(text, key, value);
    else if (key == "effect")
      out.effects.push_back(effect(text, value));
    else if (key == "repetitions")
      out.repetitions = number<int>(text, key, value);
    else if (key == "string")
      out.string = number<double>(text, key, value);
    else if (key == "tilt")
      tilt = number<double>(text, key, value);
    else if (key == "ball")
      ball = choice<std::string>(text, key, value,
                                 {{"tendon", "tendon"}, {"chain", "chain"}, {"none", "none"}});
    else if (key == "nominal_string")
      out.nominal_string = number<double>(text, key, value);
    else if (key == "rope")
      rope = choice<std::optional<Rope>>(text, key, value,
                                         {{"heavy", Rope{2.25e-3, 1e-4}},
                                          {"mid", Rope{1.2e-3, 5e-5}},
                                          {"light", Rope{0.5e-3, 1e-5}},
                                          {"none", std::nullopt}});
    else
      throw Error("world '" + text + "': unknown key '" + key + "'; keys: " + key_names());
  }
  out.perturbation = perturbation(text, perturb);
  out.has_ball = ball != "none";
  if (!out.has_ball && rope) throw Error("world '" + text + "': ball=none has no rope");
  if (ball && rope && (ball == "chain") != rope->has_value())
    throw Error("world '" + text + "': a chain has a rope with mass, a tendon rope=none");
  if (rope)
    out.rope = *rope;
  else if (ball == "chain")
    out.rope = Rope{};
  if (tilt) out.perturbation.cup_tilt = *tilt;
  if (!(out.perturbation.cup_tilt >= 0.0 && std::isfinite(out.perturbation.cup_tilt)))
    throw Error("world '" + text + "': tilt must not be negative, nor infinite [rad]");
  for (const std::optional<double>& length : {out.string, out.nominal_string})
    if (length && !(*length > 0.0 && std::isfinite(*length)))
      throw Error("world '" + text + "': string and nominal_string must be positive [m]");
  if (out.repetitions < 1 || out.repetitions > kMostRepetitions)
    throw Error("world '" + text + "': repetitions must be 1 or more, at most " +
                std::to_string(kMostRepetitions));
  if (!(out.noise >= 0.0 && std::isfinite(out.noise)))
    throw Error("world '" + text + "': noise must not be negative, nor infinite");
  out.mjcf = find_model_file(name, {".xml"});
  return out;
}

namespace {

/// Six digits at most: 0.055, 2.25, 1e-05.
std::string figure(double x) {
  char text[32];
  detail::print(text, sizeof text, "%g", x);
  return text;
}

/// "-8…+20" of relative changes, in percent.
std::string percent_range(double low, double high) {
  char text[64];
  detail::print(text, sizeof text, "%+g…%+g %%", 100.0 * low, 100.0 * high);
  return text;
}

}  // namespace

std::vector<std::string> differences(const WorldSpec& world) {
  const Perturbation& p = world.perturbation;
  std::vector<std::string> out;
  const auto add_change = [&](const char* what, double low, double high) {
    if (low != 0.0 || high != 0.0) out.push_back(what + percent_range(low, high));
  };
  const auto add_range = [&](const char* what, double low, double high, const char* rest) {
    if (high != 0.0) out.push_back(what + figure(low) + "…" + figure(high) + rest);
  };
  const auto add_most = [&](const char* what, double most, const char* rest) {
    if (most != 0.0) out.push_back(what + figure(most) + rest);
  };
  add_change("masses ", p.mass_low, p.mass_high);
  add_change("inertias ", p.inertia_low, p.inertia_high);
  add_most("centres of mass up to ", 1e3 * p.com, " mm off");
  add_range("Coulomb friction +", p.coulomb_low, p.coulomb_high, " N·m");
  add_range("viscous friction +", p.viscous_low, p.viscous_high, " N·m·s/rad");
  add_range("rotor inertias +", p.armature_low, p.armature_high, " kg·m²");
  add_range("elastic drives, ", 1e3 * p.wind_up_low, 1e3 * p.wind_up_high,
            " mrad at the effort limit");
  add_range("stiction ", 100.0 * p.stiction_low, 100.0 * p.stiction_high, " % above Coulomb");
  add_range("drives ", 1e3 * p.delay_low, 1e3 * p.delay_high, " ms late");
  add_most("torque noise of ", p.actuation_noise, " N·m");
  if (world.has_ball) {
    add_range("camera ", 1e3 * p.camera_delay_low, 1e3 * p.camera_delay_high, " ms late");
    add_most("string tied up to ", 1e3 * p.attachment, " mm elsewhere");
    if (!world.string) add_most("string length up to ", 1e3 * p.string, " mm off");
    add_most("cup tilted by up to ", std::round(1800.0 / std::numbers::pi * p.cup_tilt) / 10.0,
             "°");
  }
  for (const EffectSpec& effect : world.effects)
    out.push_back(effect.effect + " at " + effect.where);
  if (world.rope)
    out.push_back("a rope of " + figure(1e3 * world.rope->mass) +
                  " g in place of a massless string");
  return out;
}

namespace {

constexpr std::uint64_t kOfNumber = 0xd1b54a32d192ed03ULL;  ///< parts seeds of other numbers

/// Deviation of two noises; a negative one stays for those who refuse it.
double together(double asked, double own) { return asked < 0.0 ? asked : std::hypot(asked, own); }

/// The robot that a world's seed gives, and its document.
struct DrawnWorld {
  Model truth;
  std::string document;
};

/// The document in which nothing touches: legs in the air, a trunk that is held.
std::string without_contacts(const std::string& mjcf, const std::string& where) {
  const std::unique_ptr<io::XmlDocument> document = io::parse_xml(mjcf, where);
  io::child(io::child(*document->RootElement(), "option"), "flag")
      .SetAttribute("contact", "disable");
  return io::xml_text(*document);
}

/// @param floats  whether the base of the controller's robot does; else the world's is held
DrawnWorld draw(const WorldSpec& world, std::uint64_t seed, bool floats) {
  Model nominal = read_model(world.mjcf);
  const bool in_air = nominal.free_base;
  const ModelReading reading{.fix_base = in_air && !floats};
  if (reading.fix_base) nominal = read_model(world.mjcf, reading);
  if (floats && !in_air)
    throw ModelError(nominal.source +
                     ": its base is fixed, and that of the model floats; expected an MJCF with a "
                     "freejoint, or --fix-base (fix_base=True)");
  const bool has_string = nominal.ball && nominal.ball->string;
  if ((world.rope || world.string || world.nominal_string || !world.has_ball) && !has_string)
    throw ModelError(nominal.source +
                     ": the world has no ball on a string (keys ball, rope, string, "
                     "nominal_string); a free body 'ball' on a spatial tendon 'string' is one, as "
                     "in wam4_ball");
  if (world.nominal_string) nominal.ball->string->length = *world.nominal_string;
  DrawnWorld out{.truth = perturbed(nominal, world.perturbation, seed), .document = {}};
  for (const EffectSpec& spec : world.effects) {
    const EffectSpec whole = to_spec(bind(spec, out.truth, {0}));  // units, and what was not given
    std::erase_if(out.truth.effects, [&](const EffectSpec& e) {
      return e.effect == whole.effect && e.where == whole.where;
    });
    out.truth.effects.push_back(whole);
  }
  if (world.string) out.truth.ball->string->length = *world.string;
  out.document = read_mjcf(world.mjcf, reading);
  if (in_air) out.document = without_contacts(out.document, nominal.source);
  if (world.rope) out.document = io::with_chain(out.document, nominal, out.truth, *world.rope);
  if (!world.has_ball) {
    out.document = io::without_ball(out.document, out.truth);
    out.truth.ball.reset();
    std::erase_if(out.truth.effects, [](const EffectSpec& e) { return e.where == "camera"; });
  }
  out.document = with_rotors(out.document, out.truth);
  return out;
}

}  // namespace

WorldRecording record_in_world(const WorldSpec& world, const Model& controller,
                               const Trajectory& trajectory, RecordOptions options,
                               std::uint64_t seed, int threads,
                               std::optional<std::uint64_t> number) {
  require_fixed_base("a recording at rest", controller);
  options.seed = world.seed.value_or(seed);
  const std::uint64_t noise = number.value_or(world.seed ? seed : 0);
  options.actuation_noise = together(options.actuation_noise, world.perturbation.actuation_noise);
  DrawnWorld drawn = draw(world, options.seed, false);
  WorldRecording out{.result = {}, .truth = std::move(drawn.truth)};
  std::vector<SimulatedRecording> repetitions(static_cast<std::size_t>(world.repetitions));
  parallel_for(
      repetitions.size(), static_cast<std::size_t>(threads), [&](std::size_t k, std::size_t) {
        RecordOptions own = options;  // other noise; Rng tells neighbouring seeds apart
        own.seed += k * 0x9e3779b97f4a7c15ULL + noise * kOfNumber;
        repetitions[k] = record_in_mujoco(drawn.document, out.truth, controller, trajectory, own);
      });
  out.result = averaged(repetitions);
  return out;
}

WorldFlights record_flights_in_world(const WorldSpec& world, const Model& controller,
                                     const Trajectory& trajectory, RecordOptions options,
                                     std::uint64_t seed) {
  if (world.repetitions > 1)
    throw Error("world 'mujoco:" + world.mjcf.string() +
                "': repetitions of a robot that floats cannot be averaged, each flies elsewhere; "
                "leave them out");
  options.seed = world.seed.value_or(seed);
  options.actuation_noise = together(options.actuation_noise, world.perturbation.actuation_noise);
  DrawnWorld drawn = draw(world, options.seed, controller.free_base);
  if (world.seed) options.seed += seed * kOfNumber;
  WorldFlights out{.flights = {}, .truth = std::move(drawn.truth)};
  out.flights = record_flights(drawn.document, out.truth, controller, trajectory, options);
  return out;
}

std::unique_ptr<Simulator> make_simulator(const WorldSpec& world, const Model& controller,
                                          MujocoSimulatorOptions options, std::uint64_t seed,
                                          Model* truth) {
  const DrawnWorld drawn = draw(world, world.seed.value_or(seed), controller.free_base);
  if (truth) *truth = drawn.truth;
  options.torque_noise = together(options.torque_noise, world.perturbation.actuation_noise);
  return std::make_unique<MujocoSimulator>(drawn.document, drawn.truth, controller, options);
}

namespace {

/// share/diffnea/models in a folder above a file: of bin/diffnea, of a wheel's module and of the
/// command that a repaired wheel keeps beside it.
void add_models_above(const std::filesystem::path& file, std::vector<std::filesystem::path>& out) {
  std::error_code ignored;
  for (std::filesystem::path folder = file.parent_path(); folder.has_relative_path();
       folder = folder.parent_path()) {
    const std::filesystem::path models = folder / "share" / "diffnea" / "models";
    if (!std::filesystem::is_directory(models, ignored)) continue;
    out.push_back(models);
    return;
  }
}

}  // namespace

std::vector<std::filesystem::path> model_folders() {
  std::vector<std::filesystem::path> out;
  if (const char* folder = std::getenv("DIFFNEA_MODELS"); folder && *folder)
    out.emplace_back(folder);
  std::error_code error;  // an installation that was moved: above the command, or the module
  add_models_above(std::filesystem::read_symlink("/proc/self/exe", error), out);
  Dl_info self;
  if (dladdr(reinterpret_cast<const void*>(&model_folders), &self) != 0 && self.dli_fname)
    add_models_above(std::filesystem::canonical(self.dli_fname, error), out);
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
      if (std::ranges::find(extensions, it->path().extension().string()) != extensions.end() &&
          !it->path().stem().string().starts_with("surrogate_"))  // ranges, no robots
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
  out += "\nrobots that perturb= draws\n";
  for (const auto& [name, path] : list_surrogates())
    out += "  " + read_surrogate(path).summary + "  " + path.string() + "\n";
  return out;
}

std::string worlds_json() {
  io::Json worlds = io::Json::array(), keys = io::Json::array();
  for (const auto& [name, path] : list_models({".xml"}))
    worlds.push_back({{"world", "mujoco:" + name}, {"file", path.string()}});
  for (const WorldKey& key : kWorldKeys)
    keys.push_back({{"key", key.name}, {"meaning", key.meaning}});
  io::Json surrogates = io::Json::array();
  for (const auto& [name, path] : list_surrogates())
    surrogates.push_back(
        {{"perturb", name}, {"summary", read_surrogate(path).summary}, {"file", path.string()}});
  const io::Json out{{"schema", "diffnea/worlds/1"},
                     {"worlds", worlds},
                     {"keys", keys},
                     {"surrogates", surrogates}};
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
