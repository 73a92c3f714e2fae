#include <diffnea/runs/simulate_result.hpp>

#include "runs/fields_json.hpp"
#include "runs/printed.hpp"

namespace diffnea {

std::string simulate_result_json(const std::vector<SimulatedRecording>& runs,
                                 const std::string& file) {
  const Recording& r = runs.back().recording;
  SimulatedFile out{.recording = file,
                    .runs = std::ssize(runs),
                    .seconds = r.rows() > 0 ? r.time[r.rows() - 1] : 0.0,
                    .joints = r.joint_names,
                    .passive = r.info.passive,
                    .failure = runs.back().failure};
  for (const SimulatedRecording& run : runs) {
    out.rows += run.recording.rows();
    out.saturated_rows += run.saturated;
  }
  return io::file_text("diffnea/simulate/1", out, kInResult);
}

std::string excite_result_json(const Excitation& result, const std::string& file) {
  const Trajectory& t = result.trajectory;
  ExcitedFile out{.trajectory = file,
                  .rows = t.rows(),
                  .seconds = t.time[t.rows() - 1],
                  .period = result.period,
                  .joints = {},
                  .base_parameters = result.base_parameters,
                  .log_det = result.log_det,
                  .random_log_det = result.random_log_det,
                  .condition = result.condition,
                  .random_condition = result.random_condition,
                  .std_ratio = result.std_ratio,
                  .best_std_ratio = result.best_std_ratio,
                  .worst_std_ratio = result.worst_std_ratio,
                  .iterations = result.iterations,
                  .interrupted = result.interrupted,
                  .notes = result.notes};
  for (int j = 0; j < t.num_joints(); ++j) {
    const LimitUse& use = result.limits[static_cast<std::size_t>(j)];
    out.joints.push_back({t.joint_names[static_cast<std::size_t>(j)], t.q.col(j).minCoeff(),
                          t.q.col(j).maxCoeff(), t.qd.col(j).cwiseAbs().maxCoeff(), use.position,
                          use.velocity, use.acceleration, use.effort});
  }
  return io::file_text("diffnea/excite/1", out, kInResult);
}

}  // namespace diffnea
