#include "diagnose/candidates.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/effects/forward_dynamics.hpp>

namespace diffnea {
namespace {

/// Whether there are several joints, and all of one type: the same number is then the same thing
/// everywhere.
bool one_type(const Model& model, int base) {
  std::vector<int> moving = moving_links(model);
  moving.erase(moving.begin(), moving.begin() + base);
  return moving.size() > 1 && std::ranges::all_of(moving, [&](int l) {
           return model.links[l].type == model.links[moving[0]].type;
         });
}

/// One more coordinate of the grid: its values times all that there are.
void multiply_grid(Candidate& c, const std::vector<double>& values) {
  std::vector<std::vector<double>> grown;
  for (const std::vector<double>& point : c.grid)
    for (const double v : values) {
      grown.push_back(point);
      grown.back().push_back(v);
    }
  c.grid = std::move(grown);
}

/// Springs on which a link swings at 1.6 to 50 Hz, its motor held, a factor of √10 apart.
std::vector<double> springs(double inertia) {
  std::vector<double> out = log_grid(1e2, 1e5, 7);
  for (double& squared : out) squared *= inertia;
  return out;
}

void add_shape(Candidate& c, int parameter) {
  const ParameterInfo& p = c.effect.parameter_info[parameter];
  c.shapes.push_back(parameter);
  c.shape_low.push_back(scale(p) == Scale::kLog ? 0.0 : -p.most);
  c.shape_high.push_back(p.most);
  const bool of_spring = c.swings > 0.0 && p.name == "stiffness";
  multiply_grid(c, of_spring ? springs(c.swings) : p.search);
}

constexpr double kRotorKnown = 0.3;  ///< relative: as well as models state rotors
/// Share of a joint's inertia, where no model says, and error of its logarithm: from a fourteenth
/// to all of it.
constexpr double kRotorShare = 0.3, kRotorAssumed = 0.7;
/// Error of a joint's ln inertia at which a model states no rotor: two of a rotor's.
constexpr double kRefuted = 2.0 * kRotorKnown;

double joint_inertia(const Model& model, int joint) {
  const Tree<double> tree = make_tree(model);
  MassMatrixWorkspace<double, double> ws;
  return mass_matrix<double, double>(tree, VecX<double>::Zero(tree.num_dofs()), ws)(joint, joint);
}

/// Rotor that the model states, and a fit does not refute; 0: none.
double declared_rotor(const Model& model, const Model& links, int joint) {
  const double by = joint_inertia(links, joint) / joint_inertia(model, joint);
  return std::abs(std::log(by)) > kRefuted ? 0.0 : make_tree(model).armature(joint);
}

/// Rotor of a hidden motor: the armature that the model states, else a share of the joint's
/// inertia, and how well it is known. (Behind a spring, it counts where both show as their ratio
/// alone.)
double set_rotor(const Model& model, const Model& links, Candidate& c) {
  const int joint = c.effect.joints[0];
  const double stated = declared_rotor(model, links, joint);
  c.rotor_assumed = !(stated > 0.0);
  c.held = c.rotor_assumed ? kRotorAssumed : kRotorKnown;
  return c.rotor_assumed ? kRotorShare * joint_inertia(links, joint) : stated;
}

Candidate make_candidate(const EffectSpec& spec, const Model& model, const Model& links,
                         const std::vector<int>& runs) {
  Candidate c;
  static_cast<BoundEffect&>(c.effect) = bind(spec, model, runs);
  const HiddenMotor motor = c.effect.info().motor;
  const double rotor = motor != HiddenMotor::kNone ? set_rotor(model, links, c) : 0.0;
  if (motor == HiddenMotor::kSpring) {
    c.rotor = rotor;
    c.swings = joint_inertia(links, c.effect.joints[0]);
  }
  const Port port = c.effect.info().port;
  c.of_reference =
      (port != Port::kJointTorque && port != Port::kLinkForce) || reads_acceleration(c.effect);
  c.grid.emplace_back();
  for (std::size_t i = 0; i < c.effect.parameter_info.size(); ++i) {
    const ParameterInfo& p = c.effect.parameter_info[i];
    const int k = static_cast<int>(i);
    const bool grid_of_plain =
        scale(p) == Scale::kPlain && !p.search.empty() && p.sign == Sign::kFree;
    if (motor == HiddenMotor::kOther && p.name == "motor_inertia") {
      c.effect.parameters[i] = rotor;
    } else if (scale(p) == Scale::kLinear) {
      c.linear.push_back(k);
    } else if (grid_of_plain) {  // a ratio of either sign
      add_shape(c, k);
    } else if (!p.choices.empty()) {
      // No simulation has a motor behind its encoder without a rotor.
      if (p.name != "encoder_side" || !c.rotor_assumed) c.choices.push_back(k);
    } else if (scale(p) == Scale::kPlain && (c.effect.parameter_info.size() == 1 ||
                                             p.sign == Sign::kFree || p.name == "damping")) {
      c.linear.push_back(k);  // by its tangent, which moves with the others; damping from 0 on
      c.nonlinear = true;
    } else if (scale(p) == Scale::kLog && !p.search.empty()) {
      add_shape(c, k);
    }
  }
  for (const int k : c.choices) multiply_grid(c, c.effect.parameter_info[k].choices);
  // A hidden motor angle moves the base's friction with it, whatever the motor's inertia.
  if (c.linear.empty() || motor != HiddenMotor::kNone) c.nonlinear = true;
  return c;
}

/// Joints that move a link which carries no other; of those that move together one.
std::vector<std::string> end_joints(const Model& model) {
  const Tree<double> tree = make_tree(model);
  std::vector<std::string> out;
  std::vector<int> dofs;
  for (const TreeJoint& j : tree_joints(model)) {
    if (std::ranges::find(tree.links, j.link, &Link<double>::parent) != tree.links.end()) continue;
    if (std::ranges::find(dofs, j.drive.dof) != dofs.end()) continue;
    dofs.push_back(j.drive.dof);
    out.push_back(j.name);
  }
  return out;
}

/// Places at which an effect is tried: a robot that branches, or closes loops, or floats, has more
/// links than one that may carry something, or be pulled at.
std::vector<std::string> places_to_try(const EffectInfo& info, const Model& model, int base) {
  const std::vector<std::string> ends = end_joints(model);
  if (info.place != Place::kTip || (ends.size() == 1 && base == 0 && model.constraints.empty()))
    return places(info, model);
  if (info.has(Trait::kInertia)) return joint_names(model);
  return ends.size() == 1 || !model.constraints.empty() ? places(info, model) : ends;
}

/// Tells whether an effect would sit at a coordinate of a base that floats, where there is no
/// joint; what the last of them moves is the base itself, and what is of all channels is of its
/// pose, too.
bool sits_at_base(const BoundEffect& effect, int base) {
  const EffectInfo& info = effect.info();
  const int body = base - 1;
  if (info.place == Place::kBase || info.port == Port::kMeasurement)
    return std::ssize(effect.joints) == 1 && effect.joints[0] < base;
  return std::ranges::any_of(
      effect.joints, [&](int j) { return j < base && !(info.has(Trait::kInertia) && j == body); });
}

}  // namespace

int TriedEffect::index_of(const std::string& name) const {
  const auto at = std::ranges::find(parameter_info, name, &ParameterInfo::name);
  return at == parameter_info.end() ? -1 : static_cast<int>(at - parameter_info.begin());
}

EffectSpec to_spec(const TriedEffect& effect) {
  BoundEffect of_model = effect;
  if (effect.told >= 0) {
    of_model.parameter_info.pop_back();
    of_model.parameters.pop_back();
  }
  return to_spec(of_model);
}

void Candidate::set(const std::vector<double>& point, BoundEffect& of) const {
  for (std::size_t s = 0; s < point.size(); ++s) {
    const int k = s < shapes.size() ? shapes[s] : choices[s - shapes.size()];
    of.parameters[k] = point[s];
  }
}

std::vector<Candidate> make_candidates(const Model& model, const Model& links,
                                       const std::vector<std::string>& asked,
                                       const std::vector<int>& runs, bool link_side, int base) {
  std::vector<Candidate> out;
  const auto add = [&](const EffectInfo& info, const std::string& where) {
    out.push_back(make_candidate({info.name, where, {}}, model, links, runs));
  };
  if (asked.empty()) {
    for (const EffectInfo& info : catalogue()) {
      // Behind the drive a torque sensor still feels the joint's own friction, but no drive.
      if (link_side && info.motor_side && info.port == Port::kMemory) continue;
      // One offset for each of several runs; with one run it is the torque offset.
      if (runs.size() < 2 && std::ranges::any_of(info.parameters, &ParameterInfo::per_run))
        continue;
      if (info.has(Trait::kIfAsked) || acts_on_ball(info)) continue;
      for (const std::string& where : places_to_try(info, model, base)) add(info, where);
      if (info.has(Trait::kShared) && one_type(model, base)) add(info, "all");
    }
  }
  for (const std::string& entry : asked) {
    const std::size_t at = entry.find('@');
    const EffectInfo& effect_info = find_effect(entry.substr(0, at));
    if (at != std::string::npos)
      add(effect_info, entry.substr(at + 1));
    else
      for (const std::string& where : places_to_try(effect_info, model, base))
        add(effect_info, where);
  }
  std::erase_if(out, [&](const Candidate& c) { return sits_at_base(c.effect, base); });
  return out;
}

void add_own_candidates(const std::vector<OwnCandidate>& own, const Model& model,
                        std::vector<Candidate>& candidates) {
  const std::vector<std::string> joints = joint_names(model);
  for (const OwnCandidate& of : own) {
    const std::string what = "diagnose: candidate '" + of.name + "'";
    if (of.name.empty()) throw ModelError("diagnose: candidate without a name: expected one");
    if (std::ranges::any_of(catalogue(), [&](const EffectInfo& i) { return i.name == of.name; }))
      throw ModelError(what + ": an effect of the catalogue has that name; choose another");
    if (of.parameters.empty() || !of.columns)
      throw ModelError(what + ": expected one parameter or more, and a function of their columns");
    if (std::ranges::any_of(of.parameters, [](const ParameterInfo& p) { return !p.linear; }))
      throw ModelError(what +
                       ": the torque must be linear in its parameters; give one candidate for each "
                       "value of a shape");
    const int joint = find_joint(model, of.where);  // throws, with the choices
    if (std::ranges::any_of(candidates, [&](const Candidate& c) {
          return c.effect.info().name == of.name && c.effect.where == of.where;
        }))
      throw ModelError(what + " at '" + of.where + "' is there twice; give each its own name");
    auto described = std::make_shared<TriedEffect::Own>();
    static_cast<OwnCandidate&>(*described) = of;
    described->description = {.name = of.name,
                              .formula = "",
                              .summary = "the caller's own",
                              .place = Place::kJoint,
                              .port = Port::kJointTorque,
                              .parameters = of.parameters};
    Candidate c;
    c.effect.own = std::move(described);
    c.effect.where = of.where;
    c.effect.joints = {joint};
    c.effect.num_joints = static_cast<int>(joints.size());
    c.effect.parameter_info = of.parameters;
    c.effect.parameters.assign(of.parameters.size(), 0.0);
    for (std::size_t k = 0; k < of.parameters.size(); ++k) c.linear.push_back(static_cast<int>(k));
    c.grid.emplace_back();
    candidates.push_back(std::move(c));
  }
}

void tell_flights(std::vector<Candidate>& candidates) {
  for (Candidate& c : candidates) {
    if (c.effect.own || c.effect.info().motor != HiddenMotor::kOther) continue;
    c.shapes.push_back(c.effect.index_of("restitution"));
    c.shape_low.push_back(0.0);
    c.shape_high.push_back(c.effect.parameter_info[c.shapes.back()].most);
    std::vector<std::vector<double>> grown;
    for (const std::vector<double>& point : c.grid)
      for (const double bounces : {0.2, 0.5, 0.8}) {
        grown.push_back(point);  // the gap, then its choices
        grown.back().insert(grown.back().begin() + 1, bounces);
      }
    c.grid = std::move(grown);
    c.effect.told = static_cast<int>(c.effect.parameters.size());
    c.effect.parameter_info.push_back(
        {.name = "told", .unit = "1", .unit_prismatic = "1", .sign = Sign::kNonNegative});
    c.effect.parameters.push_back(1.0);
    c.linear.push_back(c.effect.told);
    c.nonlinear = false;
  }
}

}  // namespace diffnea
