#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <memory>

#include "mechanisms.hpp"

namespace hidden {
namespace {

/// The command as it was `delay` seconds ago, mean over each step.
class Delay {
 public:
  double operator()(double delay, double command, double dt) {
    past_.push_front(command);
    const double steps = delay / dt;
    const auto whole = static_cast<std::size_t>(steps);
    const double part = steps - static_cast<double>(whole);
    if (past_.size() > whole + 2) past_.resize(whole + 2);
    const auto at = [&](std::size_t i) { return past_[std::min(i, past_.size() - 1)]; };
    return (1.0 - part) * at(whole) + part * at(whole + 1);
  }
  void clear() { past_.clear(); }

 private:
  std::deque<double> past_;
};

/// T u̇ = τ_c − u, solved exactly under a command that is constant over a step.
class Lag {
 public:
  double operator()(double time_constant, double command, double dt) {
    if (!begun_) torque_ = command;
    begun_ = true;
    const double decay = std::exp(-dt / time_constant), gap = torque_ - command;
    torque_ = command + gap * decay;
    return command + gap * (1.0 - decay) * time_constant / dt;
  }
  void clear() { begun_ = false; }

 private:
  double torque_ = 0.0;
  bool begun_ = false;
};

}  // namespace

bool is_drive_effect(const std::string& effect) {
  return effect == "torque_gain" || effect == "torque_offset" || effect == "actuator_lag" ||
         effect == "actuator_delay" || effect == "saturation";
}

Mechanism drive_effect(const std::string& effect, int joint, const Draw& draw) {
  Mechanism h;
  h.effect = effect;
  h.where = draw.joint(joint);
  h.joints = {joint};
  const double sign = draw.rng.sign();
  // Only at its own joint.
  const auto drive = [&](auto f) {
    h.drive = [joint, f](double s, int j, double command, double dt) {
      return j == joint ? f(s, command, dt) : command;
    };
  };
  if (effect == "torque_gain") {
    h.start = 0.02;
    h.limit = 0.4;
    drive([sign](double s, double command, double) { return command / (1.0 + sign * s); });
    h.parameters = [sign](double s) { return Json{{"gain_error", sign * s}}; };
  } else if (effect == "torque_offset") {
    h.start = 0.02 * draw.torque(joint);
    drive([sign](double s, double command, double) { return command - sign * s; });
    h.parameters = [sign](double s) { return Json{{"offset", sign * s}}; };
  } else if (effect == "actuator_lag") {
    h.start = 0.005;
    h.limit = 0.025;
    const auto lag = std::make_shared<Lag>();
    h.reset = [lag] { lag->clear(); };
    drive([lag](double s, double command, double dt) { return (*lag)(s, command, dt); });
    h.parameters = [](double s) { return Json{{"time_constant", s}}; };
  } else if (effect == "actuator_delay") {
    h.start = 0.005;
    h.limit = 0.02;
    const auto delay = std::make_shared<Delay>();
    h.reset = [delay] { delay->clear(); };
    drive([delay](double s, double command, double dt) { return (*delay)(s, command, dt); });
    h.parameters = [](double s) { return Json{{"delay", s}}; };
  } else {
    // The strength is what the limit lacks of 2.5 times the root mean square.
    h.start = 0.5;
    h.limit = 0.75;
    const double most = 2.5 * draw.torque(joint);
    drive([most](double s, double command, double) {
      return std::clamp(command, -most * (1.0 - s), most * (1.0 - s));
    });
    h.parameters = [most](double s) { return Json{{"limit", most * (1.0 - s)}}; };
  }
  return h;
}

Mechanism common_torque_gain(const Draw& draw) {
  Mechanism h;
  h.effect = "torque_gain";
  h.where = "all";
  for (int j = 0; j < draw.robot.num_joints(); ++j) h.joints.push_back(j);
  h.start = 0.02;
  h.limit = 0.4;
  const double sign = draw.rng.sign();
  h.drive = [sign](double s, int, double command, double) { return command / (1.0 + sign * s); };
  h.parameters = [sign](double s) { return Json{{"gain_error", sign * s}}; };
  return h;
}

}  // namespace hidden
