#include "case.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include <Eigen/LU>

namespace rigs {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Effects that are told from each other even at one machine.
const std::vector<std::string> kForSets{
    "coulomb_friction",   "viscous_friction", "quadratic_friction", "armature",
    "joint_spring",       "cogging",          "torque_offset",      "asymmetric_viscous",
    "sublinear_friction", "actuator_delay",   "actuator_lag"};

bool any(const std::string& name, std::initializer_list<const char*> list) {
  return std::ranges::any_of(list, [&](const char* item) { return name == item; });
}

bool is_fast(const std::string& effect) {
  return any(effect, {"joint_elasticity", "backlash", "actuator_lag", "actuator_delay",
                      "time_shift", "armature"});
}

bool needs_rotor(const std::string& effect) {
  return any(effect, {"joint_elasticity", "backlash"});
}

std::string draw_kind(const std::string& effect, Draw& draw) {
  const double u = draw.uniform();
  if (any(effect,
          {"encoder_offset", "encoder_scale", "base_tilt", "tip_force", "payload", "torque_gain",
           "time_shift", "armature", "cable_differential_friction", "transmission_coupling",
           "outside/hose_drag", "outside/hose_twist", "outside/eccentric_encoder"}))
    return "arm";
  if (any(effect, {"", "coulomb_friction", "viscous_friction", "quadratic_friction"}) && u < 0.12)
    return "pendulum";
  return u > 0.88 ? "gantry" : "arm";
}

int draw_joint(const std::string& effect, const Case& c, const std::vector<int>& taken,
               Draw& draw) {
  const Arm& arm = c.rig.arm;
  const int n = arm.size();
  int first = 0, last = n - 1;
  if (any(effect, {"cable_differential_friction", "transmission_coupling"})) last = n - 2;
  if (effect == "armature") first = std::min(n - 1, 2);
  if (effect == "encoder_offset") first = std::min(1, n - 1), last = std::max(first, n - 2);
  std::vector<int> free;
  for (int j = first; j <= last; ++j)
    if (!arm.joints[static_cast<std::size_t>(j)].passive ||
        any(effect, {"coulomb_friction", "viscous_friction", "quadratic_friction"}))
      if (std::ranges::count(taken, j) == 0) free.push_back(j);
  if (free.empty()) throw std::runtime_error("no joint is left for " + effect);
  if (effect != "backlash") return draw.pick(free);
  return *std::ranges::min_element(
      free, [&](int a, int b) { return c.usual.balance[a] < c.usual.balance[b]; });
}

/// Hanging position of a joint without a drive.
double hanging(const Arm& arm) {
  Rigid rigid(arm);
  const VectorXd zero = VectorXd::Zero(2);
  double lowest = 0.0, pull_before = 0.0;
  for (int i = 0; i <= 720; ++i) {
    const double x = static_cast<double>(i) * 0.01;
    rigid.evaluate(Eigen::Vector2d(0.0, x), zero);
    const double pull = rigid.bias()[1];
    if (i > 0 && pull_before < 0.0 && pull >= 0.0) lowest = x;
    pull_before = pull;
  }
  return lowest;
}

/// Along the motions that are asked for: nothing is simulated.
Usual usual_of(const Case& c, std::uint64_t seed) {
  const Index n = c.rig.arm.size();
  Rigid rigid(c.rig.arm);
  std::vector<VectorXd> q, torque;
  Usual out;
  out.torque.setZero(n);
  out.speed = out.push = out.centre = out.spread = out.peak_torque = out.torque;
  VectorXd total = out.torque;
  for (std::size_t r = 0; r < c.runs.size(); ++r) {
    const Motion motion(c.rig.arm, c.plan, c.runs[r], Draw(seed, c.stream + kTrain + kStreams * r));
    for (double time = 0.0; time < c.runs[r]; time += 0.02) {
      const Desired d = motion.at(time);
      VectorXd tau = rigid.torque(d.q, d.qd, d.qdd);
      for (Index j = 0; j < n; ++j)
        tau[j] += c.rig.arm.joints[static_cast<std::size_t>(j)].rotor * d.qdd[j];
      q.push_back(d.q);
      torque.push_back(tau);
      total += tau;
      out.centre += d.q;
      out.torque += tau.cwiseAbs2();
      out.speed += d.qd.cwiseAbs2();
      out.push += d.qdd.cwiseAbs2();
      out.peak_torque = out.peak_torque.cwiseMax(tau.cwiseAbs());
    }
  }
  const auto count = static_cast<double>(q.size());
  out.centre /= count;
  for (const VectorXd& x : q) out.spread += (x - out.centre).cwiseAbs2();
  for (VectorXd* x : {&out.torque, &out.speed, &out.push, &out.spread})
    *x = (*x / count).cwiseSqrt();
  out.balance = (total / count).cwiseAbs().cwiseQuotient(out.torque.cwiseMax(1e-12));
  out.high_torque.setZero(n);
  for (Index j = 0; j < n; ++j) {
    std::vector<double> sizes;
    for (const VectorXd& x : torque) sizes.push_back(std::abs(x[j]));
    const auto at = sizes.begin() + static_cast<std::ptrdiff_t>(5 * sizes.size() / 6);
    std::nth_element(sizes.begin(), at, sizes.end());
    out.high_torque[j] = *at;
    if (!c.rig.arm.joints[static_cast<std::size_t>(j)].passive) continue;
    // It is not led: a swing of half a radian about where it hangs.
    Eigen::VectorXd away = out.centre;
    away[j] += 0.5;
    out.torque[j] =
        std::abs(rigid.torque(away, VectorXd::Zero(n), VectorXd::Zero(n))[j]) / std::sqrt(2.0);
    out.speed[j] = 1.0, out.push[j] = 5.0, out.spread[j] = 0.35;
  }
  rigid.evaluate(out.centre, VectorXd::Zero(n));
  MatrixXd inertia = rigid.inertia();
  for (Index j = 0; j < n; ++j)
    inertia(j, j) += c.rig.arm.joints[static_cast<std::size_t>(j)].rotor;
  out.inertia = inertia.inverse().diagonal().cwiseInverse();
  return out;
}

void draw_motion(Case& c, const std::string& effect, const CaseOptions& o, Draw& draw) {
  const bool fast = is_fast(effect), long_one = any(effect, {"warm_up", "outside/drift"});
  const double u = draw.uniform();
  c.layout = u < 0.6 ? "one" : u < 0.82 ? "several" : "heap";
  if (effect == "session_offset") c.layout = "several";
  if (long_one || o.duration > 0.0) c.layout = effect == "session_offset" ? "several" : "one";
  if (c.layout == "one") {
    c.runs = {o.duration > 0.0 ? o.duration : draw.ratio(long_one ? 25.0 : 8.0, 60.0)};
  } else if (c.layout == "several") {
    const int count = effect == "session_offset" ? 3 + draw.index(3) : 2 + draw.index(3);
    for (int i = 0; i < count; ++i) c.runs.push_back(draw.uniform(4.0, 10.0));
  } else {
    const double total = draw.uniform(8.0, 25.0);
    for (double sum = 0.0; sum < total; sum += c.runs.back())
      c.runs.push_back(draw.uniform(0.5, 3.0));
  }
  // Whole means of 20 ms.
  for (double& seconds : c.runs) seconds = 0.02 * std::round(seconds / 0.02);
  MotionPlan& p = c.plan;
  const double v = draw.uniform();
  p.kind = v < 0.55 ? "multisine" : v < 0.85 ? "points" : "chirp";
  if (p.kind == "chirp" && c.layout == "heap") p.kind = "points";
  p.waves = draw.pick(std::vector<int>{2, 3, 4, 8, 12});
  if (p.kind == "multisine" && c.layout == "one" && o.repeats && draw.chance(0.6)) {
    p.period = 0.02 * std::round(draw.uniform(3.0, 10.0) / 0.02);
    if (o.duration == 0.0) c.runs[0] = std::max(c.runs[0], 3.0 * p.period);
    p.period = std::min(p.period, c.runs[0] / 2.5);
  }
  p.fastest = fast ? draw.uniform(2.5, 5.0) : draw.uniform(0.6, 2.5);
  p.push = fast ? draw.uniform(15.0, 40.0) : draw.uniform(5.0, 20.0);
  p.speed = draw.uniform(1.0, 3.0);
  p.reach = draw.uniform(0.4, 1.2);
  p.smooth = draw.chance(0.6);
  const int n = c.rig.arm.size();
  p.centre.resize(n);
  for (int j = 0; j < n; ++j)
    p.centre[j] =
        c.rig.arm.joints[static_cast<std::size_t>(j)].slide ? 0.0 : draw.uniform(-1.2, 1.2);
  if (c.rig.arm.kind == "pendulum") p.centre[1] = hanging(c.rig.arm);
  const std::vector<double> rates = fast || effect.starts_with("presliding")
                                        ? std::vector<double>{250.0, 500.0, 1000.0}
                                        : std::vector<double>{50.0, 100.0, 250.0, 500.0, 1000.0};
  c.rate = draw.pick(rates);
}

void draw_control(Case& c, const std::string& effect, Draw& draw) {
  Control& control = c.rig.control;
  control.computed_torque = draw.chance(0.4) && c.rig.arm.kind != "pendulum";
  control.knows_gravity = draw.chance(0.7) && c.rig.arm.kind != "pendulum";
  // A command that changes within a row would be logged too early: ticks are whole rows, or
  // shorter.
  do control.rate = draw.pick({200.0, 250.0, 500.0, 1000.0, 1000.0});
  while (control.rate < c.rate && std::fmod(c.rate, control.rate) != 0.0);
  control.bandwidth = draw.uniform(8.0, 20.0);
  control.velocity_filter = draw.uniform(30.0, 60.0);
  if (is_fast(effect)) control.bandwidth = draw.uniform(8.0, 14.0);
  // Drives that are late, and slow ticks, bear no more.
  if (control.rate < 300.0) control.bandwidth = std::min(control.bandwidth, 12.0);
  c.rig.controller = misjudged(c.rig.arm, 0.05, 0.25, draw);
  const bool ticks_between_rows = control.rate > 1.01 * c.rate;
  c.sensors.middle = ticks_between_rows && draw.chance(0.5);
  c.sensors.centred = ticks_between_rows;
}

void draw_sensors(Case& c, const std::string& effect, const CaseOptions& o, Draw& draw) {
  Sensors& s = c.sensors;
  const int n = c.rig.arm.size();
  s.torque_noise = draw.ratio(0.003, 0.05);
  if (o.noise > 0.0) s.torque_noise = o.noise;
  if (draw.chance(0.3)) s.corner = draw.ratio(8.0, 80.0);
  s.position_step.setZero(n);
  s.position_noise.setZero(n);
  const bool fast = is_fast(effect) || effect.starts_with("presliding");
  const double step = draw.ratio(2e-5, fast ? 1e-4 : 5e-4);
  const double noise = draw.chance(0.5) ? draw.uniform(0.2, 1.0) : 0.0;
  for (int j = 0; j < n; ++j) {
    const double unit = c.rig.arm.joints[static_cast<std::size_t>(j)].slide ? 0.2 : 1.0;
    s.position_step[j] = unit * step;
    s.position_noise[j] = noise * unit * step;
  }
  if (!fast && draw.chance(0.12))
    (draw.chance(0.5) ? s.slow_positions : s.slow_torques) = 2 + draw.index(3);
  // Values of 30 ms ago and more are another fault than a slow sensor.
  if (c.rate < 250.0) s.slow_positions = s.slow_torques = 1;
  if (draw.chance(0.2)) s.jitter = draw.uniform(0.01, 0.06);
  if (draw.chance(0.2)) {
    s.constant.resize(n);
    for (int j = 0; j < n; ++j) s.constant[j] = draw.ratio(2.0, 30.0);
  }
  s.velocities = effect == "velocity_filter_lag" || draw.chance(0.25);
  s.commands = draw.chance(0.4);
  c.rig.motor_noise_band = draw.ratio(5.0, 80.0);
  const double share = draw.ratio(0.0005, 0.006);
  c.rig.motor_noise = share * c.usual.torque;
  for (int j = 0; j < n; ++j)
    if (c.rig.arm.joints[static_cast<std::size_t>(j)].passive) c.rig.motor_noise[j] = 0.0;
}

}  // namespace

