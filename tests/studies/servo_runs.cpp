/// Study: whole runs of robots whose drives follow commands, simulated in closed loop from the
/// first state and never reset; mean absolute error [mrad] or [mm] of each joint in each run, and
/// in all.
///
///     servo_runs MODEL.json RUN.csv...
///
/// Bodies that the runs held are those of their sidecars, whatever the model says of runs.

#include <cmath>
#include <cstdio>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/layout.hpp>
#include <diffnea/identify/source.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/sidecar.hpp>
#include <diffnea/motion/horizon.hpp>
#include <diffnea/recording/csv.hpp>

#include "identify/run_effects.hpp"
#include "motion/continuation.hpp"

namespace diffnea {
namespace {

/// Positions that a first state is read from [s].
constexpr double kBeginning = 0.1;

/// Mean |q̂ − q| of each joint in a run, (n); NaN if the simulation blows up.
VecX<double> mean_errors(const Model& without_bodies, const Recording& r) {
  FitChoice choice;
  const Model model = with_held_bodies(without_bodies, {{r.source, r.info, "", ""}}, choice);
  const std::size_t n = static_cast<std::size_t>(r.num_joints());
  std::vector<BoundEffect> effects;
  for (const EffectSpec& spec : model.effects) effects.push_back(bind(spec, model, {0}));
  JointWindows simulator(extend(model, {0}, 0), effects, {}, {});
  const std::vector<bool> passive(n, false), commanded(n, true);
  const std::vector<MotionStretch> stretches =
      motion_stretches(r, sensor_noise({r}, passive), passive, commanded);
  std::vector<MotionWindow> windows = cut_windows(stretches, stretches.at(0).length());
  set_measured_states(stretches, kBeginning, windows);
  VecX<double> sum = VecX<double>::Zero(static_cast<long>(n)), count = sum;
  for (const MotionWindow& w : windows) {
    const MotionStretch& s = stretches[w.stretch];
    const RowMatX<double> q = simulator.positions(s, w);
    for (long k = 0; k < w.rows; ++k)
      for (long j = 0; j < q.cols(); ++j) {
        const double error = q(k, j) - s.q(w.first + k, j);
        if (std::isnan(s.q(w.first + k, j))) continue;
        sum[j] += std::abs(error);
        count[j] += 1.0;
      }
  }
  return sum.cwiseQuotient(count);
}

}  // namespace
}  // namespace diffnea

int main(int argc, char** argv) {
  using namespace diffnea;
  if (argc < 3) {
    std::fprintf(stderr, "usage: servo_runs MODEL.json RUN.csv...\n");
    return 2;
  }
  try {
    Model model = read_model(argv[1]);
    std::erase_if(model.effects,
                  [](const EffectSpec& e) { return !split_where(e.where).runs.empty(); });
    VecX<double> sum = VecX<double>::Zero(static_cast<long>(joint_names(model).size()));
    for (int k = 2; k < argc; ++k) {
      Recording r = read_recordings(argv[k], with_sidecar(argv[k], {.joints = describe_joints(model)})).at(0);
      r.run = 0;
      const VecX<double> errors = mean_errors(model, r);
      for (const double error : errors) std::printf("%10.5f ", 1e3 * error);
      std::printf(" %s\n", r.source.c_str());
      sum += errors;
    }
    for (const double error : sum) std::printf("%10.5f ", 1e3 * error / (argc - 2));
    std::printf(" mean of %d runs\n", argc - 2);
  } catch (const Error& e) {
    std::fprintf(stderr, "servo_runs: %s\n", e.what());
    return 1;
  }
  return 0;
}
