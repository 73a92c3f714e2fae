#include "mechanisms.hpp"

namespace hidden {

bool is_channel(const std::string& effect) {
  return effect == "encoder_offset" || effect == "encoder_scale" || effect == "time_shift" ||
         effect == "velocity_filter_lag";
}

Mechanism channel(const std::string& effect, int joint, const Draw& draw) {
  Mechanism h;
  h.effect = effect;
  h.where = draw.joint(joint);
  for (int j = 0; j < draw.robot.num_joints(); ++j) h.joints.push_back(j);
  const double sign = draw.rng.sign();
  if (effect == "encoder_offset") {
    h.start = 0.02;
    h.limit = 0.25;
    h.encoder = [=](double s, int j) { return j == joint ? Encoder{1.0, sign * s} : Encoder{}; };
    h.parameters = [=](double s) { return Json{{"offset", sign * s}}; };
  } else if (effect == "encoder_scale") {
    h.start = 0.02;
    h.limit = 0.2;
    h.encoder = [=](double s, int j) {
      return j == joint ? Encoder{1.0 + sign * s, 0.0} : Encoder{};
    };
    h.parameters = [=](double s) { return Json{{"scale_error", sign * s}}; };
  } else if (effect == "time_shift") {
    h.where = "all";
    h.start = 0.005;
    h.limit = 0.05;
    h.position_delay = [=](double s) { return sign * s; };
    h.parameters = [=](double s) { return Json{{"shift", sign * s}}; };
  } else {
    // Shows in no torque, so its size is a time.
    h.start = draw.rng.log_uniform(0.003, 0.03);
    h.velocity_lag = [=](double s, int j) { return j == joint ? s : 0.0; };
    h.parameters = [](double s) { return Json{{"lag", s}}; };
  }
  return h;
}

}  // namespace hidden
