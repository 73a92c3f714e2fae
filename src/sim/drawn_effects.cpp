#include "sim/drawn_effects.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/forward_dynamics.hpp>

namespace diffnea::sim {
namespace {

/// Effects with memory that sim/pack_drives.hpp simulates.
bool is_of_drives(const BoundEffect& e) {
  return std::holds_alternative<JointElasticity>(e.type) ||
         std::holds_alternative<PreslidingDahl>(e.type) ||
         std::holds_alternative<PreslidingLugre>(e.type) ||
         std::holds_alternative<ActuatorDelay>(e.type) ||
         std::holds_alternative<ActuatorLag>(e.type) || std::holds_alternative<Saturation>(e.type);
}

/// @throws ModelError if a joint has two springs
MotorShares motor_shares(const Model& model, const std::vector<BoundEffect>& drives) {
  MotorShares out(joint_names(model).size(), -1.0);
  for (const BoundEffect& e : drives)
    if (std::holds_alternative<JointElasticity>(e.type))
      for (const int j : e.joints) {
        double& share = out[static_cast<std::size_t>(j)];
        if (share >= 0.0)
          throw ModelError(model.source + ": joint_elasticity at '" + e.where +
                           "': the joint has a hidden motor already; one elasticity a joint");
        share = JointElasticity::friction_share(e.parameters.data());
      }
  return out;
}

/// Which side an effect of one instant acts on: both, in all draws, where they do not agree.
void take_sides(std::vector<DrawnEffects>& draws) {
  for (DrawnEffects& d : draws)
    for (const BoundEffect& whole : d.tree.effects)
      for (const BoundEffect& e : parts_at_motors(whole, d.shares)) {
        double least = 1.0, most = 0.0;
        for (const DrawnEffects& other : draws) {
          const double share = share_at_motors(e, other.shares);
          least = std::min(least, share);
          most = std::max(most, share);
        }
        const double share = share_at_motors(e, d.shares);
        if (most > 0.0) d.motors.push_back(scaled(e, share));
        if (least < 1.0) d.links.push_back(most > 0.0 ? scaled(e, 1.0 - share) : e);
      }
}

/// Whether its torque depends on another joint's speed.
bool reads_other_speed(const BoundEffect& e) {
  const Residual* residual = std::get_if<Residual>(&e.type);
  return residual && std::ranges::any_of(residual->axes, [&](const Residual::Axis& a) {
           return a.velocity && a.joint != e.joints.front();
         });
}

/// What its torque depends on, asked with numbers that no formula survives: one that is finite did
/// not look at them.
EffectKind kind_of(const BoundEffect& e, const Tree<double>& tree) {
  if (reads_other_speed(e)) return EffectKind::kGeneral;
  const std::size_t n = static_cast<std::size_t>(e.num_joints);
  const std::vector<double> anything(n, std::nan(""));
  std::vector<double> parameters = e.parameters;  // 0 in one draw need not be in another
  for (double& p : parameters) p = p == 0.0 ? 1.0 : p;
  const auto torque = [&](double speed) {
    const std::vector<double> qd(n, speed);
    std::vector<double> tau(n, 0.0);
    JointSample<double> x;
    x.time = std::nan("");
    x.q = x.qdd = x.tau = anything.data();
    x.qd = qd.data();
    add_torque(e, tree, x, parameters.data(), tau.data());
    return Eigen::Map<const VecX<double>>(tau.data(), e.num_joints).eval();
  };
  if (torque(std::nan("")).allFinite()) return EffectKind::kConstant;
  if (!torque(0.0).isZero(0.0)) return EffectKind::kGeneral;
  constexpr double kRounding = 1e-12;
  const VecX<double> one = torque(1.0);
  for (const double speed : {-3.0, -1e-4, 1e-3, 2.0})
    if (!(torque(speed) - speed * one).isZero(kRounding * one.cwiseAbs().maxCoeff()))
      return EffectKind::kDissipative;
  return EffectKind::kLinear;
}

/// A delay's commands are all kept: a longer one is no delay.
void check_delay(const Model& model, const BoundEffect& e) {
  constexpr int kLongest = 10;  // [s]
  if (!std::holds_alternative<ActuatorDelay>(e.type) || e.parameters[0] <= kLongest) return;
  throw ModelError(model.source + ": actuator_delay at '" + e.where +
                   "': delay = " + std::to_string(e.parameters[0]) + " s, expected at most " +
                   std::to_string(kLongest) + " s here");
}

}  // namespace

std::vector<std::pair<std::string, std::string>> names_and_places(
    const std::vector<BoundEffect>& effects) {
  std::vector<std::pair<std::string, std::string>> out;
  for (const BoundEffect& e : effects) out.emplace_back(e.info().name, e.where);
  return out;
}

bool is_of_log(const BoundEffect& e) {
  const EffectInfo& info = e.info();
  return info.port == Port::kBallView || info.name == "time_shift" ||
         info.name == "velocity_filter_lag";
}

void refuse(const Model& model, const BoundEffect& e) {
  throw ModelError(
      model.source + ": " + e.info().name + " at '" + e.where +
      "' is not simulated here (gaps, encoders, impacts, what reads the acceleration); "
      "leave it out of the model that the policy is learned in");
}

std::vector<DrawnEffects> drawn_effects(const std::vector<Model>& draws) {
  std::vector<DrawnEffects> drawn;
  for (const Model& model : draws) {
    DrawnEffects& d = drawn.emplace_back();
    d.model = model;
    d.tree = extend(model, {0});
    for (const BoundEffect& e : d.tree.series) {
      check_delay(model, e);
      if (is_of_drives(e))
        d.drives.push_back(e);
      else if (!is_of_log(e) && !acts_on_ball(e.info()))
        refuse(model, e);
    }
    for (const BoundEffect& e : d.tree.effects)
      if (reads_acceleration(e) || e.info().name == "torque_gain") refuse(model, e);
    if (joint_names(model) != joint_names(draws.front()) ||
        names_and_places(d.tree.effects) != names_and_places(drawn.front().tree.effects) ||
        names_and_places(d.drives) != names_and_places(drawn.front().drives))
      throw ModelError(model.source + ": draws must have the joints and effects of the first");
    d.shares = motor_shares(model, d.drives);
  }
  take_sides(drawn);
  return drawn;
}

EffectKind kind_in_all(const std::vector<DrawnEffects>& draws, std::size_t e) {
  const EffectKind first = kind_of(draws.front().links[e], draws.front().tree.tree);
  for (const DrawnEffects& d : draws)
    if (kind_of(d.links[e], d.tree.tree) != first) return EffectKind::kGeneral;
  return first;
}

}  // namespace diffnea::sim
