#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/experiment/robot_data.hpp>

namespace diffnea {

DesignOptions arm_excitation(const RobotData& data, std::uint64_t seed) {
  DesignOptions out;
  out.motion.duration = data.arm_seconds;
  out.motion.period = std::min(10.0, data.arm_seconds);
  out.motion.seed = seed;
  return out;
}

DesignOptions ball_excitation(const Model& model, const VecX<double>& home, const RobotData& data,
                              std::uint64_t seed) {
  constexpr double kTurn = 0.6;    // to either side [rad]: the cup stays above the ball
  constexpr double kSlow = 0.8;    // [rad/s]: the string stays taut
  constexpr double kGentle = 2.0;  // [rad/s²]
  DesignOptions out;
  out.motion.duration = out.motion.period = data.ball_seconds;
  out.motion.seed = seed;
  const std::vector<std::string> joints = joint_names(model);
  const std::vector<int> moving = moving_links(model);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const JointLimits& limits = model.links[moving[j]].limits;
    const double middle = home[static_cast<long>(j)];
    out.limits.position[joints[j]] = {std::max(limits.lower, middle - kTurn),
                                      std::min(limits.upper, middle + kTurn)};
  }
  out.limits.velocity[""] = kSlow;
  out.limits.acceleration[""] = kGentle;
  return out;
}

IdentifiedRobot identify_robot(const Model& nominal, const Recording& arm, const Recording& ball,
                               const std::function<bool(const FitProgress&)>& progress) {
  IdentifiedRobot out;
  IdentifyOptions options;
  options.progress = progress;
  Model without = nominal;
  without.ball.reset();
  out.arm = identify(without, {arm}, {}, options);
  out.model = out.arm.model;
  out.model.ball = nominal.ball;
  if (out.arm.summary.interrupted) {
    out.ball.model = out.model;
    out.ball.summary.interrupted = true;
    out.ball.summary.termination = "interrupted before it began";
    return out;
  }
  Recording prescribed = ball;
  prescribed.tau.setConstant(std::numeric_limits<double>::quiet_NaN());
  prescribed.has_tau.assign(prescribed.joint_names.size(), false);
  prescribed.info.passive.clear();
  out.ball = identify(out.model, {prescribed}, {}, options);
  out.model = out.ball.model;
  return out;
}

}  // namespace diffnea
