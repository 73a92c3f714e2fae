#include <cstdio>

#include <diffnea/excite/fourier.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/simulate_result.hpp>
#include <diffnea/io/trajectory_file.hpp>

#include "common.hpp"

namespace diffnea::apps {
namespace {

struct ExciteOptions {
  CommonOptions common;
  std::string model, out;
  FourierOptions fourier;
};

void run_excite(ExciteOptions options) {
  options.fourier.seed = options.common.seed;
  refuse_overwriting(options.out, {options.model});
  const Model model = read_model(options.model);
  const Trajectory trajectory = random_fourier(model, options.fourier);
  const std::vector<std::string> notes = fourier_notes(model, options.fourier);
  write_trajectory(trajectory, options.out);
  if (options.common.json)
    std::fputs(excite_result_json(trajectory, options.fourier.period, options.out, notes).c_str(),
               stdout);
  else if (!options.common.quiet)
    std::fprintf(stderr, "%s: %ld rows, %.1f s in periods of %.1f s, %d joints\n",
                 options.out.c_str(), trajectory.rows(), trajectory.time[trajectory.rows() - 1],
                 options.fourier.period, trajectory.num_joints());
  if (!options.common.json && !options.common.quiet)
    for (const std::string& note : notes) std::fprintf(stderr, "  %s\n", note.c_str());
}

}  // namespace

void add_excite(CLI::App& app) {
  auto options = std::make_shared<ExciteOptions>();
  FourierOptions& f = options->fourier;
  CLI::App* command = app.add_subcommand(
      "excite",
      "Write a motion within the limits that makes the parameters visible.\n"
      "So far: a random Fourier series, drawn once; no optimal design yet.\n"
      "Without position limits a joint moves within 1 rad or 0.1 m of its zero; "
      "without a velocity limit (or 0) at up to 2 rad/s or 0.3 m/s; without an "
      "effort limit (or 0) torque is not looked at; a range of zero width holds it.");
  command->add_option("model", options->model, "robot description: URDF, MJCF or JSON")->required();
  command->add_option("-o,--output", options->out, "trajectory (.csv)")->required();
  command->add_option("--duration", f.duration, "whole periods that cover this [s]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command->add_option("--period", f.period, "[s]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  command->add_option("--harmonics", f.harmonics, "of the period, 3 or more")
      ->capture_default_str();
  command->add_option("--rate", f.rate, "of the rows [Hz]")
      ->check(at_least(0.0, true))
      ->capture_default_str();
  add_common(*command, options->common);
  command->callback([options] { run_excite(*options); });
}

}  // namespace diffnea::apps
