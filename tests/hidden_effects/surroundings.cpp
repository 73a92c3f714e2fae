#include <cmath>
#include <numbers>

#include "mechanisms.hpp"

namespace hidden {
namespace {

Mechanism base_tilt(const Draw& draw) {
  Mechanism h;
  const double g = -draw.robot.gravity[2];
  const double direction = draw.rng.uniform(-std::numbers::pi, std::numbers::pi);
  const auto gravity = [=](double s) {
    return Vec3{g * std::sin(s) * std::cos(direction), g * std::sin(s) * std::sin(direction),
                -g * std::cos(s)};
  };
  h.where = "base";
  h.start = 0.02;
  h.limit = 0.3;
  h.configure = [=](double s, mjModel& m, const State&) {
    const Vec3 tilted = gravity(s);
    std::copy(tilted.begin(), tilted.end(), m.opt.gravity);
  };
  h.parameters = [=](double s) {
    return Json{{"gravity_x", gravity(s)[0]}, {"gravity_y", gravity(s)[1]}};
  };
  return h;
}

/// A constant force in the world on the tip: a cable, a hose.
Mechanism tip_force(const Draw& draw) {
  Mechanism h;
  Vec3 direction{draw.rng.normal(), draw.rng.normal(), draw.rng.normal()};
  const double length = std::sqrt(direction[0] * direction[0] + direction[1] * direction[1] +
                                  direction[2] * direction[2]);
  for (double& x : direction) x /= length;
  h.where = "tip";
  h.start = 0.02 * draw.scales.torque.maxCoeff();
  const Vec3 tip = draw.robot.tip;
  const int last = draw.robot.num_joints() - 1;
  h.force = [=](double s, const State& x, double* qfrc) {
    const int body = x.model->dof_bodyid[x.dof[static_cast<std::size_t>(last)]];
    const mjtNum *p = x.data->xpos + 3 * body, *R = x.data->xmat + 9 * body;
    mjtNum point[3], force[3];
    const mjtNum torque[3] = {0, 0, 0};
    for (int i = 0; i < 3; ++i) {
      point[i] = p[i] + R[3 * i] * tip[0] + R[3 * i + 1] * tip[1] + R[3 * i + 2] * tip[2];
      force[i] = s * direction[static_cast<std::size_t>(i)];
    }
    mj_applyFT(x.model, x.data, force, torque, point, body, qfrc);
  };
  // On the robot, in the world; at `point` of the last link.
  h.parameters = [=](double s) {
    return Json{{"force_x", s * direction[0]},
                {"force_y", s * direction[1]},
                {"force_z", s * direction[2]},
                {"point", {tip[0], tip[1], tip[2]}}};
  };
  return h;
}

Mechanism payload(const Draw& draw) {
  Mechanism h;
  Additions::Payload box;
  for (std::size_t i = 0; i < 3; ++i) {
    box.com[i] = draw.robot.tip[i] + draw.rng.uniform(-0.04, 0.04);
    box.size[i] = draw.rng.uniform(0.05, 0.2);
  }
  h.where = "tip";
  h.start = 0.1;
  h.add_parts = [box](double s, const Robot&, Additions& parts) {
    parts.payloads.push_back({s, box.com, box.size});
  };
  h.parameters = [box](double s) {
    return Json{{"mass", s}, {"com", {box.com[0], box.com[1], box.com[2]}}};
  };
  return h;
}

}  // namespace

bool is_surroundings(const std::string& effect) {
  return effect == "base_tilt" || effect == "tip_force" || effect == "payload";
}

Mechanism surroundings(const std::string& effect, const Draw& draw) {
  Mechanism h = effect == "base_tilt"   ? base_tilt(draw)
                : effect == "tip_force" ? tip_force(draw)
                                        : payload(draw);
  h.effect = effect;
  for (int j = 0; j < draw.robot.num_joints(); ++j) h.joints.push_back(j);
  return h;
}

}  // namespace hidden
