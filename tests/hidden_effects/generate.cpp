/// Writes one case of the study of hidden effects: a recording as a robot would give it, whose
/// model lacks an effect, and apart from that the truth.
///
///   hidden_effects_generate --seed 1 --family coulomb_friction -o case/
///
/// case/seen/: model.xml (nominal), train.csv, test.csv, their .json; case/truth/truth.json.
/// Of the families ball_*: model.json, and no .json of the recordings.
/// Independent of what it tests: MuJoCo's dynamics, formulas of its own.

#include <exception>
#include <filesystem>
#include <iostream>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "ball.hpp"
#include "evidence.hpp"
#include "sensors.hpp"

namespace hidden {
namespace {

Json truth_of(const Case& c, const Series& train) {
  Json effects = Json::array();
  const std::vector<Evidence> shown = evidence(c, train);
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const Mechanism& h = c.world.hidden[i];
    const Evidence& e = shown[i];
    Json rivals = Json::array();
    for (const Rival& r : e.rivals)
      rivals.push_back({{"effects", r.effects}, {"lm_beyond", r.lm_beyond}});
    effects.push_back({{"effect", h.effect},
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
  const Eigen::VectorXd torque = rms(train.tau);
  const auto list = [](const Eigen::VectorXd& v) {
    return std::vector<double>(v.data(), v.data() + v.size());
  };
  return {{"schema", "diffnea/hidden_effects/truth/1"},
          {"seed", c.seed},
          {"family", c.family},
          {"kind", c.kind},
          {"base", c.base},
          {"robot", c.world.robot.name},
          {"effects", effects},
          {"effect_share", list(effect_share(c.world, train, c.rate))},
          {"recording",
           {{"period", c.repeats ? c.period : 0.0},
            {"duration", c.duration},
            {"rate", c.rate},
            {"torque_rms", list(torque)},
            {"torque_noise", list(c.sensors.torque_noise * torque)},
            {"torque_noise_corner", c.sensors.corner},
            {"torque_step", c.sensors.torque_step},
            {"position_noise", list(c.sensors.position_noise)},
            {"position_step", list(c.sensors.position_step)}}}};
}

struct Recorded {
  Series series;
  Eigen::MatrixXd position_noise;
  Rng noise;  ///< for the torques, after the positions
};

/// A motion for the first recording in place of a drawn one.
struct Given {
  std::string file;
  double period = 10.0;  ///< [s]
};

Recorded record(const Case& c, bool is_test, const Given& given) {
  Rng noise(c.seed, c.stream + (is_test ? kTestNoise : kTrainNoise));
  const Motion motion =
      given.file.empty() || is_test
          ? Motion(c.world.robot, c.period,
                   Rng(c.seed, c.stream + (is_test ? kTestMotion : kTrainMotion)), c.repeats)
          : Motion(c.world.robot, given.period, given.file);
  SimulationOptions o;
  o.rate = c.rate;
  o.duration = c.duration;
  o.position_noise = draw_position_noise(c, noise);
  Series series = simulate(c.world, motion, o);
  return {std::move(series), std::move(o.position_noise), noise};
}

void generate(std::uint64_t seed, const std::string& family, const CaseOptions& options,
              const Given& given, const std::filesystem::path& folder) {
  Case c = draw_case(seed, family, options);
  std::vector<Recorded> recorded;
  // An effect that was scaled on one motion can be too much for the controller on another.
  for (int attempt = 0; recorded.size() < 2; ++attempt) {
    recorded.clear();
    try {
      for (const bool is_test : {false, true}) recorded.push_back(record(c, is_test, given));
    } catch (const std::runtime_error&) {
      if (attempt == 6 || c.world.hidden.empty()) throw;
      for (Mechanism& h : c.world.hidden) h.strength *= 0.6;
    }
  }
  const std::filesystem::path seen = folder / "seen", truth = folder / "truth";
  std::filesystem::create_directories(seen);
  std::filesystem::create_directories(truth);
  write_text(seen / "model.xml", to_mjcf(c.world.nominal, {}, true));
  const Eigen::VectorXd torque_rms = rms(recorded[0].series.tau);
  Case first = c;
  if (!given.file.empty()) first.period = given.period, first.repeats = true;
  for (std::size_t i = 0; i < 2; ++i)
    write_recording(seen / (i == 0 ? "train" : "test"), i == 0 ? first : c, recorded[i].series,
                    recorded[i].position_noise, torque_rms, recorded[i].noise);
  write_text(truth / "truth.json", truth_of(c, recorded[0].series).dump(1) + "\n");
}

}  // namespace
}  // namespace hidden

int main(int argc, char** argv) {
  CLI::App app{"One case of the study of hidden effects."};
  std::uint64_t seed = 0;
  std::string family, folder;
  hidden::CaseOptions options;
  hidden::BallOptions ball;
  hidden::Given given;
  bool list = false;
  app.add_option("--seed", seed, "of everything that is drawn")->capture_default_str();
  app.add_option("--family", family, "what is hidden; drawn if not given");
  app.add_option("--noise", options.noise, "torque noise, share of each joint's torque RMS")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--position-noise", options.position_noise, "factor on the positions' noise")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--smallest", options.smallest,
                 "size of an effect, share of its joint's torque RMS")
      ->check(CLI::Range(1e-5, 0.5))
      ->capture_default_str();
  app.add_option("--largest", options.largest, "the size is drawn between these two")
      ->check(CLI::Range(1e-5, 0.5))
      ->capture_default_str();
  app.add_option("--duration", options.duration, "of either recording [s]")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  app.add_option("--rate", options.rate, "of control and recording [Hz]")
      ->check(CLI::Range(50.0, 5000.0))
      ->capture_default_str();
  app.add_option("--smallest-ball", ball.smallest,
                 "families ball_*: size of the effect over its unit, EFFECTS.md of the design")
      ->check(CLI::Range(1e-3, 1e3))
      ->capture_default_str();
  app.add_option("--largest-ball", ball.largest, "the size is drawn between these two")
      ->check(CLI::Range(1e-3, 1e3))
      ->capture_default_str();
  app.add_option_function<double>(
         "--scale", [&](double size) { ball.smallest = ball.largest = size; },
         "families ball_*: this size over its unit")
      ->check(CLI::Range(1e-3, 1e3));
  app.add_flag("!--aperiodic", options.repeats, "motions that never repeat");
  app.add_option("--motion", given.file,
                 "trajectory file that train.csv follows in place of a drawn motion")
      ->check(CLI::ExistingFile);
  app.add_option("--motion-period", given.period, "of that file [s]")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_flag("--list", list, "print the families");
  app.add_option("-o", folder, "folder of the case");
  CLI11_PARSE(app, argc, argv);
  try {
    if (list) {
      for (const std::string& name : hidden::families()) std::cout << name << "\n";
      for (const std::string& name : hidden::ball_families()) std::cout << name << "\n";
      return 0;
    }
    if (folder.empty()) throw std::invalid_argument("-o is missing: the folder of the case");
    if (!family.starts_with("ball_")) {
      hidden::generate(seed, family, options, given, folder);
    } else {
      if (!given.file.empty())
        throw std::invalid_argument("--motion: the motions of the ball's families are drawn");
      ball.duration = options.duration;
      hidden::generate_ball(seed, family, ball, folder);
    }
  } catch (const std::exception& error) {
    std::cerr << "hidden_effects_generate: " << error.what() << "\n";
    return 1;
  }
}
