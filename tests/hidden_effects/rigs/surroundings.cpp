#include <cmath>
#include <numeric>

#include "effects_detail.hpp"

namespace rigs {

std::vector<int> every(int n) {
  std::vector<int> out(static_cast<std::size_t>(n));
  std::iota(out.begin(), out.end(), 0);
  return out;
}

void sensor_effect(Effect& e, int j, Scene& s) {
  const double sign = s.draw.sign();
  e.joints = every(s.arm.size());
  if (e.name == "encoder_offset") {
    e.start = 0.03;
    e.limit = 0.3;
    e.act = [=](double x, Rig& rig) { rig.physics.encoder_offset[j] = sign * x; };
    e.parameters = [=](double x) { return Json{{"offset", sign * x}}; };
  } else if (e.name == "encoder_scale") {
    e.start = 0.03;
    e.limit = 0.2;
    e.act = [=](double x, Rig& rig) { rig.physics.encoder_scale[j] = 1.0 + sign * x; };
    e.parameters = [=](double x) { return Json{{"scale_error", sign * x}}; };
  } else if (e.name == "time_shift") {
    const bool all = s.draw.chance(0.7), early = all && sign < 0.0;
    if (all) e.where = "all";
    e.start = 0.004;
    e.limit = 0.03;
    const int n = s.arm.size();
    e.act = [=](double x, Rig& rig) {
      if (early)
        rig.physics.torque_late = x;
      else if (all)
        rig.physics.late.setConstant(n, x);
      else
        rig.physics.late[j] = x;
    };
    e.parameters = [=](double x) { return Json{{"shift", early ? -x : x}}; };
  } else {
    e.velocity_lag = s.draw.ratio(0.004, 0.03);
    e.late_joint = j;
    e.start = e.limit = 0.0;
    e.act = [](double, Rig&) {};
    e.parameters = [lag = e.velocity_lag](double) { return Json{{"lag", lag}}; };
  }
}

void body_effect(Effect& e, Scene& s) {
  e.joints = every(s.arm.size());
  if (e.name == "base_tilt") {
    const double to = s.draw.uniform(-std::numbers::pi, std::numbers::pi);
    e.where = "base";
    e.start = 0.02;
    e.limit = 0.3;
    const auto more = [=](double x) {
      return Eigen::Vector3d(9.81 * std::sin(x) * std::cos(to), 9.81 * std::sin(x) * std::sin(to),
                             9.81 * (1.0 - std::cos(x)));
    };
    e.act = [=](double x, Rig& rig) { rig.physics.more_gravity = more(x); };
    e.parameters = [=](double x) {
      return Json{{"gravity_x", more(x)[0]}, {"gravity_y", more(x)[1]}};
    };
    return;
  }
  e.where = "tip";
  if (e.name == "tip_force") {
    Eigen::Vector3d to(s.draw.normal(), s.draw.normal(), s.draw.normal());
    to.normalize();
    e.start = 0.05 * s.usual.torque.maxCoeff();
    e.act = [=](double x, Rig& rig) { rig.physics.tip_force = x * to; };
    e.parameters = [=](double x) {
      return Json{{"force_x", x * to[0]}, {"force_y", x * to[1]}, {"force_z", x * to[2]}};
    };
    return;
  }
  Eigen::Vector3d at = s.arm.tip;
  for (int i = 0; i < 3; ++i) at[i] += s.draw.uniform(-0.04, 0.04);
  const double spread = s.draw.uniform(5e-4, 3e-3);  // ∫ x² dm/m [m²]
  const auto body = [=](double mass) {
    Eigen::Matrix4d out;
    out.topLeftCorner<3, 3>() = mass * (at * at.transpose() + spread * Eigen::Matrix3d::Identity());
    out.topRightCorner<3, 1>() = mass * at;
    out.bottomLeftCorner<1, 3>() = mass * at.transpose();
    out(3, 3) = mass;
    return out;
  };
  e.start = 0.05 * s.arm.joints.back().pseudo(3, 3);
  e.act = [=](double x, Rig& rig) { rig.physics.payload = body(x); };
  e.parameters = [=](double x) {
    return Json{{"mass", x}, {"hx", x * at[0]}, {"hy", x * at[1]}, {"hz", x * at[2]}};
  };
}

}  // namespace rigs
