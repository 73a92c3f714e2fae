#pragma once

#include <algorithm>
#include <cmath>
#include <map>

#include <diffnea/core/compiled.hpp>
#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/model/model.hpp>
#include <diffnea/model/physical.hpp>

namespace diffnea {
namespace detail {

inline bool has_inertia(const SpatialInertia<double>& b) {
  return std::ranges::any_of(b.theta(), [](double x) { return x != 0.0; });
}

/// Tells whether a link of the model is one of the tree, and no part of another.
inline bool is_tree_link(const Model& model, std::size_t i) {
  return model.links[i].type != ModelJoint::kFixed || (model.free_base && i == 0);
}

/// @throws ModelError unless all links hang on links[0], which no joint moves
inline void check_free_base(const Model& model, const std::string& where) {
  if (model.links.empty()) throw ModelError(where + ": a free base needs a link");
  const ModelLink& base = model.links[0];
  if (base.type != ModelJoint::kFixed)
    throw ModelError(where + ": link '" + base.name + "' cannot float: joint '" + base.joint +
                     "' moves it against the world");
  for (std::size_t i = 1; i < model.links.size(); ++i)
    if (model.links[i].parent < 0)
      throw ModelError(where + ": base '" + base.name + "' cannot float: link '" +
                       model.links[i].name + "' does not hang on it, but on the world");
}

}  // namespace detail

DIFFNEA_INLINE std::vector<int> tree_links(const Model& model) {
  std::vector<int> out;
  out.reserve(model.links.size());
  for (std::size_t i = 0; i < model.links.size(); ++i)
    if (detail::is_tree_link(model, i)) out.push_back(static_cast<int>(i));
  return out;
}

DIFFNEA_INLINE std::vector<int> moving_links(const Model& model) {
  std::vector<int> out = tree_links(model);
  std::erase_if(out, [&](int i) {
    return model.links[i].type == ModelJoint::kFixed || model.links[i].follows.has_value();
  });
  return out;
}

DIFFNEA_INLINE std::vector<std::string> joint_names(const Model& model) {
  std::vector<std::string> out;
  for (const int i : moving_links(model)) out.push_back(model.links[i].joint);
  return out;
}

DIFFNEA_INLINE std::vector<std::string> follower_names(const Model& model) {
  std::vector<std::string> out;
  for (const int i : tree_links(model))
    if (model.links[i].follows) out.push_back(model.links[i].joint);
  return out;
}

DIFFNEA_INLINE int find_joint(const Model& model, const std::string& joint) {
  const std::vector<std::string> names = joint_names(model);
  const auto at = std::ranges::find(names, joint);
  if (at != names.end()) return static_cast<int>(at - names.begin());
  for (const ModelLink& link : model.links)
    if (link.joint == joint && link.follows)
      throw ModelError(model.name + ": joint '" + joint + "' follows '" + link.follows->leader +
                       "', and is no degree of freedom; these are: " + detail::join_or_none(names));
  throw ModelError(model.name + ": there is no moving joint '" + joint +
                   "'; joints: " + detail::join_or_none(names));
}

DIFFNEA_INLINE std::vector<TreeJoint> tree_joints(const Model& model) {
  std::vector<int> links = tree_links(model);
  const int first = model.free_base ? 1 : 0;  // a free base has no joint
  links.erase(links.begin(), links.begin() + first);
  std::vector<TreeJoint> out(links.size());
  std::map<std::string, std::size_t> named;
  int dofs = 0;
  for (std::size_t k = 0; k < links.size(); ++k) {
    const ModelLink& link = model.links[static_cast<std::size_t>(links[k])];
    out[k] = {link.joint, static_cast<int>(k) + first, {}, link.follows.has_value()};
    if (!link.follows) out[k].drive.dof = dofs++;
    named.emplace(link.joint, k);
  }
  for (std::size_t k = 0; k < links.size(); ++k) {
    std::size_t at = k;
    for (std::size_t steps = 0; out[at].follows; ++steps) {
      const Follow& f = *model.links[static_cast<std::size_t>(links[at])].follows;
      const std::string here = (model.source.empty() ? model.name : model.source) + ": joint '" +
                               out[at].name + "' follows '" + f.leader + "'";
      const auto leader = named.find(f.leader);
      if (leader == named.end()) {
        const bool fixed =
            std::ranges::find(model.links, f.leader, &ModelLink::joint) != model.links.end();
        throw ModelError(here + (fixed ? ", which is fixed; make it fixed, too"
                                       : ", which is no joint of the model; joints: " +
                                             detail::join_or_none(joint_names(model))));
      }
      if (steps > links.size() || leader->second == k)
        throw ModelError(here + ", which follows it in turn; one of them must move by itself");
      // q_k = r (f.ratio q + f.offset) + o
      out[k].drive.offset += out[k].drive.ratio * f.offset;
      out[k].drive.ratio *= f.ratio;
      at = leader->second;
    }
    out[k].drive.dof = out[at].drive.dof;
  }
  return out;
}

DIFFNEA_INLINE TreeMap map_to_tree(const Model& model) {
  TreeMap map;
  map.dof.reserve(model.links.size());
  map.X_LF.reserve(model.links.size());
  int dof = 0;
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const ModelLink& link = model.links[i];
    if (link.parent >= static_cast<int>(i))
      throw ModelError(model.name + ": link '" + link.name + "' comes before its parent");
    if (detail::is_tree_link(model, i)) {
      map.dof.push_back(dof++);
      map.X_LF.push_back(Pose<double>::identity());
    } else if (link.parent < 0) {
      map.dof.push_back(-1);
      map.X_LF.push_back(link.X_PJ);
    } else {
      map.dof.push_back(map.dof[link.parent]);
      map.X_LF.push_back(map.X_LF[link.parent] * link.X_PJ);
    }
  }
  return map;
}

