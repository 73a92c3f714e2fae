#include "motion/limbs.hpp"

#include <algorithm>

#include <diffnea/effects/stepping.hpp>

namespace diffnea {

std::vector<Limb> limbs(const ExtendedTree& model, const std::vector<BoundEffect>& effects) {
  const Tree<double>& tree = model.tree;
  const int n = tree.num_dofs();
  // Last joint that each is tied to; a limb ends where none reaches further.
  std::vector<int> last(static_cast<std::size_t>(n));
  for (std::size_t j = 0; j < last.size(); ++j) last[j] = static_cast<int>(j);
  const auto tie = [&](const std::vector<int>& joints) {
    if (joints.empty()) return;
    const auto [low, high] = std::ranges::minmax(joints);
    int& reach = last[static_cast<std::size_t>(low)];
    reach = std::max(reach, high);
  };
  const auto tie_effect = [&](const BoundEffect& e) {
    std::vector<int> all = e.joints;
    for (const int link : e.links) all.push_back(tree.drive(link).dof);
    if (names_joints(e)) all = {0, n - 1};  // its formula counts them as the robot does
    tie(all);
  };
  if (tree.free_base || model.loops) return {{0, n}};
  for (int i = 0; i < tree.num_links(); ++i)
    if (const int parent = tree.links[static_cast<std::size_t>(i)].parent; parent >= 0)
      tie({tree.drive(parent).dof, tree.drive(i).dof});
  for (const BoundEffect& e : model.effects) tie_effect(e);
  for (const BoundEffect& e : effects) tie_effect(e);
  std::vector<Limb> out;
  for (int first = 0, end = 0; first < n; first = end) {
    end = last[static_cast<std::size_t>(first)] + 1;
    for (int j = first; j < end; ++j) end = std::max(end, last[static_cast<std::size_t>(j)] + 1);
    out.push_back({first, end - first});
  }
  return out;
}

LimbPart::LimbPart(const Tree<double>& tree, const Limb& limb)
    : limb_(limb), link_(static_cast<std::size_t>(tree.num_links()), -1) {
  for (int i = 0; i < tree.num_links(); ++i) {
    const int joint = tree.free_base ? limb.first : tree.drive(i).dof;
    if (joint >= limb.first && joint < limb.first + limb.count)
      link_[static_cast<std::size_t>(i)] = links_++;
  }
}

bool LimbPart::has(const BoundEffect& e) const {
  return e.links.empty() ? !e.joints.empty() && e.joints.front() >= limb_.first &&
                               e.joints.front() < limb_.first + limb_.count
                         : link(e.links.front()) >= 0;
}

BoundEffect LimbPart::effect(BoundEffect e) const {
  if (is_robot()) return e;
  for (int& j : e.joints) j -= limb_.first;
  for (int& l : e.links) l = link(l);
  for (JointDrive& d : e.follows) d.dof -= limb_.first;
  e.num_joints = limb_.count;
  return e;
}

ExtendedTree LimbPart::model(const ExtendedTree& whole) const {
  if (is_robot()) return whole;
  ExtendedTree out;
  out.tree.gravity = whole.tree.gravity;
  const Coordinates& coordinates = whole.tree.coordinates;
  if (!coordinates.plain()) out.tree.coordinates.count = limb_.count;
  for (std::size_t i = 0; i < link_.size(); ++i) {
    if (link_[i] < 0) continue;
    Link<double> l = whole.tree.links[i];
    if (l.parent >= 0) l.parent = link(l.parent);
    out.tree.links.push_back(l);
    if (coordinates.plain()) continue;
    JointDrive d = coordinates.joints[i];
    d.dof -= limb_.first;
    out.tree.coordinates.joints.push_back(d);
  }
  for (const auto of : {&ExtendedTree::effects, &ExtendedTree::series})
    for (const BoundEffect& e : whole.*of)
      if (has(e)) (out.*of).push_back(effect(e));
  return out;
}

}  // namespace diffnea
