#include "effects.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>

namespace rigs {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

std::vector<int> every(int n) {
  std::vector<int> out(static_cast<std::size_t>(n));
  std::iota(out.begin(), out.end(), 0);
  return out;
}

const Joint& joint_of(const Scene& s, int j) { return s.arm.joints[static_cast<std::size_t>(j)]; }
double slide(const Scene& s, int j) { return joint_of(s, j).slide ? 0.2 : 1.0; }

/// Motor and link that swing against each other.
double reduced(const Scene& s, int j) {
  const double rotor = joint_of(s, j).rotor;
  const double link = std::max(s.usual.inertia[j] - rotor, 0.2 * s.usual.inertia[j]);
  return rotor * link / (rotor + link);
}

void dry_effect(Effect& e, int j, Scene& s) {
  const double torque = s.usual.torque[j], speed = s.usual.speed[j];
  e.start = 0.03 * torque;
  if (e.name == "coulomb_friction") {
    e.act = [=](double x, Rig& rig) {
      rig.physics.coulomb_plus[j] += x;
      rig.physics.coulomb_minus[j] += x;
    };
    e.parameters = [](double x) { return Json{{"coulomb", x}}; };
  } else if (e.name == "asymmetric_coulomb") {
    const double share = s.draw.uniform(0.2, 0.7), plus = s.draw.chance(0.5) ? 1.0 : share,
                 minus = plus == 1.0 ? share : 1.0;
    e.act = [=](double x, Rig& rig) {
      rig.physics.coulomb_plus[j] += plus * x;
      rig.physics.coulomb_minus[j] += minus * x;
    };
    e.parameters = [=](double x) {
      return Json{{"coulomb_positive", plus * x}, {"coulomb_negative", minus * x}};
    };
  } else if (e.name == "stribeck_friction") {
    const double width = speed * s.draw.uniform(0.1, 0.35);
    e.act = [=](double x, Rig& rig) {
      rig.physics.stribeck[j] += x;
      rig.physics.stribeck_speed[j] = width;
    };
    e.parameters = [=](double x) {
      return Json{{"stiction_excess", x}, {"stribeck_velocity", width}};
    };
  } else if (e.name == "sublinear_friction") {
    e.start /= std::sqrt(speed);
    e.act = [=](double x, Rig& rig) { rig.physics.sublinear[j] += x; };
    e.parameters = [](double x) { return Json{{"sublinear", x}}; };
  } else {
    const double braking = s.draw.chance(0.5) ? 1.0 : s.draw.uniform(0.6, 0.95);
    e.start = 0.03;
    e.limit = 0.3;
    e.act = [=](double x, Rig& rig) {
      rig.physics.load[j] += x;
      rig.physics.load_braking[j] = braking;
    };
    e.parameters = [=](double x) { return Json{{"mu", x}, {"braking_ratio", braking}}; };
  }
}

void bristle_effect(Effect& e, int j, Scene& s) {
  const bool dahl = e.name == "presliding_dahl";
  const double width = slide(s, j) * s.draw.ratio(2e-3, 2e-2);
  const double rise = dahl ? 1.0 : s.draw.uniform(1.1, 1.6);
  const double speed = s.usual.speed[j] * s.draw.uniform(0.05, 0.3);
  const double inertia = s.usual.inertia[j];
  e.start = 0.03 * s.usual.torque[j];
  const auto made = [=](double x) {
    Bristles b{j, x / width, 0.0, x, rise * x, speed};
    if (!dahl) b.damping = 0.3 * std::sqrt(b.stiffness * inertia);
    return b;
  };
  e.act = [=](double x, Rig& rig) { rig.physics.bristles = made(x); };
  e.parameters = [=](double x) {
    const Bristles b = made(x);
    if (dahl) return Json{{"coulomb", x}, {"presliding", width}};
    return Json{{"stiffness", b.stiffness},
                {"damping", b.damping},
                {"coulomb", b.coulomb},
                {"stiction", b.stiction},
                {"stribeck_velocity", speed}};
  };
}

void smooth_effect(Effect& e, int j, Scene& s) {
  const double torque = s.usual.torque[j], speed = s.usual.speed[j];
  e.start = 0.03 * torque / speed;
  if (e.name == "viscous_friction") {
    e.act = [=](double x, Rig& rig) {
      rig.physics.viscous_plus[j] += x;
      rig.physics.viscous_minus[j] += x;
    };
    e.parameters = [](double x) { return Json{{"viscous", x}}; };
  } else if (e.name == "asymmetric_viscous") {
    const double share = s.draw.uniform(0.1, 0.6);
    const bool forward = s.draw.chance(0.5);
    const double plus = forward ? 1.0 : share, minus = forward ? share : 1.0;
    e.act = [=](double x, Rig& rig) {
      rig.physics.viscous_plus[j] += plus * x;
      rig.physics.viscous_minus[j] += minus * x;
    };
    e.parameters = [=](double x) {
      return Json{{"viscous_positive", plus * x}, {"viscous_negative", minus * x}};
    };
  } else if (e.name == "quadratic_friction") {
    e.start /= speed;
    e.act = [=](double x, Rig& rig) { rig.physics.quadratic[j] += x; };
    e.parameters = [](double x) { return Json{{"quadratic", x}}; };
  } else if (e.name == "warm_up") {
    const double time = s.seconds * s.draw.uniform(0.15, 0.5);
    e.act = [=](double x, Rig& rig) {
      rig.physics.warm[j] = x;
      rig.physics.warm_time[j] = time;
    };
    e.parameters = [=](double x) { return Json{{"viscous", x}, {"time_constant", time}}; };
  } else if (e.name == "armature") {
    e.start = 0.05 * torque / s.usual.push[j];
    e.act = [=](double x, Rig& rig) { rig.physics.rotor[j] += x; };
    e.parameters = [](double x) { return Json{{"armature", x}}; };
  } else if (e.name == "joint_spring") {
    const double sign = s.draw.chance(0.8) ? 1.0 : -1.0;
    const double rest = s.usual.centre[j] + s.usual.spread[j] * s.draw.uniform(-2.0, 2.0);
    e.start = 0.03 * torque / s.usual.spread[j];
    e.act = [=](double x, Rig& rig) {
      rig.physics.spring[j] += sign * x;
      rig.physics.rest[j] = rest;
    };
    e.parameters = [=](double x) { return Json{{"stiffness", sign * x}, {"rest", rest}}; };
  } else {
    // Three periods at least over the way, and no more than a quarter of a turn of the ripple
    // while a tenth of a second passes.
    const double cycles =
        std::round(s.draw.ratio(2.5, 7.0) * kTurn / (2.8 * s.usual.spread[j]) + 1.0);
    const double phase = s.draw.uniform(0.0, kTurn);
    e.start = 0.03 * torque;
    e.act = [=](double x, Rig& rig) {
      rig.physics.ripple_sine[j] = x * std::cos(phase);
      rig.physics.ripple_cosine[j] = x * std::sin(phase);
      rig.physics.ripple_cycles[j] = cycles;
    };
    e.parameters = [=](double x) {
      return Json{
          {"sine", x * std::cos(phase)}, {"cosine", x * std::sin(phase)}, {"cycles", cycles}};
    };
  }
}

void drive_effect(Effect& e, int j, Scene& s) {
  const double sign = s.draw.sign(), torque = s.usual.torque[j];
  if (e.name == "torque_gain") {
    e.start = 0.03;
    e.limit = 0.4;
    e.act = [=](double x, Rig& rig) { rig.physics.gain[j] = sign * x; };
    e.parameters = [=](double x) { return Json{{"gain_error", sign * x}}; };
  } else if (e.name == "torque_offset") {
    e.start = 0.03 * torque;
    e.act = [=](double x, Rig& rig) { rig.physics.offset[j] = sign * x; };
    e.parameters = [=](double x) { return Json{{"offset", sign * x}}; };
  } else if (e.name == "session_offset") {
    std::vector<double> shares;
    for (int k = 0; k < s.runs; ++k) shares.push_back(s.draw.normal());
    e.start = 0.03 * torque;
    e.act = [=](double x, Rig& rig) {
      const Eigen::VectorXd none = Eigen::VectorXd::Zero(rig.arm.size());
      rig.physics.session.assign(shares.size(), none);
      for (std::size_t k = 0; k < shares.size(); ++k) rig.physics.session[k][j] = x * shares[k];
    };
    e.parameters = [=](double x) {
      Json out;
      for (std::size_t k = 0; k < shares.size(); ++k)
        out["offset_" + std::to_string(k)] = x * shares[k];
      return out;
    };
  } else if (e.name == "actuator_lag") {
    e.start = 0.006;
    e.limit = 0.04;
    e.act = [=](double x, Rig& rig) { rig.physics.lag[j] = x; };
    e.parameters = [](double x) { return Json{{"time_constant", x}}; };
  } else if (e.name == "actuator_delay") {
    e.start = 0.005;
    e.limit = 0.025;
    e.act = [=](double x, Rig& rig) { rig.physics.delay[j] = x; };
    e.parameters = [](double x) { return Json{{"delay", x}}; };
  } else {
    const double peak = s.usual.peak_torque[j];
    e.start = std::max(0.02, 0.4 * (1.0 - s.usual.high_torque[j] / peak));
    e.limit = std::max(0.02, 1.0 - s.usual.high_torque[j] / peak);
    e.act = [=](double x, Rig& rig) { rig.physics.limit[j] = peak * (1.0 - x); };
    e.parameters = [=](double x) { return Json{{"limit", peak * (1.0 - x)}}; };
  }
}

void transmission_effect(Effect& e, int j, Scene& s) {
  const double rotor = joint_of(s, j).rotor, inertia = reduced(s, j);
  if (e.name == "joint_elasticity") {
    const double ratio = s.draw.ratio(0.01, 0.15);
    const auto damping = [=](double x) { return 2.0 * ratio * std::sqrt(inertia / x); };
    const auto softness = [=](double hertz) {
      return 1.0 / (inertia * std::pow(kTurn * hertz, 2));
    };
    e.start = softness(18.0);
    e.limit = softness(6.5);
    e.act = [=](double x, Rig& rig) {
      rig.physics.transmission = {j, false, 1.0 / x, damping(x), 0.0, 0.0};
    };
    e.parameters = [=](double x) {
      return Json{{"stiffness", 1.0 / x}, {"damping", damping(x)}, {"motor_inertia", rotor}};
    };
  } else {
    const double back = s.draw.uniform(0.05, 0.5);
    e.start = 0.01 * slide(s, j);
    e.limit = 0.06 * slide(s, j);
    e.act = [=](double x, Rig& rig) { rig.physics.transmission = {j, true, 0.0, 0.0, x, back}; };
    e.parameters = [=](double x) {
      return Json{{"gap", x}, {"motor_inertia", rotor}, {"restitution", back}};
    };
  }
}

void shaft_effect(Effect& e, int j, Scene& s) {
  const bool differential = e.name == "cable_differential_friction";
  e.where = joint_of(s, j).name + "," + joint_of(s, j + 1).name;
  e.joints = {j, j + 1};
  const double ratio = s.draw.uniform(0.4, 1.0) * (differential ? 1.0 : s.draw.sign());
  const double viscous = s.draw.uniform(0.0, 0.8) / s.usual.speed[j];
  const double inertia = differential ? 0.0 : s.draw.uniform(0.2, 1.0) / s.usual.push[j];
  e.start = 0.02 * std::max(s.usual.torque[j], s.usual.torque[j + 1]);
  e.act = [=](double x, Rig& rig) {
    rig.physics.shafts.push_back({j, j + 1, ratio, x, x * viscous, x * inertia});
    if (differential) rig.physics.shafts.push_back({j, j + 1, -ratio, x, x * viscous, 0.0});
  };
  e.parameters = [=](double x) {
    Json out{{"coulomb", x}, {"viscous", x * viscous}, {"ratio", ratio}};
    if (!differential) out["armature"] = x * inertia;
    return out;
  };
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

void outside_effect(Effect& e, int j, Scene& s) {
  const std::string kind = e.name.substr(e.name.find('/') + 1);
  const Joint& joint = joint_of(s, j);
  const double torque = s.usual.torque[j], speed = s.usual.speed[j];
  const double centre = s.usual.centre[j], spread = s.usual.spread[j];
  const int n = s.arm.size(), other = (j + 1 + s.draw.index(n - 1)) % n;
  const std::string its_name = joint_of(s, other).name;
  const double its_centre = s.usual.centre[other], its_spread = s.usual.spread[other],
               its_speed = s.usual.speed[other];
  e.start = 0.03 * torque;
  using Law = std::function<double(double, const Eigen::VectorXd&, const Eigen::VectorXd&)>;
  const auto opposes = [&](const Law& law) {
    e.act = [=](double x, Rig& rig) {
      rig.physics.outside_joint = j;
      rig.physics.outside = [=](double time, const Eigen::VectorXd& q, const Eigen::VectorXd& qd) {
        return x * law(time, q, qd);
      };
    };
    e.parameters = [](double x) { return Json{{"torque", x}}; };
  };
  if (kind == "eccentric_encoder") {
    const double phase = s.draw.uniform(0.0, kTurn);
    e.joints = every(n);
    e.start = 0.03;
    e.limit = 0.2;
    e.act = [=](double x, Rig& rig) {
      rig.physics.wobble[j] = x;
      rig.physics.wobble_phase[j] = phase;
    };
    e.parameters = [=](double x) { return Json{{"wobble", x}, {"phase", phase}}; };
    e.variables = {"q_" + joint.name};
  } else if (kind == "speed_ripple") {
    const double cycles = s.draw.uniform(2.0, 4.0) / spread, phase = s.draw.uniform(0.0, kTurn);
    opposes([=](double, const auto& q, const auto& qd) {
      return qd[j] / speed * std::sin(cycles * q[j] + phase);
    });
    e.variables = {"q_" + joint.name, "qd_" + joint.name};
  } else if (kind == "hose_drag") {
    opposes([=](double, const auto&, const auto& qd) { return qd[other] / its_speed; });
    e.variables = {"qd_" + its_name};
  } else if (kind == "magnet") {
    const double at = centre + s.draw.uniform(-1.0, 1.0) * spread,
                 width = s.draw.uniform(0.15, 0.4) * spread;
    opposes([=](double, const auto& q, const auto&) {
      const double r = (q[j] - at) / width;
      return 2.0 * r / ((1.0 + r * r) * (1.0 + r * r));
    });
    e.variables = {"q_" + joint.name};
  } else if (kind == "hose_twist") {
    opposes([=](double, const auto& q, const auto&) {
      const double mine = (q[j] - centre) / spread, its = (q[other] - its_centre) / its_spread;
      return std::tanh(mine * its);
    });
    e.variables = {"q_" + joint.name, "q_" + its_name};
  } else if (kind == "soft_stops") {
    const double room = s.draw.uniform(0.5, 0.9) * spread;
    opposes([=](double, const auto& q, const auto&) {
      const double r = q[j] - centre, in = std::max(0.0, std::abs(r) - room) / spread;
      return std::copysign(in * in, r);
    });
    e.variables = {"q_" + joint.name};
  } else if (kind == "drift") {
    const double seconds = s.seconds, bend = s.draw.uniform(0.5, 3.0);
    opposes([=](double time, const auto&, const auto&) {
      return std::pow(std::clamp(time / seconds, 0.0, 1.0), bend);
    });
    e.variables = {"time"};
  } else {
    const double turn = kTurn * s.draw.ratio(1.5, 8.0), phase = s.draw.uniform(0.0, kTurn);
    opposes([=](double time, const auto&, const auto&) { return std::sin(turn * time + phase); });
    e.variables = {"time"};
  }
}

bool any(const std::string& name, std::initializer_list<const char*> list) {
  return std::ranges::any_of(list, [&](const char* item) { return name == item; });
}

}  // namespace

const std::vector<std::string>& catalogue() {
  static const std::vector<std::string> kAll{"actuator_delay",
                                             "actuator_lag",
                                             "armature",
                                             "asymmetric_coulomb",
                                             "asymmetric_viscous",
                                             "backlash",
                                             "base_tilt",
                                             "cable_differential_friction",
                                             "cogging",
                                             "coulomb_friction",
                                             "encoder_offset",
                                             "encoder_scale",
                                             "joint_elasticity",
                                             "joint_spring",
                                             "load_friction",
                                             "payload",
                                             "presliding_dahl",
                                             "presliding_lugre",
                                             "quadratic_friction",
                                             "saturation",
                                             "session_offset",
                                             "stribeck_friction",
                                             "sublinear_friction",
                                             "time_shift",
                                             "tip_force",
                                             "torque_gain",
                                             "torque_offset",
                                             "transmission_coupling",
                                             "velocity_filter_lag",
                                             "viscous_friction",
                                             "warm_up"};
  return kAll;
}

const std::vector<std::string>& outside_effects() {
  static const std::vector<std::string> kAll{"outside/speed_ripple", "outside/hose_drag",
                                             "outside/magnet",       "outside/hose_twist",
                                             "outside/soft_stops",   "outside/drift",
                                             "outside/mains_ripple", "outside/eccentric_encoder"};
  return kAll;
}

Effect make_effect(const std::string& name, int j, Scene& s) {
  Effect e;
  e.name = name;
  e.where = joint_of(s, j).name;
  e.joints = {j};
  if (any(name, {"coulomb_friction", "asymmetric_coulomb", "stribeck_friction",
                 "sublinear_friction", "load_friction"}))
    dry_effect(e, j, s);
  else if (any(name, {"presliding_dahl", "presliding_lugre"}))
    bristle_effect(e, j, s);
  else if (any(name, {"viscous_friction", "asymmetric_viscous", "quadratic_friction", "warm_up",
                      "armature", "joint_spring", "cogging"}))
    smooth_effect(e, j, s);
  else if (any(name, {"torque_gain", "torque_offset", "session_offset", "actuator_lag",
                      "actuator_delay", "saturation"}))
    drive_effect(e, j, s);
  else if (any(name, {"joint_elasticity", "backlash"}))
    transmission_effect(e, j, s);
  else if (any(name, {"cable_differential_friction", "transmission_coupling"}))
    shaft_effect(e, j, s);
  else if (any(name, {"encoder_offset", "encoder_scale", "time_shift", "velocity_filter_lag"}))
    sensor_effect(e, j, s);
  else if (any(name, {"base_tilt", "tip_force", "payload"}))
    body_effect(e, s);
  else if (name.starts_with("outside/"))
    outside_effect(e, j, s);
  else
    throw std::invalid_argument("no effect '" + name + "'");
  return e;
}

Effect common_gain(Scene& s) {
  Effect e;
  e.name = "torque_gain";
  e.where = "all";
  e.joints = every(s.arm.size());
  const double sign = s.draw.sign();
  e.start = 0.03;
  e.limit = 0.3;
  e.act = [=](double x, Rig& rig) { rig.physics.gain.setConstant(sign * x); };
  e.parameters = [=](double x) { return Json{{"gain_error", sign * x}}; };
  return e;
}

}  // namespace rigs
