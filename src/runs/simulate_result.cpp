#include <diffnea/runs/simulate_result.hpp>

#include "io/json.hpp"

namespace diffnea {
namespace {

std::string text(const io::Json& json) {
  return json.dump(1, ' ', false, io::Json::error_handler_t::replace) + "\n";
}

}  // namespace

std::string simulate_result_json(const SimulatedRecording& result, const std::string& file) {
  const Recording& r = result.recording;
  return text({{"schema", "diffnea/simulate/1"},
               {"recording", file},
               {"rows", r.rows()},
               {"seconds", r.rows() > 0 ? r.time[r.rows() - 1] : 0.0},
               {"joints", r.joint_names},
               {"passive", r.info.passive},
               {"saturated_rows", result.saturated},
               {"failure", result.failure.empty() ? io::Json() : io::Json(result.failure)}});
}

std::string excite_result_json(const Excitation& result, const std::string& file) {
  const Trajectory& t = result.trajectory;
  io::Json joints = io::Json::array();
  for (int j = 0; j < t.num_joints(); ++j) {
    const LimitUse& use = result.limits[static_cast<std::size_t>(j)];
    joints.push_back({{"joint", t.joint_names[static_cast<std::size_t>(j)]},
                      {"lowest", t.q.col(j).minCoeff()},
                      {"highest", t.q.col(j).maxCoeff()},
                      {"fastest", t.qd.col(j).cwiseAbs().maxCoeff()},
                      {"limits_used",
                       {{"position", use.position},
                        {"velocity", use.velocity},
                        {"acceleration", use.acceleration},
                        {"torque", use.effort > 0.0 ? io::Json(use.effort) : io::Json()}}}});
  }
  return text({{"schema", "diffnea/excite/1"},
               {"trajectory", file},
               {"rows", t.rows()},
               {"seconds", t.time[t.rows() - 1]},
               {"period", result.period},
               {"joints", joints},
               {"information",
                {{"base_parameters", result.base_parameters},
                 {"log_det", result.log_det},
                 {"random_log_det", result.random_log_det},
                 {"condition", result.condition},
                 {"random_condition", result.random_condition},
                 {"std_ratio", result.std_ratio},
                 {"std_ratio_range", {result.best_std_ratio, result.worst_std_ratio}}}},
               {"iterations", result.iterations},
               {"interrupted", result.interrupted},
               {"notes", result.notes}});
}

}  // namespace diffnea
