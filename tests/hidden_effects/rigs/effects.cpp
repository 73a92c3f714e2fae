#include "effects.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "effects_detail.hpp"

namespace rigs {
namespace {

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
    // A strength of 1 limits at what the motion asks for at most; feedback asks for more.
    const double peak = s.usual.peak_torque[j], high = s.usual.high_torque[j];
    const auto limit = [=](double x) { return peak * std::pow(x, -0.25); };
    e.start = std::pow(peak / (0.4 * high + 0.6 * peak), 4.0);
    e.limit = std::pow(peak / high, 4.0);
    e.act = [=](double x, Rig& rig) { rig.physics.limit[j] = limit(x); };
    e.parameters = [=](double x) { return Json{{"limit", limit(x)}}; };
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
