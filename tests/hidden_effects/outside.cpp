#include <algorithm>
#include <cmath>
#include <numbers>

#include "mechanisms.hpp"

namespace hidden {

const std::vector<std::string>& outside_kinds() {
  static const std::vector<std::string> kKinds{
      "detent", "product_friction", "time_ripple", "position_friction", "wall", "neighbour_cable"};
  return kKinds;
}

Mechanism outside(const std::string& kind, int j, const Draw& draw) {
  Mechanism h;
  h.effect = "outside/" + kind;
  h.where = draw.joint(j);
  h.joints = {j};
  h.start = 0.02 * draw.torque(j);
  const auto channel = [&](const char* prefix, int joint) { return prefix + draw.joint(joint); };
  const double centre = draw.scales.centre[j], spread = draw.scales.position[j];
  const auto oppose = [&](auto f) {
    h.force = [j, f](double s, const State& x, double* qfrc) {
      qfrc[x.dof[static_cast<std::size_t>(j)]] -= f(s, x);
    };
  };
  if (kind == "detent") {
    const double at = centre + draw.rng.uniform(-1.0, 1.0) * spread;
    const double width = draw.rng.uniform(0.1, 0.3) * spread;
    oppose([=](double s, const State& x) {
      const double r = (x.q[j] - at) / width;
      return s * std::exp(-r * r);
    });
    h.parameters = [=](double s) {
      return Json{{"torque", s}, {"position", at}, {"width", width}};
    };
    h.variables = {channel("q_", j)};
  } else if (kind == "product_friction") {
    h.start /= spread * draw.speed(j);
    oppose([=](double s, const State& x) { return s * (x.q[j] - centre) * x.qd[j]; });
    h.parameters = [=](double s) { return Json{{"factor", s}, {"centre", centre}}; };
    h.variables = {channel("q_", j), channel("qd_", j)};
  } else if (kind == "time_ripple") {
    const double frequency = draw.rng.uniform(1.3, 6.0);
    const double phase = draw.rng.uniform(-std::numbers::pi, std::numbers::pi);
    oppose([=](double s, const State& x) {
      return s * std::sin(2.0 * std::numbers::pi * frequency * x.time + phase);
    });
    h.parameters = [=](double s) { return Json{{"torque", s}, {"frequency", frequency}}; };
    h.variables = {"time"};
  } else if (kind == "position_friction") {
    // Dry friction that rises and falls along the way: F (1 + sin) s; its mean is Coulomb friction.
    const double cycles = draw.rng.uniform(0.5, 2.0) / spread;
    const double width = 0.01 * (draw.link(j).slide ? 0.1 : 1.0);
    const double inertia = draw.scales.inertia[j];
    oppose([=](double s, const State& x) {
      const double v0 = std::max(width, 2.0 * s / (1500.0 * inertia));
      return s * std::sin(cycles * (x.q[j] - centre)) * std::tanh(x.qd[j] / v0);
    });
    h.parameters = [=](double s) { return Json{{"friction", s}, {"cycles", cycles}}; };
    h.variables = {channel("q_", j), channel("qd_", j)};
  } else if (kind == "wall") {
    // Something soft that the joint leans on at one end of its motion.
    const double side = draw.rng.sign();
    const double at = centre + side * draw.rng.uniform(0.3, 1.0) * spread;
    h.start /= spread;
    oppose(
        [=](double s, const State& x) { return s * side * std::max(0.0, side * (x.q[j] - at)); });
    h.parameters = [=](double s) { return Json{{"stiffness", s}, {"position", at}}; };
    h.variables = {channel("q_", j)};
  } else {
    // A cable that another joint winds up: torque here, by the square of its angle.
    const int n = draw.robot.num_joints();
    const int other = (j + 1 + draw.rng.below(std::max(1, n - 1))) % n;
    const double centre_other = draw.scales.centre[other],
                 spread_other = draw.scales.position[other];
    oppose([=](double s, const State& x) {
      const double r = (x.q[other] - centre_other) / spread_other;
      return s * (r + 0.5 * r * r);
    });
    h.parameters = [=, name = draw.joint(other)](double s) {
      return Json{{"torque", s}, {"other", name}};
    };
    h.variables = {channel("q_", other)};
  }
  return h;
}

Mechanism mechanism(const std::string& effect, int joint, const Draw& draw) {
  if (is_friction(effect)) return friction(effect, joint, draw);
  if (is_joint_effect(effect)) return joint_effect(effect, joint, draw);
  if (is_drive_effect(effect)) return drive_effect(effect, joint, draw);
  if (is_transmission(effect)) return transmission(effect, joint, draw);
  if (is_surroundings(effect)) return surroundings(effect, draw);
  if (is_channel(effect)) return channel(effect, joint, draw);
  return outside(effect, joint, draw);
}

}  // namespace hidden
