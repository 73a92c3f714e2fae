#include "sim/drawn_effects.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/effects/stepping.hpp>

namespace diffnea::sim {
namespace {

/// Effects with memory that sim/pack_drives.hpp simulates.
bool is_of_drives(const BoundEffect& e) {
  return e.info().motor == HiddenMotor::kSpring || has_state(e) || is_of_drive_path(e);
}

/// @throws ModelError if a joint has two springs
MotorShares motor_shares(const Model& model, const std::vector<BoundEffect>& drives) {
  MotorShares out(joint_names(model).size(), -1.0);
  for (const BoundEffect& e : drives)
    if (hides_motor(e))
      for (const int j : e.joints) {
        double& share = out[static_cast<std::size_t>(j)];
        if (share >= 0.0)
          throw ModelError(model.source + ": " + e.info().name + " at '" + e.where +
                           "': the joint has a hidden motor already; one elasticity a joint");
        share = motor_spring(e).friction_share;
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

/// A delay's commands are all kept: a longer one is no delay.
void check_delay(const Model& model, const BoundEffect& e) {
  constexpr int kLongest = 10;  // [s]
  DrivePath<double> path{};
  add_to_drive(e, path);
  if (path.delay <= kLongest) return;
  throw ModelError(model.source + ": " + e.info().name + " at '" + e.where +
                   "': delay = " + std::to_string(path.delay) + " s, expected at most " +
                   std::to_string(kLongest) + " s here");
}

}  // namespace

std::vector<std::pair<std::string, std::string>> names_and_places(
    const std::vector<BoundEffect>& effects) {
  std::vector<std::pair<std::string, std::string>> out;
  for (const BoundEffect& e : effects) out.emplace_back(e.info().name, e.where);
  return out;
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
    require_plain_tree("simulator", model);
    DrawnEffects& d = drawn.emplace_back();
    d.model = model;
    d.tree = extend(model, {0});
    for (const BoundEffect& e : d.tree.series) {
      check_delay(model, e);
      if (is_of_drives(e) && !encoder_at_motor(e))
        d.drives.push_back(e);
      else if (!is_of_log(e) && !acts_on_ball(e.info()))
        refuse(model, e);
    }
    for (const BoundEffect& e : d.tree.effects)
      if (reads_acceleration(e) || e.info().has(Trait::kGain)) refuse(model, e);
    if (joint_names(model) != joint_names(draws.front()) ||
        names_and_places(d.tree.effects) != names_and_places(drawn.front().tree.effects) ||
        names_and_places(d.drives) != names_and_places(drawn.front().drives))
      throw ModelError(model.source + ": draws must have the joints and effects of the first");
    d.shares = motor_shares(model, d.drives);
  }
  take_sides(drawn);
  return drawn;
}

}  // namespace diffnea::sim
