#include "motion/limbs.hpp"

#include <algorithm>

#include <diffnea/effects/stepping.hpp>

namespace diffnea {

std::vector<int> Limb::dofs() const {
  std::vector<int> out;
  for (int j = first; j < first + count; ++j) out.push_back(j);
  out.insert(out.end(), rotors.begin(), rotors.end());
  return out;
}

std::vector<Limb> limbs(const ExtendedTree& model, const HiddenRotors& rotors,
                        const std::vector<BoundEffect>& effects) {
  const Tree<double>& tree = model.tree;
  // Last joint that each is tied to; a limb ends where none reaches further.
  std::vector<int> last(static_cast<std::size_t>(rotors.joints()));
  for (std::size_t j = 0; j < last.size(); ++j) last[j] = static_cast<int>(j);
  const auto tie = [&](std::vector<int> joints) {
    if (joints.empty()) return;
    for (int& j : joints) j = rotors.joint_of(j);
    const auto [low, high] = std::ranges::minmax(joints);
    int& reach = last[static_cast<std::size_t>(low)];
    reach = std::max(reach, high);
  };
  for (int i = 0; i < tree.num_links(); ++i)
    if (const int parent = tree.links[static_cast<std::size_t>(i)].parent; parent >= 0)
      tie({tree.drive(parent).dof, tree.drive(i).dof});
  const auto tie_effect = [&](const BoundEffect& e) {
    std::vector<int> all = joints_read(e);
    all.insert(all.end(), e.joints.begin(), e.joints.end());
    for (const int link : e.links) all.push_back(tree.drive(link).dof);
    tie(all);
  };
  for (const BoundEffect& e : model.effects) tie_effect(e);
  for (const BoundEffect& e : effects) tie_effect(e);
  std::vector<Limb> out;
  for (int first = 0, end = 0; first < rotors.joints(); first = end) {
    end = last[static_cast<std::size_t>(first)] + 1;
    for (int j = first; j < end; ++j) end = std::max(end, last[static_cast<std::size_t>(j)] + 1);
    out.push_back({first, end - first});
    for (const HiddenRotor& r : rotors.rotors())
      if (first <= r.joint && r.joint < end) out.back().rotors.push_back(r.rotor);
    for (const DriveIntegrator& i : rotors.integrators())
      if (first <= i.joint && i.joint < end) out.back().rotors.push_back(i.dof);
  }
  return out;
}

}  // namespace diffnea
