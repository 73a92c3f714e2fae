#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/effects/stepping.hpp>
#include <diffnea/identify/layout.hpp>
#include <diffnea/model/physical.hpp>

#include "identify/fix_pattern.hpp"
#include "motion/hidden_rotors.hpp"

namespace diffnea {
namespace {

const char* theta_unit(int k) { return k == 0 ? "kg" : k < 4 ? "kg*m" : "kg*m^2"; }

const std::vector<std::string> kGroups{"inertia", "armature", "effects",
                                       "string",  "shapes",   "kinematics"};
constexpr std::array<const char*, 6> kWrenchAxes{"tx", "ty", "tz", "fx", "fy", "fz"};
const std::array<const char*, 6> kKinematicNames{"roll", "pitch", "yaw", "px", "py", "pz"};

bool contains(const std::vector<std::string>& list, const std::string& item) {
  return std::ranges::find(list, item) != list.end();
}

void hold(const std::string& entry, FitLayout& layout) {
  const auto [pattern, value] = split_value(entry);
  bool found = false;
  for (auto* list : {&layout.linear, &layout.shape})
    for (FitParameter& p : *list) {
      if (!matches(pattern, p.name)) continue;
      p.fixed = found = true;
      if (!value) continue;
      if (p.kinematic >= 0 && *value != 0.0)
        throw ModelError("fix: got '" + entry + "'; " + p.name +
                         " is a step from the model and can be held at 0 alone");
      require_possible(entry, p.name, *value, p.sign);
      p.prior = *value;
      if (p.effect >= 0) layout.effects[p.effect].parameters[p.index] = *value;
    }
  if (found) return;
  std::vector<std::string> names;
  for (const auto* list : {&layout.linear, &layout.shape})
    for (const FitParameter& p : *list) names.push_back(p.name);
  throw ModelError("fix: no parameter matches '" + pattern +
                   "'; parameters: " + detail::join(names));
}

/// Length over which a link's mass is spread [m]: its radius of gyration with its offset, or a
/// decimetre where the model gives none.
double length_scale(const SpatialInertia<double>& b) {
  const double r2 = b.m > 0.0 ? 0.5 * (b.I.xx + b.I.yy + b.I.zz) / b.m : 0.0;
  return r2 > 0.0 ? std::sqrt(r2) : 0.1;
}

void add_inertias(const Model& model, bool fixed, FitLayout& layout) {
  const Tree<double> tree = make_tree(model);
  const std::vector<int> moving = tree_links(model);
  double total = 0.0;
  for (const Link<double>& l : tree.links) total += std::max(l.inertia.m, 0.0);
  for (int i = 0; i < tree.num_links(); ++i) {
    const SpatialInertia<double>& b = tree.links[i].inertia;
    const Theta<double> theta = b.theta();
    const double m = std::max({b.m, 0.02 * total, 1e-3}), length = length_scale(b);
    for (int k = 0; k < kThetaSize; ++k) {
      FitParameter p;
      p.name = model.links[moving[i]].name + "." + kThetaNames[k];
      p.unit = theta_unit(k);
      p.prior = theta[k];
      p.scale = k == 0 ? m : k < 4 ? m * length : m * length * length;
      p.fixed = fixed;
      p.dof = i;
      p.theta = k;
      layout.linear.push_back(p);
    }
  }
}

/// @param payload_mass  what a payload may well weigh [kg]; its mass is spread over some 0.1 m
void add_effect(const BoundEffect& effect, bool fixed, bool fix_shapes, double payload_mass,
                FitLayout& layout) {
  const int e = static_cast<int>(layout.effects.size());
  layout.effects.push_back(effect);
  for (std::size_t k = 0; k < effect.parameter_info.size(); ++k) {
    const ParameterInfo& info = effect.parameter_info[k];
    FitParameter p;
    p.name = effect.where + "." + effect.info().name + "." + info.name;
    p.unit = info.unit;
    p.sign = info.sign;
    p.prior = effect.parameters[k];
    if (hides_motor(effect))  // its size is a shape
      p.fixed = fixed || !fits_of_gear(info);
    else if (effect.info().has(Trait::kOfServo) && !info.linear)
      p.fixed = fixed || info.search.empty();
    else
      p.fixed =
          info.linear ? fixed : fixed || (fix_shapes && !effect.info().has(Trait::kReadsCommand));
    p.effect = e;
    p.index = static_cast<int>(k);
    p.logarithmic = scale(info) == Scale::kLog;
    if (effect.info().has(Trait::kInertia)) {  // ten inertial parameters: as a small link
      p.theta = static_cast<int>(k);
      p.scale = k == 0 ? payload_mass : k < 4 ? 0.1 * payload_mass : 0.01 * payload_mass;
    }
    if (effect.info().has(Trait::kGain)) p.scale = kGainScale;
    const bool column = info.linear && (effect.info().port == Port::kJointTorque || p.theta >= 0);
    (column ? layout.linear : layout.shape).push_back(p);
  }
}

/// @throws ModelError for effects that no loss has a column for
void require_fittable(const BoundEffect& effect, bool simulated) {
  const EffectInfo& info = effect.info();
  if (simulated && hides_motor(effect)) return;
  if (info.port == Port::kJointTorque || info.port == Port::kModelParameter) return;
  throw ModelError("effects: identify cannot fit " + info.name + " at '" + effect.where +
                   "', nor a model that has it: " +
                   (info.port == Port::kMeasurement
                        ? "it is of what is measured, and moves every column"
                    : effect.is_local() ? "its torque is that of a force on a link, no joint's own"
                    : hides_motor(effect)
                        ? "it hides the motor, which runs that are simulated have (--loss motion)"
                        : "its torque is no function of one instant of the joints") +
                   "; `diffnea diagnose` fits it");
}

/// The fixed transform of the joint that moves a link of the tree.
void add_kinematics(const std::string& joint, int dof, FitLayout& layout) {
  for (int k = 0; k < 6; ++k) {
    FitParameter p;
    p.name = joint + ".kinematics." + kKinematicNames[static_cast<std::size_t>(k)];
    p.unit = k < 3 ? "rad" : "m";
    p.dof = dof;
    p.kinematic = k;
    layout.shape.push_back(p);
  }
}

/// The places an effect asked for without one acts at.
std::vector<std::string> places_asked(const EffectInfo& info, const Model& model) {
  if (info.place != Place::kJointPair) return places(info, model);
  throw ModelError("effects: " + info.name + " acts on a pair of joints; name them, e.g. " +
                   info.name + "@" + joint_names(model).front() + "," + joint_names(model).back());
}

/// Tells whether a joint of a loop has no drive, and so neither a rotor nor a sensor of torque:
/// default effects leave these out there. Its friction counts.
bool lacks_drive_for(const EffectInfo& info, const std::string& joint, const Model& model) {
  if (model.constraints.empty() || !(info.has(Trait::kRotor) || info.name == "torque_offset"))
    return false;
  const auto link = std::ranges::find(model.links, joint, &ModelLink::joint);
  return link != model.links.end() && link->passive;
}

std::vector<std::string> default_effects(bool link_side) {
  if (link_side) return {"torque_offset"};
  return {"armature", "viscous_friction", "coulomb_friction", "torque_offset"};
}

}  // namespace

std::vector<int> FitLayout::bodies() const {
  std::vector<int> out;
  for (std::size_t i = 0; i < linear.size(); ++i)
    if (linear[i].theta == 0) out.push_back(static_cast<int>(i));
  return out;
}

std::vector<int> FitLayout::columns_of_row(const Tree<double>& tree, int row) const {
  const int joint = row < num_dofs ? row : -1;
  std::vector<bool> carried(tree.links.size(), joint < 0);  // moved by the coordinate
  for (int i = tree.first_joint(); joint >= 0 && i < tree.num_links(); ++i)
    carried[i] =
        tree.drive(i).dof == joint || (tree.links[i].parent >= 0 && carried[tree.links[i].parent]);
  std::vector<int> out;
  for (std::size_t c = 0; c < linear.size(); ++c) {
    const FitParameter& p = linear[c];
    if (p.dof >= 0) {
      if (carried[p.dof]) out.push_back(static_cast<int>(c));
      continue;
    }
    const BoundEffect& e = effects[p.effect];
    const bool acts = e.info().port == Port::kModelParameter
                          ? carried[e.links.at(0)]
                          : std::ranges::find(e.joints, joint) != e.joints.end();
    if (acts) out.push_back(static_cast<int>(c));
  }
  return out;
}

VecX<double> FitLayout::prior() const {
  VecX<double> out(linear.size());
  for (std::size_t i = 0; i < linear.size(); ++i) out[i] = linear[i].prior;
  return out;
}

std::string row_name(const Model& model, int row) {
  const std::vector<std::string> joints = joint_names(model);
  const std::size_t k = static_cast<std::size_t>(row);
  return k < joints.size() ? joints[k] : "base_" + std::string(kWrenchAxes[k - joints.size()]);
}

std::string row_unit(const Model& model, int row) {
  const std::vector<int> moving = moving_links(model);
  const std::size_t k = static_cast<std::size_t>(row);
  if (k < moving.size())
    return model.links[static_cast<std::size_t>(moving[k])].type == ModelJoint::kPrismatic ? "N"
                                                                                           : "N*m";
  return k - moving.size() < 3 ? "N*m" : "N";
}

FitLayout make_layout(const Model& model, const FitChoice& choice, const std::vector<int>& runs) {
  for (const std::string& group : choice.fit)
    if (!contains(kGroups, group) && !group.starts_with("kinematics@"))
      throw ModelError("fit: there is no group '" + group + "'; groups: " + detail::join(kGroups) +
                       ", kinematics@JOINT");
  const bool fit_inertia = contains(choice.fit, "inertia");
  const bool fit_armature = contains(choice.fit, "armature");
  const bool fit_effects = contains(choice.fit, "effects");
  const bool fix_shapes = !contains(choice.fit, "shapes");

  FitLayout layout;
  layout.num_dofs = static_cast<int>(moving_links(model).size());
  layout.base_rows = model.free_base ? kBaseVelocities : 0;
  add_inertias(model, !fit_inertia, layout);
  double total_mass = 0.0;
  for (const ModelLink& l : model.links) total_mass += std::max(l.inertia.m, 0.0);
  std::vector<std::string> present;
  const auto add = [&](const EffectSpec& spec) {
    const BoundEffect effect = bind(spec, model, runs);
    require_fittable(effect, choice.simulated);
    const bool fit = effect.info().has(Trait::kRotor) ? fit_armature : fit_effects;
    add_effect(effect, !fit, fix_shapes, std::max(0.1 * total_mass, 1e-3), layout);
    present.push_back(spec.effect + "@" + spec.where);
  };
  const std::vector<std::string> asked = choice.effects.value_or(default_effects(choice.link_side));
  for (const EffectSpec& spec : model.effects) {
    const bool left_out = choice.link_side && find_effect(spec.effect).motor_side &&
                          !contains(asked, spec.effect) &&
                          !contains(asked, spec.effect + "@" + spec.where);
    if (!left_out && !acts_on_ball(find_effect(spec.effect))) add(spec);
  }
  for (const std::string& entry : asked) {
    const std::size_t at = entry.find('@');
    const std::string name = entry.substr(0, at);
    const EffectInfo& effect_info = find_effect(name);
    if (effect_info.has(Trait::kRotor) ? !fit_armature : !fit_effects) continue;
    const std::vector<std::string> where = at == std::string::npos
                                               ? places_asked(effect_info, model)
                                               : std::vector<std::string>{entry.substr(at + 1)};
    for (const std::string& w : where)
      if (!contains(present, name + "@" + w) &&
          (choice.effects || !lacks_drive_for(effect_info, w, model)))
        add({name, w, {}});
  }
  const std::vector<TreeJoint> joints = tree_joints(model);
  for (const TreeJoint& j : joints)
    if (contains(choice.fit, "kinematics") || contains(choice.fit, "kinematics@" + j.name))
      add_kinematics(j.name, j.link, layout);
  for (const std::string& group : choice.fit)
    if (group.starts_with("kinematics@") &&
        std::ranges::find(joints, group.substr(11), &TreeJoint::name) == joints.end())
      find_joint(model, group.substr(11));  // throws, with the choices
  for (const std::string& entry : choice.fix) hold(entry, layout);
  return layout;
}

std::vector<Mat3<double>> joint_carriers(const Model& model) {
  const TreeMap map = map_to_tree(model);
  std::vector<Mat3<double>> out;
  for (const int i : tree_links(model)) {
    const int parent = model.links[static_cast<std::size_t>(i)].parent;
    out.push_back(parent < 0 ? Mat3<double>::identity()
                             : map.X_LF[static_cast<std::size_t>(parent)].R);
  }
  return out;
}

Model apply_fit(const Model& model, const FitLayout& layout, const VecX<double>& linear,
                const VecX<double>& shape) {
  require_size("apply_fit: linear", linear.size(), static_cast<long>(layout.linear.size()),
               "linear parameter");
  require_size("apply_fit: shape", shape.size(), static_cast<long>(layout.shape.size()),
               "shape parameter");
  Model out = model;
  const std::vector<int> moving = tree_links(model);
  VecX<double> pi(kThetaSize * static_cast<long>(moving.size()));
  std::vector<BoundEffect> effects = layout.effects;
  const auto set = [&](const FitParameter& p, double value) {
    if (p.kinematic >= 0) return;
    if (p.dof >= 0)
      pi[kThetaSize * p.dof + p.theta] = value;
    else
      effects[p.effect].parameters[p.index] = value;
  };
  const Tree<double> before = make_tree(model);  // its inertias stay bit by bit where none moved
  bool moved = false;
  for (std::size_t i = 0; i < layout.linear.size(); ++i) {
    const FitParameter& p = layout.linear[i];
    set(p, linear[i]);
    moved = moved || (p.dof >= 0 &&
                      linear[static_cast<long>(i)] !=
                          before.links[static_cast<std::size_t>(p.dof)].inertia.theta()[p.theta]);
  }
  for (std::size_t i = 0; i < layout.shape.size(); ++i) set(layout.shape[i], shape[i]);
  if (moved) set_inertial_parameters(out, pi);
  for (std::size_t i = 0; i + 5 < layout.shape.size(); ++i) {
    if (layout.shape[i].kinematic != 0) continue;
    Pose<double>& X =
        out.links[static_cast<std::size_t>(moving[static_cast<std::size_t>(layout.shape[i].dof)])]
            .X_PJ;
    const double* d = shape.data() + i;
    X.R = X.R * rotation_from_rpy<double>({d[0], d[1], d[2]});
    X.p = X.p + Vec3<double>{d[3], d[4], d[5]};
  }
  for (const BoundEffect& e : effects) {
    const EffectSpec spec = to_spec(e);
    const auto same = [&](const EffectSpec& s) {
      return s.effect == spec.effect && s.where == spec.where;
    };
    const auto it = std::ranges::find_if(out.effects, same);
    if (it != out.effects.end())
      *it = spec;
    else
      out.effects.push_back(spec);
  }
  return out;
}

}  // namespace diffnea
