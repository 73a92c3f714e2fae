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
  const Trajectory trajectory = random_fourier(read_model(options.model), options.fourier);
  write_trajectory(trajectory, options.out);
  if (options.common.json)
    std::fputs(excite_result_json(trajectory, options.fourier.period, options.out).c_str(), stdout);
  else if (!options.common.quiet)
    std::fprintf(stderr, "%s: %ld rows, %.1f s in periods of %.1f s, %d joints\n",
                 options.out.c_str(), trajectory.rows(), trajectory.time[trajectory.rows() - 1],
                 options.fourier.period, trajectory.num_joints());
}

}  // namespace

void add_excite(CLI::App& app) {
  auto options = std::make_shared<ExciteOptions>();
  FourierOptions& f = options->fourier;
  CLI::App* command =
      app.add_subcommand("excite",
                         "Write a motion within the limits that makes the parameters visible.\n"
                         "So far: a random Fourier series, drawn once; no optimal design yet.");
  command->add_option("model", options->model, "robot description: URDF, MJCF or JSON")->required();
  command->add_option("-o,--output", options->out, "trajectory (.csv)")->required();
  command->add_option("--duration", f.duration, "whole periods that cover this [s]")
      ->capture_default_str();
  command->add_option("--period", f.period, "[s]")->capture_default_str();
  command->add_option("--harmonics", f.harmonics, "of the period, 3 or more")
      ->capture_default_str();
  command->add_option("--rate", f.rate, "of the rows [Hz]")->capture_default_str();
  add_common(*command, options->common);
  command->callback([options] { run_excite(*options); });
}

}  // namespace diffnea::apps