DIFFNEA_INLINE std::optional<Pose<double>> cup_at_string(const Model& model) {
  const auto frame = std::ranges::find(model.frames, "cup", &ModelFrame::name);
  if (!model.cup || frame == model.frames.end() || !model.ball || !model.ball->string)
    return std::nullopt;
  const TreeMap map = map_to_tree(model);
  const auto [string_link, X_LS] = place_in_tree(map, model.ball->string->link);
  const auto [cup_link, X_LF] = place_in_tree(map, frame->link);
  if (string_link != cup_link) return std::nullopt;
  return inverse(X_LS) * (X_LF * frame->X_LF);
}

DIFFNEA_INLINE Tree<double> make_tree(const Model& model) {
  if (model.free_base) detail::check_free_base(model, model.name);
  const TreeMap map = map_to_tree(model);
  Tree<double> tree;
  tree.gravity = model.gravity;
  tree.free_base = model.free_base;
  tree.links.reserve(model.links.size());
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const ModelLink& link = model.links[i];
    if (model.free_base && i == 0) {
      tree.links.push_back({.X_PJ = link.X_PJ, .inertia = link.inertia});
      continue;
    }
    if (link.type == ModelJoint::kFixed) {
      if (map.dof[i] >= 0) {
        SpatialInertia<double>& lump = tree.links[map.dof[i]].inertia;
        lump = lump + to_parent(map.X_LF[i], link.inertia);
      }
      continue;
    }
    const double norm = std::sqrt(dot(link.axis, link.axis));
    if (!(std::abs(norm - 1.0) < 1e-9))
      throw ModelError(model.name + ": axis of joint '" + link.joint + "' has length " +
                       detail::number_text(norm) + ", expected 1");
    Link<double> l;
    l.type = link.type == ModelJoint::kRevolute ? JointType::kRevolute : JointType::kPrismatic;
    l.axis = link.axis;
    l.inertia = link.inertia;
    l.X_PJ = link.X_PJ;
    if (link.parent >= 0) {  // the parent may be fixed to the link (or world) that moves it
      l.parent = map.dof[link.parent];
      l.X_PJ = map.X_LF[link.parent] * link.X_PJ;
    }
    tree.links.push_back(l);
  }
  const std::vector<TreeJoint> joints = tree_joints(model);
  if (std::ranges::any_of(joints, &TreeJoint::follows)) {
    for (const TreeJoint& j : joints) tree.coordinates.joints.push_back(j.drive);
    tree.coordinates.count = static_cast<int>(moving_links(model).size());
  }
  for (const EffectSpec& e : model.effects) {
    if (e.effect != "armature") continue;
    if (e.parameters.size() != 1 || e.parameters[0].name != "armature")
      throw ModelError(model.name + ": armature at " + e.where +
                       " takes one parameter, 'armature'");
    const auto joint = std::ranges::find(joints, e.where, &TreeJoint::name);
    if (joint == joints.end()) find_joint(model, e.where);  // throws, with the choices
    tree.links[joint->link].armature += e.parameters[0].value;
  }
  return tree;
}

