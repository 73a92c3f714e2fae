#pragma once
/// A double pendulum that swings without end, as a diagnosis sees it: evidence whose torques a test
/// chooses.

#include <cmath>
#include <functional>
#include <memory>

#include <diffnea/core/random.hpp>
#include <diffnea/identify/layout.hpp>
#include <diffnea/identify/source.hpp>
#include <diffnea/io/model_file.hpp>

#include "diagnose/evidence.hpp"
#include "identify/passes.hpp"

namespace diffnea::test {

constexpr double kSwingPeriod = 4.0;  ///< [s]

/// @param repeats  whether the motion has kSwingPeriod
inline Recording swinging(const Model& model, double seconds, bool repeats, unsigned seed) {
  constexpr double kStep = 0.01;
  Rng rng(seed);
  Recording r;
  r.source = "swinging";
  r.joint_names = joint_names(model);
  const long rows = std::lround(seconds / kStep);
  const auto n = static_cast<long>(r.joint_names.size());
  r.time = VecX<double>::LinSpaced(rows, 0.0, kStep * static_cast<double>(rows - 1));
  r.q = r.tau = RowMatX<double>::Zero(rows, n);
  r.has_tau.assign(r.joint_names.size(), true);
  r.info.torque_sampling = TorqueSampling::kInstant;
  const double ratio = repeats ? 1.0 : 1.0 / std::sqrt(2.0);
  for (long i = 0; i < rows; ++i)
    for (long j = 0; j < n; ++j) {
      const double w = 2.0 * M_PI / kSwingPeriod * r.time[i];
      r.q(i, j) = 0.7 * std::sin(w + static_cast<double>(j)) + 0.4 * std::sin(2.0 * ratio * w) +
                  0.2 * std::sin(5.0 * w);
      r.tau(i, j) = rng.normal();
    }
  return r;
}

/// Keeps every third row: a log too slow for two halves, so that rows hold all samples.
inline void slow_down(Recording& r) {
  const auto rows = Eigen::seq(0, r.rows() - 1, 3);
  const RowMatX<double> q = r.q(rows, Eigen::all), tau = r.tau(rows, Eigen::all);
  const VecX<double> time = r.time(rows);
  r.q = q, r.tau = tau, r.time = time;
}

/// Everything that evidence refers to, kept alive.
struct SwingingEvidence {
  explicit SwingingEvidence(double seconds, bool repeats = false, unsigned seed = 1,
                            const std::string& effect = "viscous_friction",
                            const std::function<void(Recording&)>& alter = {})
      : model(read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf")) {
    Recording recording = swinging(model, seconds, repeats, seed);
    if (alter) alter(recording);
    source = recordings_in_memory(model, {recording});
    FitChoice choice;
    choice.effects = std::vector<std::string>{effect};
    std::vector<std::string> notes;
    layout = layout_for(model, *source, nullptr, choice, notes);
    PreprocessOptions preprocess;
    preprocess.filter_hz = 8.0;
    preprocess.decimate_to_hz = 25.0;
    evidence = std::make_unique<Evidence>(model, Linearisation{model}, layout, *source,
                                          plan_preprocess(source->sample(), preprocess), 0.0,
                                          IdentifyOptions{});
  }
  const Evidence& operator*() const { return *evidence; }
  const Evidence* operator->() const { return evidence.get(); }

  Model model;
  std::unique_ptr<RecordingSource> source;
  FitLayout layout;
  std::unique_ptr<Evidence> evidence;
};

}  // namespace diffnea::test
