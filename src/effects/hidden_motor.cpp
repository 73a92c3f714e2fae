#include <algorithm>

#include <diffnea/effects/hidden_motor.hpp>

namespace diffnea {

double motor_share(const EffectInfo& effect, double friction_share) {
  if (effect.has(Trait::kAtMotor)) return 1.0;
  return effect.motor_side ? friction_share : 0.0;
}

std::vector<BoundEffect> parts_at_motors(const BoundEffect& effect, const MotorShares& shares) {
  const bool at_motor = std::ranges::any_of(
      effect.joints, [&](int j) { return shares[static_cast<std::size_t>(j)] >= 0.0; });
  if (!at_motor || effect.info().place != Place::kJoint) return {effect};
  std::vector<BoundEffect> out(effect.joints.size(), effect);
  for (std::size_t k = 0; k < out.size(); ++k) {
    out[k].joints = {effect.joints[k]};
    out[k].links = {effect.links[k]};
    if (!effect.follows.empty()) out[k].follows = {effect.follows[k]};
  }
  return out;
}

double share_at_motors(const BoundEffect& effect, const MotorShares& shares) {
  double out = 2.0;
  for (const int j : effect.joints)
    if (const double share = shares[static_cast<std::size_t>(j)]; share >= 0.0)
      out = std::min(out, motor_share(effect.info(), share));
  return out > 1.0 ? 0.0 : out;
}

BoundEffect scaled(BoundEffect effect, double share) {
  for (const int k : effect.linear_parameters())
    effect.parameters[static_cast<std::size_t>(k)] *= share;
  return effect;
}

}  // namespace diffnea
