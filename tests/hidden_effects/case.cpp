#include "case.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include <Eigen/LU>

namespace hidden {
namespace {

const std::vector<std::string> kJointEffects{"coulomb_friction",
                                             "viscous_friction",
                                             "quadratic_friction",
                                             "stribeck_friction",
                                             "asymmetric_coulomb",
                                             "asymmetric_viscous",
                                             "sublinear_friction",
                                             "load_friction",
                                             "presliding_dahl",
                                             "presliding_lugre",
                                             "armature",
                                             "joint_spring",
                                             "cogging",
                                             "torque_gain",
                                             "torque_offset",
                                             "joint_elasticity",
                                             "backlash",
                                             "actuator_lag",
                                             "actuator_delay",
                                             "saturation",
                                             "cable_differential_friction",
                                             "transmission_coupling",
                                             "encoder_offset",
                                             "encoder_scale",
                                             "time_shift",
                                             "base_tilt",
                                             "tip_force",
                                             "payload",
                                             "warm_up",
                                             "velocity_filter_lag"};

/// Effects that are told from each other even at one robot.
const std::vector<std::string> kForSets{
    "coulomb_friction", "viscous_friction", "quadratic_friction", "armature",      "joint_spring",
    "cogging",          "torque_offset",    "asymmetric_viscous", "actuator_delay"};

bool one_of(const std::string& x, std::initializer_list<const char*> list) {
  return std::ranges::any_of(list, [&](const char* item) { return x == item; });
}

/// Robots in which the effect can be seen.
std::vector<std::string> robots_for(const std::string& effect) {
  if (one_of(effect, {"encoder_offset", "base_tilt"})) return {"arm4", "arm6"};
  if (one_of(effect, {"cable_differential_friction", "transmission_coupling"}))
    return {"planar2", "arm4", "arm6"};
  if (one_of(effect, {"armature", "torque_gain", "encoder_scale", "time_shift", "tip_force",
                      "payload", "neighbour_cable"}))
    return {"planar2", "arm4", "arm4", "arm6"};
  return {"planar2", "planar2", "arm4", "arm4", "arm4", "arm6", "arm6", "slider"};
}

/// Joints at which the effect can be seen.
std::vector<int> joints_for(const std::string& effect, const Robot& robot) {
  const int n = robot.num_joints();
  if (effect == "cable_differential_friction") return {n == 2 ? 0 : 1};
  if (effect == "transmission_coupling") return {n - 2};
  int first = 0, last = n - 1;
  // Before, the links' own inertia takes it up.
  if (effect == "armature") first = robot.first_is_vertical ? 2 : 1;
  if (effect == "encoder_offset") first = 1, last = n - 2;
  std::vector<int> out(static_cast<std::size_t>(last - first + 1));
  std::iota(out.begin(), out.end(), first);
  return out;
}

/// Effects that grow with frequency need motion that is fast.
std::vector<double> periods_for(const std::string& effect) {
  if (one_of(effect, {"joint_elasticity"})) return {1.6, 2.0, 2.5};
  if (one_of(effect, {"backlash", "actuator_lag", "actuator_delay", "time_shift"}))
    return {1.6, 2.5, 5.0, 10.0};
  return {10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 5.0, 5.0, 2.5, 20.0};
}

bool declares_own_friction(const std::string& effect) {
  return one_of(effect, {"stribeck_friction", "load_friction", "position_friction"});
}

Series quiet_run(const World& world, const Motion& motion, const Case& c) {
  SimulationOptions o;
  o.rate = c.rate;
  o.duration = std::max(c.period, 5.0);
  return simulate(world, motion, o);
}

Scales scales_of(const Series& s, const Robot& robot) {
  Scales out;
  out.torque = rms(s.tau);
  out.velocity = rms(s.qd);
  out.acceleration = rms(s.mean_qdd);
  out.centre = s.q.colwise().mean();
  out.position = rms(s.q.rowwise() - out.centre.transpose());
  // What a joint feels while the others move freely.
  const Eigen::Index n = s.q.cols();
  Inverse inverse(robot);
  Eigen::MatrixXd mass(n, n);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(n);
  const Eigen::VectorXd gravity = inverse.torque(out.centre, zero, zero);
  for (Eigen::Index j = 0; j < n; ++j)
    mass.col(j) = inverse.torque(out.centre, zero, Eigen::VectorXd::Unit(n, j)) - gravity;
  out.inertia = mass.inverse().diagonal().cwiseInverse();
  return out;
}

/// Friction and rotors that the model knows of, with wrong numbers.
void declare(Robot& robot, const Scales& s, Rng& rng) {
  for (int j = 0; j < robot.num_joints(); ++j) {
    Link& link = robot.links[static_cast<std::size_t>(j)];
    link.coulomb = rng.uniform(0.02, 0.08) * s.torque[j];
    link.damping = rng.uniform(0.02, 0.08) * s.torque[j] / s.velocity[j];
    link.armature = rng.uniform(0.1, 0.5) * s.inertia[j];
  }
}

void declare_for(const std::string& effect, int joint, Robot& robot, const Scales& s, Rng& rng) {
  Link& link = robot.links[static_cast<std::size_t>(joint)];
  if (one_of(effect, {"joint_elasticity", "backlash"}))
    link.armature = rng.uniform(0.3, 1.0) * s.inertia[joint];
  else if (effect == "armature")
    link.armature = 0.0;
  else if (declares_own_friction(effect)) {
    link.coulomb = rng.uniform(0.08, 0.15) * s.torque[joint];
    link.damping = rng.uniform(0.0, 0.05) * s.torque[joint] / s.velocity[joint];
  } else if (is_friction(effect)) {
    link.coulomb = link.damping = 0.0;
  }
}

double size_of(const World& world, const Series& series, const Case& c, const Mechanism& h) {
  const Eigen::VectorXd share = effect_share(world, series, c.rate);
  double largest = 0.0;
  for (const int j : h.joints) largest = std::max(largest, share[j]);
  return largest;
}

/// Scales a mechanism until it makes up `target` of its joint's torque, as far as it may go: secant
/// steps in the logarithms, one period each, halved where they leave what is known to be too weak
/// and too strong.
void scale_to(double target, const Mechanism& unscaled, std::size_t index, const Motion& motion,
              Case& c) {
  World alone = c.world;
  alone.hidden = {unscaled};
  Mechanism& h = alone.hidden[0];
  double strength = std::min(h.start, h.limit), slope = 1.0, best_gap = 1e9;
  double weak = 0.0, weak_size = 0.0, strong = h.limit, strong_size = 0.0;
  c.world.hidden[index].strength = strength;
  for (int i = 0; i < 12; ++i) {
    h.strength = strength;
    double size = std::numeric_limits<double>::infinity();
    try {
      size = size_of(alone, quiet_run(alone, motion, c), c, h);
    } catch (const std::runtime_error&) {  // too strong to follow the motion
    }
    const double gap = std::abs(std::log(std::max(size, 1e-12) / target));
    if (gap < best_gap) {
      best_gap = gap;
      c.world.hidden[index].strength = strength;
    }
    if (gap < 0.1 || (size < target && strength == h.limit)) return;
    (size < target ? weak : strong) = strength;
    (size < target ? weak_size : strong_size) = size;
    const bool bracketed = weak_size > 0.0 && strong_size > 0.0 && std::isfinite(strong_size);
    if (bracketed) slope = std::log(strong_size / weak_size) / std::log(strong / weak);
    double next =
        strength * std::clamp(std::pow(target / std::max(size, 1e-9), 1.0 / slope), 0.1, 50.0);
    // Every second step at least halves a bracket that the secant does not close.
    if (weak > 0.0 && (!(next > weak && next < strong) || (i % 2 == 1 && std::isfinite(strong))))
      next = std::isfinite(strong) ? std::sqrt(weak * strong) : 10.0 * weak;
    strength = std::min(next, h.limit);
  }
}

/// Of both signs for a tenth of the time at least.
bool changes_sign(const Eigen::VectorXd& torque) {
  const double positive =
      static_cast<double>((torque.array() > 0.0).count()) / static_cast<double>(torque.size());
  return positive > 0.1 && positive < 0.9;
}

}  // namespace

std::vector<std::string> families() {
  std::vector<std::string> out{"none"};
  out.insert(out.end(), kJointEffects.begin(), kJointEffects.end());
  for (const char* more : {"absorbed", "outside", "two", "three"}) out.emplace_back(more);
  return out;
}

Eigen::VectorXd rms(const Eigen::MatrixXd& padded) {
  const Eigen::Index rows = padded.rows() - 2 * kPad;
  return (padded.middleRows(kPad, rows).colwise().squaredNorm() / static_cast<double>(rows))
      .cwiseSqrt();
}

Eigen::MatrixXd decimate(const Eigen::MatrixXd& padded, double rate) {
  const Eigen::Index every = std::max<Eigen::Index>(1, std::lround(rate / 50.0));
  Eigen::MatrixXd out((padded.rows() - 2 * kPad) / every, padded.cols());
  for (Eigen::Index k = 0; k < out.rows(); ++k)
    out.row(k) = padded.middleRows(kPad + k * every, every).colwise().mean();
  return out;
}

Eigen::VectorXd effect_share(const World& world, const Series& s, double rate) {
  const Eigen::MatrixXd effect = decimate(effect_torque(world, s), rate);
  const Eigen::VectorXd root_mean_square =
      (effect.colwise().squaredNorm() / static_cast<double>(effect.rows())).cwiseSqrt();
  return root_mean_square.cwiseQuotient(rms(s.tau));
}

Eigen::MatrixXd effect_torque(const World& world, const Series& s) {
  double delay = 0.0;
  for (const Mechanism& h : world.hidden)
    if (h.position_delay) delay += h.position_delay(h.strength);
  if (delay == 0.0) return s.tau - s.needed;
  const double shift = delay / (s.time[1] - s.time[0]);
  Eigen::MatrixXd late(s.needed.rows(), s.needed.cols());
  for (Eigen::Index k = 0; k < late.rows(); ++k) {
    const double at = std::clamp(static_cast<double>(k) - shift, 0.0,
                                 static_cast<double>(late.rows() - 1) - 1e-9);
    const auto i = static_cast<Eigen::Index>(at);
    const double part = at - static_cast<double>(i);
    late.row(k) = (1.0 - part) * s.needed.row(i) + part * s.needed.row(i + 1);
  }
  return s.tau - late;
}

Case draw_case(std::uint64_t seed, const std::string& given, const CaseOptions& o) {
  const std::vector<std::string> all = families();
  Case c;
  c.seed = seed;
  c.rate = o.rate;
  c.duration = o.duration;
  c.repeats = o.repeats;
  c.family = given.empty() ? Rng(seed, kFamily).one_of(all) : given;
  const auto family = std::ranges::find(all, c.family);
  if (family == all.end()) {
    std::string list;
    for (const std::string& f : all) list += (list.empty() ? "" : ", ") + f;
    throw std::invalid_argument("no family '" + c.family + "'; there are " + list);
  }
  // Other robots in every family, though the seed be the same.
  c.stream = 100 * static_cast<std::uint64_t>(family - all.begin() + 1);
  Rng rng(seed, c.stream + kDraw);

  // What is hidden, before it has numbers.
  std::vector<std::string> effects;
  std::string robot;
  if (c.family == "none") {
    c.kind = "none";
    robot = rng.one_of(robots_for("coulomb_friction"));
  } else if (c.family == "two" || c.family == "three") {
    c.kind = "named";
    const bool three = c.family == "three";
    robot = rng.one_of(three ? std::vector<std::string>{"arm4", "arm6"}
                             : std::vector<std::string>{"planar2", "arm4", "arm4", "arm6"});
    std::vector<std::string> left = kForSets;
    for (int i = 0; i < (three ? 3 : 2); ++i) {
      const auto at = static_cast<std::size_t>(rng.below(static_cast<int>(left.size())));
      effects.push_back(left[at]);
      left.erase(left.begin() + static_cast<std::ptrdiff_t>(at));
    }
  } else if (c.family == "absorbed") {
    c.kind = "absorbed";
    effects = {rng.one_of(
        std::vector<std::string>{"armature", "encoder_offset", "payload", "torque_gain"})};
    robot = rng.one_of(std::vector<std::string>{"arm4", "arm6"});
  } else if (c.family == "outside") {
    c.kind = "unknown";
    effects = {rng.one_of(outside_kinds())};
    robot = rng.one_of(robots_for(effects[0]));
  } else {
    c.kind = c.family == "velocity_filter_lag" ? "audit" : "named";
    effects = {c.family};
    robot = rng.one_of(robots_for(c.family));
  }
  if (c.family == "payload") c.base = "fixed";

  c.world.robot = draw_robot(robot, rng);
  c.period = rng.one_of(periods_for(effects.empty() ? "" : effects[0]));
  const int n = c.world.robot.num_joints();

  // Where: joints that differ.
  std::vector<int> joints;
  for (const std::string& effect : effects) {
    std::vector<int> free = joints_for(effect, c.world.robot);
    std::erase_if(free, [&](int j) { return std::ranges::count(joints, j) > 0; });
    if (c.kind == "absorbed")
      free = effect == "encoder_offset" ? std::vector<int>{0, n - 1}
             : effect == "armature"     ? std::vector<int>{0, 1}
                                        : std::vector<int>{0};
    joints.push_back(rng.one_of(free));
  }

  const Motion motion(c.world.robot, c.period, Rng(seed, c.stream + kTrainMotion), c.repeats);
  c.world.nominal = c.world.robot;
  const Series quiet = quiet_run(c.world, motion, c);
  // A gap that the torque never crosses is none to be found.
  for (std::size_t i = 0; i < effects.size(); ++i) {
    if (effects[i] != "backlash") continue;
    std::vector<int> crossed = joints_for(effects[i], c.world.robot);
    std::erase_if(crossed, [&](int j) { return !changes_sign(quiet.tau.col(j)); });
    if (!crossed.empty()) joints[i] = rng.one_of(crossed);
  }
  Scales scales = scales_of(quiet, c.world.robot);
  if (rng.chance(0.3)) declare(c.world.robot, scales, rng);
  for (std::size_t i = 0; i < effects.size(); ++i)
    declare_for(effects[i], joints[i], c.world.robot, scales, rng);
  c.world.coulomb_width = rng.log_uniform(0.003, 0.015);
  for (int j = 0; j < n; ++j) {
    const Link& link = c.world.robot.links[static_cast<std::size_t>(j)];
    c.world.coulomb_width =
        std::max(c.world.coulomb_width,
                 link.coulomb / (1500.0 * scales.inertia[j]) * (link.slide ? 10.0 : 1.0));
  }
  c.world.nominal = c.base == "fixed" ? c.world.robot : nominal_of(c.world.robot, rng);
  scales = scales_of(quiet_run(c.world, motion, c), c.world.robot);

  const Draw draw{c.world.robot, scales, rng};
  for (std::size_t i = 0; i < effects.size(); ++i)
    c.world.hidden.push_back(c.kind == "absorbed" && effects[i] == "torque_gain"
                                 ? common_torque_gain(draw)
                                 : mechanism(effects[i], joints[i], draw));
  for (std::size_t i = 0; i < effects.size(); ++i) {
    const double target = rng.log_uniform(o.smallest, o.largest);
    const Mechanism unscaled = c.world.hidden[i];
    if (unscaled.velocity_lag)
      c.world.hidden[i].strength = unscaled.start;
    else
      scale_to(target, unscaled, i, motion, c);
  }

  Sensors& s = c.sensors;
  s.torque_noise = o.noise;
  if (rng.chance(0.2)) s.corner = rng.log_uniform(15.0, 100.0);
  if (rng.chance(0.15)) s.torque_step = rng.uniform(0.3, 1.0);
  s.position_noise.setZero(n);
  s.position_step.setZero(n);
  const double position_noise = rng.log_uniform(2e-5, 1e-4);
  const double turn = rng.chance(0.3) ? std::exp2(-rng.uniform(17.0, 20.0)) * 6.283185307 : 0.0;
  for (int j = 0; j < n; ++j) {
    const double unit =
        o.position_noise * (c.world.robot.links[static_cast<std::size_t>(j)].slide ? 0.1 : 1.0);
    s.position_noise[j] = unit * position_noise;
    s.position_step[j] = unit * turn;
  }
  s.velocities = c.kind == "audit" || rng.chance(0.3);
  return c;
}

}  // namespace hidden
