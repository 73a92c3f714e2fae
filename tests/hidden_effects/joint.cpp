#include <cmath>
#include <numbers>

#include "mechanisms.hpp"

namespace hidden {

bool is_joint_effect(const std::string& effect) {
  return effect == "armature" || effect == "joint_spring" || effect == "cogging";
}

Mechanism joint_effect(const std::string& effect, int j, const Draw& draw) {
  Mechanism h;
  h.effect = effect;
  h.where = draw.joint(j);
  h.joints = {j};
  h.start = 0.02 * draw.torque(j);
  if (effect == "armature") {
    h.start /= draw.scales.acceleration[j];
    h.configure = [j](double s, mjModel& m, const State& x) { m.dof_armature[x.dof[j]] += s; };
    h.parameters = [](double s) { return Json{{"armature", s}}; };
  } else if (effect == "joint_spring") {
    const double rest =
        draw.scales.centre[j] + draw.rng.uniform(-1.5, 1.5) * draw.scales.position[j];
    h.start /= draw.scales.position[j];
    h.configure = [j, rest](double s, mjModel& m, const State& x) {
      const int id = m.dof_jntid[x.dof[j]];
      m.jnt_stiffness[id] = s;
      m.qpos_spring[m.jnt_qposadr[id]] = rest;
    };
    h.parameters = [rest](double s) { return Json{{"stiffness", s}, {"rest", rest}}; };
  } else {
    // Three to forty cycles over the range; whole numbers a turn.
    double cycles =
        draw.rng.log_uniform(3.0, 40.0) / (2.0 * draw.link(j).range) * 2.0 * std::numbers::pi;
    if (!draw.link(j).slide) cycles = std::max(4.0, std::round(cycles));
    const double phase = draw.rng.uniform(-std::numbers::pi, std::numbers::pi);
    h.force = [=](double s, const State& x, double* qfrc) {
      qfrc[x.dof[j]] -= s * std::sin(cycles * x.q[j] + phase);
    };
    h.parameters = [=](double s) {
      return Json{{"amplitude", s}, {"cycles", cycles}, {"phase", phase}};
    };
  }
  return h;
}

}  // namespace hidden