std::vector<std::string> families() {
  std::vector<std::string> out{"none"};
  out.insert(out.end(), catalogue().begin(), catalogue().end());
  out.insert(out.end(), {"absorbed", "outside", "two", "three"});
  return out;
}

Case draw_case(std::uint64_t seed, int attempt, const std::string& given, const CaseOptions& o) {
  const std::vector<std::string> all = families();
  Case c;
  c.seed = seed;
  c.family = given.empty() ? Draw(seed, 0).pick(all) : given;
  const auto family = std::ranges::find(all, c.family);
  if (family == all.end()) {
    std::string list;
    for (const std::string& f : all) list += (list.empty() ? "" : ", ") + f;
    throw std::invalid_argument("no family '" + c.family + "'; there are " + list);
  }
  // A stream has room for kStreams numbers of 4096 runs.
  c.stream = (static_cast<std::uint64_t>(family - all.begin()) * 64 +
              static_cast<std::uint64_t>(attempt) + 1)
             << 16U;
  Draw draw(seed, c.stream + kWhat);

  std::vector<std::string> names;
  c.kind = "named";
  if (c.family == "none") {
    c.kind = "none";
  } else if (c.family == "two" || c.family == "three") {
    std::vector<std::string> left = kForSets;
    for (int i = 0; i < (c.family == "two" ? 2 : 3); ++i) {
      const auto at = draw.index(static_cast<int>(left.size()));
      names.push_back(left[static_cast<std::size_t>(at)]);
      left.erase(left.begin() + at);
    }
  } else if (c.family == "absorbed") {
    c.kind = "absorbed";
    names = {draw.pick(
        std::vector<std::string>{"armature", "encoder_offset", "payload", "torque_gain"})};
  } else if (c.family == "outside") {
    c.kind = "unknown";
    names = {draw.pick(outside_effects())};
  } else {
    names = {c.family};
    if (c.family == "velocity_filter_lag") c.kind = "audit";
  }
  if (c.family == "payload") c.base = "fixed";
  const std::string first = names.empty() ? "" : names[0];
  const bool absorbed = c.kind == "absorbed";

  // The machine.
  const std::string kind = names.size() > 1 || absorbed ? "arm" : draw_kind(first, draw);
  int least = 2;
  if (any(first, {"encoder_offset", "armature", "torque_gain", "encoder_scale"})) least = 3;
  if (names.size() > 1) least = static_cast<int>(names.size()) + 1;
  const int n = least + draw.index(8 - least);
  const bool level = absorbed || any(first, {"base_tilt", "tip_force"});
  do c.rig.arm = draw_arm(kind, n, level, draw);
  while (absorbed && !c.rig.arm.first_is_upright());
  c.usual = Usual();
  draw_motion(c, first, o, draw);
  c.rig.physics = Physics(c.rig.arm.size());
  Arm& arm = c.rig.arm;
  c.usual = usual_of(c, seed);
  const bool rotors = needs_rotor(first) || draw.chance(0.35);
  const bool friction = draw.chance(0.4);
  for (int j = 0; j < arm.size(); ++j) {
    Joint& joint = arm.joints[static_cast<std::size_t>(j)];
    if (rotors && first != "armature" && !joint.passive)
      joint.rotor = draw.uniform(0.1, 0.6) * c.usual.inertia[j];
    const double dry = draw.uniform(0.02, 0.08), wet = draw.uniform(0.02, 0.08);
    if (friction || joint.passive) {
      if (!joint.passive) joint.coulomb = dry * c.usual.torque[j];
      joint.viscous = wet * c.usual.torque[j] / c.usual.speed[j];
    }
  }
  c.usual = usual_of(c, seed);
  std::vector<int> joints;
  for (const std::string& name : names) {
    int j = draw_joint(name, c, joints, draw);
    if (absorbed) j = name == "encoder_offset" ? arm.size() - 1 : 0;
    joints.push_back(j);
    Joint& joint = arm.joints[static_cast<std::size_t>(j)];
    if (any(name, {"stribeck_friction", "load_friction"}) && joint.coulomb == 0.0)
      joint.coulomb = draw.uniform(0.03, 0.08) * c.usual.torque[j];
    if (any(name, {"coulomb_friction", "asymmetric_coulomb", "presliding_dahl", "presliding_lugre",
                   "sublinear_friction"}))
      joint.coulomb = 0.0;
    if (any(name, {"viscous_friction", "asymmetric_viscous", "warm_up"}) && !joint.passive)
      joint.viscous = 0.0;
    if (absorbed) joint.coulomb = joint.viscous = joint.rotor = 0.0;
  }
  if (absorbed && first == "torque_gain")
    for (Joint& joint : arm.joints) joint.coulomb = joint.viscous = joint.rotor = 0.0;
  c.nominal = c.base == "fixed" ? arm : misjudged(arm, 0.05, 0.25, draw);
  c.urdf = !rotors && draw.chance(0.5);
  if (draw.chance(0.4)) c.rig.physics.bristle_width = draw.ratio(1e-5, 5e-5);
  c.rig.motor_encoder = draw.chance(0.5);
  draw_control(c, first, draw);
  c.usual = usual_of(c, seed);
  draw_sensors(c, first, o, draw);

  // The effects, one after the other by itself, then all together.
  Scene scene{c.rig.arm, c.usual, c.runs[0], static_cast<int>(c.runs.size()), draw};
  for (std::size_t i = 0; i < names.size(); ++i) {
    c.effects.push_back(absorbed && names[i] == "torque_gain"
                            ? common_gain(scene)
                            : make_effect(names[i], joints[i], scene));
    // A size along a part of a recording is up to a fifth off in the whole.
    c.targets.push_back(draw.ratio(1.2 * o.smallest, std::max(1.2 * o.smallest, o.largest / 1.2)));
  }
  for (std::size_t i = 0; i < names.size(); ++i)
    if (c.kind != "audit") scale_effect(c, i, c.targets[i]);
  return c;
}

}  // namespace rigs
