#include <cstdio>
#include <optional>

#include <diffnea/excite/design.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/trajectory_file.hpp>
#include <diffnea/runs/simulate_result.hpp>

#include "common.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "progress.hpp"
#include "robots.hpp"

namespace diffnea::apps {
namespace {

struct ExciteOptions {
  CommonOptions common;
  ModelReading reading;
  std::string model, out;
  std::vector<std::string> position, velocity, acceleration, torque;
  DesignOptions design;
};

double number_in(const std::string& text, const std::string& entry) {
  double x = 0.0;
  if (!CLI::detail::lexical_cast(text, x) || !std::isfinite(x))
    throw CLI::ValidationError("got '" + entry + "', where '" + text + "' is no number");
  return x;
}

/// "JOINT=VALUE" or "VALUE" for all joints. @return the joint, empty for all, and the rest
std::pair<std::string, std::string> split(const std::string& entry) {
  const std::size_t at = entry.rfind('=');
  if (at == std::string::npos) return {"", entry};
  return {entry.substr(0, at), entry.substr(at + 1)};
}

std::map<std::string, double> limits(const std::vector<std::string>& entries) {
  std::map<std::string, double> out;
  for (const std::string& entry : entries) {
    const auto [joint, value] = split(entry);
    out[joint] = number_in(value, entry);
  }
  return out;
}

std::map<std::string, std::pair<double, double>> ranges(const std::vector<std::string>& entries) {
  std::map<std::string, std::pair<double, double>> out;
  for (const std::string& entry : entries) {
    const auto [joint, value] = split(entry);
    const std::size_t colon = value.find(':');
    if (colon == std::string::npos)
      throw CLI::ValidationError("got '" + entry + "', expected LOW:HIGH or JOINT=LOW:HIGH");
    out[joint] = {number_in(value.substr(0, colon), entry),
                  number_in(value.substr(colon + 1), entry)};
  }
  return out;
}

void print(const Excitation& e, const std::string& file) {
  std::fprintf(stderr, "%s: %ld rows, %.1f s in periods of %.4g s, %d joints\n", file.c_str(),
               e.trajectory.rows(), e.trajectory.time[e.trajectory.rows() - 1], e.period,
               e.trajectory.num_joints());
  std::fprintf(
      stderr,
      "  expected standard errors of the %d base parameters: %.2f times those of a random "
      "motion (geometric mean; %.2f to %.2f)\n"
      "  log det of the information %.1f, random %.1f; condition number %.0f, random %.0f\n",
      e.base_parameters, e.std_ratio, e.best_std_ratio, e.worst_std_ratio, e.log_det,
      e.random_log_det, e.condition, e.random_condition);
  for (const LimitUse& use : e.limits)
    std::fprintf(stderr,
                 "  %s uses %.0f %% of its range, %.0f %% of velocity, %.0f %% of "
                 "acceleration, %s of torque\n",
                 use.joint.c_str(), 100.0 * use.position, 100.0 * use.velocity,
                 100.0 * use.acceleration,
                 use.effort > 0.0 ? (std::to_string(std::lround(100.0 * use.effort)) + " %").c_str()
                                  : "unlimited");
  for (const std::string& note : e.notes) std::fprintf(stderr, "  %s\n", note.c_str());
}

void run_excite(ExciteOptions options) {
  DesignOptions& design = options.design;
  design.motion.seed = options.common.seed;
  design.limits = {ranges(options.position), limits(options.velocity), limits(options.acceleration),
                   limits(options.torque)};
  check_output(options.out, {options.model});
  const Model model = read_model(options.model, options.reading);
  check_trajectory_names(joint_names(model));
  const Interruptible interruptible;
  ProgressLine line(options.common.quiet);
  design.progress = [&](const FitProgress& progress) {
    line.show(progress);
    return !Interruptible::requested();
  };
  const Excitation result = design_excitation(model, design);
  line.clear();
  write_trajectory(result.trajectory, options.out);
  if (options.common.json)
    std::fputs(excite_result_json(result, options.out).c_str(), stdout);
  else
    print(result, options.out);
  if (result.interrupted)
    stop(kInterrupted, "interrupted: " + options.out + " is the best motion until then");
}

}  // namespace

void add_excite(CLI::App& app) {
  auto options = std::make_shared<ExciteOptions>();
  FourierOptions& f = options->design.motion;
  CLI::App* command = app.add_subcommand(
      "excite",
      "Design a motion that tells most about the parameters, within the limits.\n"
      "A Fourier series per joint, from rest, whose information about all that `identify` fits has "
      "the largest determinant (D-optimal). Positions, velocities, accelerations and the torques "
      "that the model needs keep their limits between the rows, too. Collisions are not looked "
      "at.\n"
      "Of the model's limits a share is kept back; limits given here are used in full. Without "
      "position limits a joint moves within 1 rad or 0.1 m of its zero; without a velocity limit "
      "(or 0) at up to 2 rad/s or 0.3 m/s; without an effort limit (or 0) torque is not looked at; "
      "a range of zero width holds it.\n"
      "Of a robot that floats flights are designed: its base gives way to the joints.\n"
      "In closed loops as many driven joints lead as there are motions; ranges are narrowed to "
      "where "
      "the loops close.");
  add_robot(*command, options->model);
  add_options(*command, options->reading);
  command->add_option("-o,--output", options->out, "trajectory (.csv)")->required();
  command->add_option("--duration", f.duration, "whole periods that cover this [s]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command->add_option("--period", f.period, "1/base frequency [s]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command->add_option("--harmonics", f.harmonics, "of the base frequency, 3 or more")
      ->capture_default_str();
  command->add_option("--rate", f.rate, "of the rows [Hz]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command
      ->add_option("--position-limit", options->position,
                   "LOW:HIGH for all joints or JOINT=LOW:HIGH [rad, m], separated by commas")
      ->delimiter(',');
  command
      ->add_option("--velocity-limit", options->velocity,
                   "for all joints or JOINT=VALUE [rad/s, m/s]")
      ->delimiter(',');
  command
      ->add_option("--acceleration-limit", options->acceleration,
                   "the same [rad/s^2, m/s^2]; default: the velocity limit in 0.25 s")
      ->delimiter(',');
  command->add_option("--torque-limit", options->torque, "the same [N*m, N]")->delimiter(',');
  command
      ->add_option("--iterations", options->design.iterations,
                   "generations of the search; 0: the best of some random motions")
      ->check(count(100000))
      ->capture_default_str();
  add_common(*command, options->common);
  command->callback([options] { run_excite(*options); });
}

}  // namespace diffnea::apps
