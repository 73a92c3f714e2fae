#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/model/lock.hpp>

namespace diffnea {
namespace {

/// Calibrations differ from a description by that much of the joint's range, and no more.
constexpr double kBeyond = 0.05;

/// Tells whether an effect acts at a joint, alone or in a pair; its runs, behind a colon, do not
/// matter.
bool acts_at(const EffectSpec& effect, const std::string& joint) {
  std::string rest = effect.where.substr(0, effect.where.find(':'));
  while (true) {
    const std::size_t comma = rest.find(',');
    if (rest.substr(0, comma) == joint) return true;
    if (comma == std::string::npos) break;
    rest.erase(0, comma + 1);
  }
  return effect.table && std::ranges::any_of(effect.table->variables, [&](const std::string& v) {
           return v.substr(v.find('_') + 1) == joint;
         });
}

void require_within_limits(const ModelLink& link, double position) {
  const JointLimits& limits = link.limits;
  const double range = limits.upper - limits.lower;
  const double slack = std::isfinite(range) ? kBeyond * range : 0.0;
  if (position >= limits.lower - slack && position <= limits.upper + slack) return;
  const std::string unit = link.type == ModelJoint::kPrismatic ? " m" : " rad";
  throw ModelError("lock: " + link.joint + " was to be held at " + detail::number_text(position) +
                   unit + ", beyond its limits " + detail::number_text(limits.lower) + " to " +
                   detail::number_text(limits.upper) + unit);
}

}  // namespace

double resting_position(const Model& model, const std::string& joint) {
  const int dof = find_joint(model, joint);
  const auto moving = moving_links(model);
  if (model.home.size() == moving.size()) return model.home[static_cast<std::size_t>(dof)];
  const JointLimits& limits =
      model.links[static_cast<std::size_t>(moving[static_cast<std::size_t>(dof)])].limits;
  return std::clamp(0.0, std::min(limits.lower, limits.upper), limits.upper);
}

std::vector<std::string> lock_joint(Model& model, const std::string& joint, double position) {
  const int dof = find_joint(model, joint);
  const std::vector<int> moving = moving_links(model);
  ModelLink& link = model.links[static_cast<std::size_t>(moving[static_cast<std::size_t>(dof)])];
  if (!std::isfinite(position))
    throw ModelError("lock: the position of " + joint + " is no finite number");
  require_within_limits(link, position);
  std::vector<std::string> gone;
  std::erase_if(model.effects, [&](const EffectSpec& effect) {
    if (!acts_at(effect, joint)) return false;
    gone.push_back(effect.effect + " at " + effect.where);
    return true;
  });
  if (model.posterior) gone.emplace_back("the posterior of the parameters");
  model.posterior.reset();
  if (model.home.size() == moving.size()) model.home.erase(model.home.begin() + dof);
  // X_PL(q) = X_PJ · X_JL(q) is the pose from now on.
  if (link.type == ModelJoint::kPrismatic)
    link.X_PJ.p = link.X_PJ.p + link.X_PJ.R * (link.axis * position);
  else
    link.X_PJ.R = link.X_PJ.R * rotation_about<double>(link.axis, position);
  link.type = ModelJoint::kFixed;
  link.limits = {};
  link.passive = false;
  link.servo.reset();
  for (ModelLink& other : model.links) {  // followers stand still with it
    if (!other.follows || other.follows->leader != joint) continue;
    const double there = other.follows->ratio * position + other.follows->offset;
    other.follows.reset();
    other.limits = {};
    const std::vector<std::string> more = lock_joint(model, other.joint, there);
    gone.insert(gone.end(), more.begin(), more.end());
  }
  return gone;
}

}  // namespace diffnea
