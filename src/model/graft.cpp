#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/model/graft.hpp>
#include <diffnea/model/physical.hpp>

namespace diffnea {
namespace {

/// Negative eigenvalue of a pseudo-inertia / its trace that rounding leaves of a flat body.
constexpr double kRounding = 1e-9;

int find_link(const Model& model, const ModelLink& like) {
  const auto it = std::ranges::find(model.links, like.name, &ModelLink::name);
  if (it == model.links.end() || it->joint != like.joint || it->type != like.type) {
    std::vector<std::string> names;
    for (const ModelLink& link : model.links) names.push_back(link.name);
    throw ModelError(
        "'" + model.name + "' has no link '" + like.name + "' on the joint '" + like.joint +
        "' that moves as that of the part does; links: " + detail::join_or_none(names));
  }
  return static_cast<int>(it - model.links.begin());
}

/// Tells whether `link` moves against `carrier`, which carries it.
bool moves_against(const Model& model, int link, int carrier) {
  for (int k = link; k >= 0 && k != carrier; k = model.links[static_cast<std::size_t>(k)].parent)
    if (model.links[static_cast<std::size_t>(k)].type != ModelJoint::kFixed) return true;
  return false;
}

}  // namespace

std::vector<std::string> graft(Model& whole, const Model& part) {
  const TreeMap map = map_to_tree(part);
  const std::vector<int> moving = tree_links(part);
  std::vector<std::string> joints;
  for (std::size_t i = 0; i < moving.size(); ++i) {
    const ModelLink& from = part.links[static_cast<std::size_t>(moving[i])];
    const int at = find_link(whole, from);
    ModelLink& to = whole.links[static_cast<std::size_t>(at)];
    joints.push_back(from.joint);
    to.X_PJ = from.X_PJ;
    Theta<double> theta = from.inertia.theta();
    for (std::size_t k = 0; k < part.links.size(); ++k) {
      if (map.dof[k] != static_cast<int>(i) || static_cast<int>(k) == moving[i]) continue;
      const SpatialInertia<double>& lumped = part.links[k].inertia;  // 0 where it was fitted
      const auto carried = std::ranges::find(whole.links, part.links[k].name, &ModelLink::name);
      if (carried == whole.links.end()) continue;
      if (!moves_against(whole, static_cast<int>(carried - whole.links.begin()), at)) {
        carried->inertia = lumped;
        continue;
      }
      const Theta<double> there = to_parent(map.X_LF[k], lumped).theta(),
                          own = to_parent(map.X_LF[k], carried->inertia).theta();
      for (std::size_t c = 0; c < own.size(); ++c) theta[c] += there[c] - own[c];
    }
    const double least = smallest_pseudo_inertia_eigenvalue(theta);
    if (least < -kRounding * pseudo_inertia(theta).trace())
      throw ModelError("link '" + to.name + "': less what moves with it in '" + whole.name +
                       "', its inertia is that of no body (mass " + detail::number_text(theta[0]) +
                       " kg)");
    to.inertia = SpatialInertia<double>::from_theta(theta);
  }
  const auto of_part = [&](const EffectSpec& effect) {
    return std::ranges::find(joints, effect.where) != joints.end();
  };
  std::erase_if(whole.effects, of_part);
  whole.posterior.reset();
  std::vector<std::string> left_out;
  for (const EffectSpec& effect : part.effects)
    if (of_part(effect))
      whole.effects.push_back(effect);
    else
      left_out.push_back(effect.effect + " at " + effect.where);
  if (part.posterior) left_out.emplace_back("the posterior of the parameters");
  return left_out;
}

}  // namespace diffnea
