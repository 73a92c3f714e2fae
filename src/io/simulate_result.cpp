#include <diffnea/io/simulate_result.hpp>

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

std::string excite_result_json(const Trajectory& t, double period, const std::string& file,
                               const std::vector<std::string>& notes) {
  io::Json joints = io::Json::array();
  for (int j = 0; j < t.num_joints(); ++j)
    joints.push_back({{"joint", t.joint_names[j]},
                      {"lowest", t.q.col(j).minCoeff()},
                      {"highest", t.q.col(j).maxCoeff()},
                      {"fastest", t.qd.col(j).cwiseAbs().maxCoeff()}});
  return text({{"schema", "diffnea/excite/1"},
               {"trajectory", file},
               {"rows", t.rows()},
               {"seconds", t.time[t.rows() - 1]},
               {"period", period},
               {"joints", joints},
               {"notes", notes}});
}

}  // namespace diffnea
