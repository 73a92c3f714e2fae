/// Second generator of recordings that hide an effect: other machines, motions, drives and sensors
/// than the first, the same files.
///
///   hidden_effects_rigs --seed 1 --family backlash -o case/
///
/// case/seen/: model.xml or model.urdf (nominal), train.csv, test.csv, their .json;
/// case/truth/truth.json. Shares no code with the library, none with the first generator.

#include <algorithm>
#include <exception>
#include <filesystem>
#include <iostream>

#include <CLI/CLI.hpp>

#include "evidence.hpp"
#include "log.hpp"

namespace rigs {
namespace {

/// Draws of a case until what is hidden can be seen.
constexpr int kAttempts = 6;
/// Where the evidence of an effect is told to begin.
constexpr double kVisible = 30.0;

std::vector<double> list(const Eigen::VectorXd& x) { return {x.data(), x.data() + x.size()}; }

struct Made {
  Case c;
  Recording train, test;
  std::vector<Evidence> shown;
};

/// Factor on an effect, so that it has its size in the whole recording: 1 if it nearly
/// has.
double correction(const Case& c, const Recording& train) {
  const Effect& e = c.effects[0];
  const Eigen::VectorXd share = effect_share(c, train);
  double size = 0.0;
  for (const int j : e.joints) size = std::max(size, share[j]);
  const double by = c.targets[0] / std::max(size, 1e-12);
  if (by < 0.75) return std::max(by, 0.3);
  return by > 1.4 && e.strength < 0.99 * e.limit ? std::min({by, 2.0, e.limit / e.strength}) : 1.0;
}

/// Records, with less of the effects where the machine cannot bear them.
Made made(Case c, double largest) {
  Made out;
  int corrections = c.effects.size() == 1 && c.kind != "audit" ? 3 : 0;
  for (int i = 0; i < 10; ++i) {
    try {
      out.train = record(c, false);
      const double by = corrections-- > 0 ? correction(c, out.train) : 1.0;
      if (by != 1.0) {
        c.effects[0].strength *= by;
        continue;
      }
      out.test = record(c, true);
      break;
    } catch (const std::runtime_error&) {
      if (i == 9) throw;
      corrections = 0;
      // Another motion bears less of an effect, or a slower controller.
      c.rig.control.bandwidth *= 0.85;
      for (Effect& e : c.effects) e.strength *= 0.6;
    }
  }
  if (c.kind != "audit" && effect_share(c, out.train).maxCoeff() > 2.0 * largest)
    throw std::runtime_error("effects are larger than was asked for");
  out.shown = evidence(c, out.train);
  if (c.kind == "named" && std::ranges::all_of(out.shown, [](const Evidence& e) {
        return e.visible_share < 0.01 && e.expected_lm < kVisible;
      }))
    c.kind = "absorbed";
  out.c = std::move(c);
  return out;
}

bool can_be_seen(const Made& m) {
  if (m.c.kind == "none" || m.c.kind == "audit" || m.c.family == "absorbed") return true;
  return std::ranges::all_of(m.shown, [](const Evidence& e) { return e.reachable_lm >= kVisible; });
}

Json truth_of(const Made& m) {
  const Case& c = m.c;
  Json effects = Json::array();
  for (std::size_t i = 0; i < c.effects.size(); ++i) {
    const Effect& h = c.effects[i];
    const Evidence& e = m.shown[i];
    Json rivals = Json::array();
    for (const Rival& r : e.rivals)
      rivals.push_back({{"effects", r.effects}, {"lm_beyond", r.lm_beyond}});
    effects.push_back({{"effect", h.name},
                       {"where", h.where},
                       {"parameters", h.parameters(h.strength)},
                       {"size", e.size},
                       {"raw_lm", e.raw_lm},
                       {"expected_lm", e.expected_lm},
                       {"reachable_lm", e.reachable_lm},
                       {"visible_share", e.visible_share},
                       {"variables", h.variables},
                       {"rivals", rivals}});
  }
  const Sensors& s = c.sensors;
  const Control& control = c.rig.control;
  double seconds = 0.0;
  for (const double run : c.runs) seconds += run;
  const Eigen::VectorXd torque = root_mean_square(at_50_hz(m.train, &Track::mean_tau));
  std::vector<Json> joints;
  for (const Joint& joint : c.rig.arm.joints)
    joints.push_back({{"joint", joint.name},
                      {"coulomb", joint.coulomb},
                      {"viscous", joint.viscous},
                      {"rotor", joint.rotor}});
  const Eigen::VectorXd inertial = inertial_parameters(c.rig.arm);
  return {{"schema", "diffnea/hidden_effects/truth/1"},
          {"generator", "rigs"},
          {"seed", c.seed},
          {"family", c.family},
          {"kind", c.kind},
          {"base", c.base},
          {"robot", c.rig.arm.kind + std::to_string(c.rig.arm.size())},
          {"effects", effects},
          {"effect_share", list(effect_share(c, m.train))},
          {"recording",
           {{"period", c.plan.period},
            {"duration", seconds},
            {"runs", c.runs},
            {"layout", c.layout},
            {"motion", c.plan.kind},
            {"rate", c.rate},
            {"torque_rms", list(torque)},
            {"torque_noise", list(s.torque_noise * torque)},
            {"torque_noise_corner", s.corner},
            {"torque_step", 0.0},
            {"torque_noise_all", list(torque_noise(c, m.train))},
            {"motor_noise", list(c.rig.motor_noise)},
            {"motor_noise_band", c.rig.motor_noise_band},
            {"position_noise", list(s.position_noise)},
            {"position_step", list(s.position_step)},
            {"slow_positions", s.slow_positions},
            {"slow_torques", s.slow_torques},
            {"jitter", s.jitter},
            {"torque_instant", s.middle    ? "middle"
                               : s.centred ? "row"
                                           : "start"},
            {"encoders", c.rig.motor_encoder ? "motor" : "link"}}},
          {"control",
           {{"law", control.computed_torque ? "computed torque" : "cascade"},
            {"rate", control.rate},
            {"bandwidth", control.bandwidth}}},
          {"machine",
           {{"gravity", list(c.rig.arm.gravity)},
            {"joints", joints},
            {"inertial", list(inertial)},
            {"sticking", c.rig.physics.bristle_width > 0.0 ? "bristles" : "sets"}}}};
}

void generate(std::uint64_t seed, const std::string& family, const CaseOptions& options,
              const std::filesystem::path& folder) {
  Made best;
  double seen_best = -1.0;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    try {
      Made m = made(draw_case(seed, attempt, family, options), options.largest);
      double weakest = 1e300;
      for (const Evidence& e : m.shown) weakest = std::min(weakest, e.reachable_lm);
      const bool enough = can_be_seen(m);
      if (weakest > seen_best) {
        seen_best = weakest;
        best = std::move(m);
      }
      if (enough) break;
    } catch (const std::runtime_error& error) {
      if (attempt + 1 == kAttempts && seen_best < 0.0) throw;
    }
  }
  const Made& m = best;
  const std::filesystem::path seen = folder / "seen", truth = folder / "truth";
  std::filesystem::create_directories(seen);
  std::filesystem::create_directories(truth);
  write_text(seen / (m.c.urdf ? "model.urdf" : "model.xml"),
             m.c.urdf ? to_urdf(m.c.nominal) : to_mjcf(m.c.nominal, true));
  const Eigen::VectorXd torque = root_mean_square(at_50_hz(m.train, &Track::mean_tau));
  write_log(seen / "train", m.c, m.train, torque, false);
  write_log(seen / "test", m.c, m.test, torque, true);
  write_text(truth / "truth.json", truth_of(m).dump(1) + "\n");
}

}  // namespace
}  // namespace rigs

