#include "runs/policy_json.hpp"

#include <cmath>

namespace diffnea::io {
namespace {

/// A covariance of as many rows is factorised in seconds; a search with a tenth of them is a large
/// one.
constexpr long kMostParameters = 1500;

void require_between(double x, double low, double high, const std::string& where) {
  if (!(x >= low && x <= high))
    throw ModelError(where + ": got " + Json(x).dump() + ", expected " + Json(low).dump() + " to " +
                     Json(high).dump());
}

void require_length(long got, long expected, const std::string& where, const char* what) {
  if (got != expected)
    throw ModelError(where + ": got " + std::to_string(got) + " numbers, expected " +
                     std::to_string(expected) + " (one per " + what + ")");
}

}  // namespace

void check_primitive(const PrompSpec& spec, const std::string& where) {
  try {
    Promp{spec};
  } catch (const Error& error) {
    throw ModelError(where + ": " + error.what());
  }
}

void check_controller(const ControllerOptions& o, long joints, const std::string& where) {
  require_between(o.control_rate, 1.0, 1e5, where + ".control_rate");
  if (o.kp.size() > 0) require_length(o.kp.size(), joints, where + ".kp", "joint");
  if (o.kd.size() > 0) require_length(o.kd.size(), joints, where + ".kd", "joint");
}

void check_gaussian(const Gaussian& g, long size, const std::string& where) {
  if (size > kMostParameters)
    throw ModelError(where + ".mean: the primitive has " + std::to_string(size) +
                     " parameters; the limit is " + std::to_string(kMostParameters));
  require_length(g.mean.size(), size, where + ".mean", "parameter");
  require_length(g.covariance.rows(), size, where + ".covariance", "row");
  require_length(g.covariance.cols(), size, where + ".covariance[0]", "parameter");
  if (!std::isfinite(kl_divergence(g, g)))
    throw ModelError(where + ".covariance: is not positive definite");
}

void number_iterations(std::vector<ErepsIteration>& history) {
  for (std::size_t i = 0; i < history.size(); ++i) history[i].iteration = static_cast<int>(i) + 1;
}

TaskFile task_file(const BallInCup& task) {
  const LearnOptions& o = task.options;
  const ModelSimulatorOptions& s = o.simulator;
  TaskFile out{.start = task.start,
               .primitive = o.promp,
               .search = o.ereps,
               .weight_std = o.weight_std,
               .nominal_string = o.nominal_string,
               .reward = o.reward,
               .simulator = {s.controller, s.arm_step, s.ball_step, s.settle_time, s.least_upright,
                             s.instruction_set},
               .robust = {},
               .ball_network = {}};
  if (o.robust.draws > 0) out.robust = o.robust;
  if (s.ball_network) out.ball_network = network_source(task);
  return out;
}

LearnOptions read_task(JsonObject& root, long joints) {
  TaskFile file;
  read_value(file, root, "task", {}, kInResult);
  const std::string where = root.at("task"), simulator = where + ".simulator";
  const SimulatorFile& s = file.simulator;
  require_length(file.start.size(), joints, where + ".start", "joint");
  check_primitive(file.primitive, where + ".primitive");
  check_controller(s.controller, joints, simulator + ".controller");
  // Beyond these an hour would be simulated for years.
  require_between(s.arm_step, 1e-6, 1.0, simulator + ".arm_step");
  require_between(s.ball_step, 1e-7, 1.0, simulator + ".ball_step");
  require_between(s.settle_time, 0.0, 60.0, simulator + ".settle_time");
  LearnOptions out;
  out.start = file.start;
  out.promp = file.primitive;
  out.joints = out.promp.joints;
  out.ereps = file.search;
  out.weight_std = file.weight_std;
  out.nominal_string = file.nominal_string;
  out.reward = file.reward;
  out.simulator = {.controller = s.controller,
                   .arm_step = s.arm_step,
                   .ball_step = s.ball_step,
                   .settle_time = s.settle_time,
                   .least_upright = s.least_upright,
                   .instruction_set = s.instruction_set,
                   .ball_network = nullptr};
  if (file.robust) out.robust = *file.robust;
  return out;
}

NetworkSource read_task_network(JsonObject& root) {
  JsonObject task(root.required("task"), root.at("task"));
  NetworkSource out;
  read_value(out, task, "ball_network", {.absent = true}, kInResult);
  return out;
}

}  // namespace diffnea::io