DIFFNEA_INLINE void let_base_float(Model& model, const std::string& where) {
  detail::check_free_base(model, where);
  model.free_base = true;
}

DIFFNEA_INLINE void require_fixed_base(const char* what, const Model& model) {
  if (!model.free_base) return;
  throw ModelError(
      std::string(what) + ": the base '" + model.links[0].name + "' of '" + model.name +
      "' floats, and what holds or pushes it is not modelled; --fix-base "
      "(fix_base=True) reads it as hung where the file has it, `diffnea identify` and "
      "`diagnose` read torques of its flights, and `diffnea export` writes an MJCF for "
      "MuJoCo, which has contacts");
}

DIFFNEA_INLINE void require_no_constraints(const char* what, const Model& model) {
  if (model.constraints.empty()) return;
  std::string names;
  for (const ConstraintSpec& c : model.constraints)
    names += (names.empty() ? "'" : ", '") + c.name + "'";
  throw ModelError(
      std::string(what) + ": '" + model.name + "' has constraints, " + names +
      ", whose forces are not served here yet; `excite`, `simulate`, and `identify` "
      "and `diagnose` by torques serve loops, and --open-loops (open_loops=True) reads the tree "
      "without them, whose forces then are missing");
}

DIFFNEA_INLINE void require_plain_tree(const char* what, const Model& model) {
  require_fixed_base(what, model);
  require_no_constraints(what, model);
}

DIFFNEA_INLINE VecX<double> inertial_parameters(const Tree<double>& tree) {
  VecX<double> pi(kThetaSize * tree.num_links());
  for (int i = 0; i < tree.num_links(); ++i) {
    const Theta<double> t = tree.links[i].inertia.theta();
    std::ranges::copy(t, pi.data() + kThetaSize * i);
  }
  return pi;
}

DIFFNEA_INLINE void set_inertial_parameters(Model& model, const VecX<double>& pi) {
  const std::vector<int> moving = tree_links(model);
  require_size("set_inertial_parameters: pi", pi.size(),
               kThetaSize * static_cast<long>(moving.size()),
               "inertial parameter of a moving link");
  const TreeMap map = map_to_tree(model);
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    if (map.dof[i] < 0) continue;
    Theta<double> t{};
    if (detail::is_tree_link(model, i))
      std::copy_n(pi.data() + kThetaSize * map.dof[i], kThetaSize, t.begin());
    model.links[i].inertia = SpatialInertia<double>::from_theta(t);
  }
}

DIFFNEA_INLINE std::vector<ModelIssue> check_model(const Model& model) {
  std::vector<ModelIssue> issues;
  for (const ModelLink& link : model.links) {
    const SpatialInertia<double>& b = link.inertia;
    if (detail::has_inertia(b)) {
      if (!(b.m > 0.0))
        issues.push_back({link.name, "mass is " + detail::number_text(b.m) + " kg, expected > 0"});
      else if (const double margin = triangle_margin(b);
               margin < -1e-9 * (b.I.xx + b.I.yy + b.I.zz))
        issues.push_back(
            {link.name, "inertia misses the triangle inequality by " +
                            detail::number_text(-margin) +
                            " kg·m² (no distribution of mass has these principal moments)"});
    }
    if (link.limits.lower > link.limits.upper)
      issues.push_back({link.name, "limits of joint '" + link.joint + "' are empty: lower " +
                                       detail::number_text(link.limits.lower) + " > upper " +
                                       detail::number_text(link.limits.upper)});
  }
  const Tree<double> tree = make_tree(model);
  const std::vector<int> moving = tree_links(model);
  if (tree.free_base && !(tree.links[0].inertia.m > 0.0))
    issues.push_back({model.links[0].name,
                      "base that floats has no inertia, nor has anything that is fixed to it"});
  std::vector<bool> carries(tree.links.size());  // inertia, its own or of a link that it moves
  for (int i = tree.num_links() - 1; i >= 0; --i) {
    const Link<double>& link = tree.links[i];
    if (detail::has_inertia(link.inertia) || link.armature > 0.0) carries[i] = true;
    if (carries[i] && link.parent >= 0) carries[link.parent] = true;
  }
  for (int i = tree.first_joint(); i < tree.num_links(); ++i)
    if (!carries[i])
      issues.push_back({model.links[moving[i]].name,
                        "moving link has no inertia, nor has anything that it carries"});
  return issues;
}

}  // namespace diffnea