int main(int argc, char** argv) {
  CLI::App app{"One case of the second generator of hidden effects."};
  std::uint64_t seed = 0;
  std::string family, folder;
  rigs::CaseOptions options;
  bool list = false;
  app.add_option("--seed", seed, "of everything that is drawn")->capture_default_str();
  app.add_option("--family", family, "what is hidden; drawn if not given");
  app.add_option("--noise", options.noise,
                 "torque noise, share of each joint's torque RMS; 0: drawn")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--smallest", options.smallest,
                 "size of an effect, share of its joint's torque RMS")
      ->check(CLI::Range(1e-5, 0.5))
      ->capture_default_str();
  app.add_option("--largest", options.largest, "the size is drawn between these two")
      ->check(CLI::Range(1e-5, 0.5))
      ->capture_default_str();
  app.add_option("--duration", options.duration, "of a recording in one run [s]; 0: drawn")
      ->check(CLI::Range(0.0, 600.0));
  app.add_flag("!--aperiodic", options.repeats, "motions that never repeat");
  app.add_flag("--list", list, "print the families");
  app.add_option("-o", folder, "folder of the case");
  CLI11_PARSE(app, argc, argv);
  try {
    if (list) {
      for (const std::string& name : rigs::families()) std::cout << name << "\n";
      return 0;
    }
    if (folder.empty()) throw std::invalid_argument("-o is missing: the folder of the case");
    rigs::generate(seed, family, options, folder);
  } catch (const std::exception& error) {
    std::cerr << "hidden_effects_rigs: " << error.what() << "\n";
    return 1;
  }
}
