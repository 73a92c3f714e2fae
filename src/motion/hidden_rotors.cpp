#include "motion/hidden_rotors.hpp"

#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/effects/stepping.hpp>

namespace diffnea {
namespace {

/// Rotor over what the links have about its joint: a lighter one moves as one without inertia
/// would, and takes shorter steps.
constexpr double kLight = 0.01;

/// Inertias that the links have about their joints, (n).
VecX<double> link_inertias(Tree<double> tree) {
  for (Link<double>& link : tree.links) link.armature = 0.0;
  MassMatrixWorkspace<double, double> ws;
  return mass_matrix<double, double>(tree, VecX<double>::Zero(tree.num_dofs()), ws).diagonal();
}

/// Adds a link that stands beside the tree, with its own degree of freedom.
void add_beside(JointType type, double inertia, Tree<double>& tree) {
  Link<double> link;
  link.type = type;
  link.armature = inertia;
  tree.links.push_back(link);
  if (tree.coordinates.plain()) return;
  tree.coordinates.joints.push_back({tree.coordinates.count, 1.0, 0.0});
  ++tree.coordinates.count;
}

/// The gear between the given degrees of freedom. What bounces off its teeth is the inertia of both
/// sides in series.
BoundEffect gear_between(BoundEffect gear, std::vector<int> dofs, double inertia) {
  gear.joints = std::move(dofs);
  gear.is_gear = true;
  for (std::size_t k = 0; k < gear.parameters.size(); ++k)
    if (gear.parameter_info[k].name == "motor_inertia") gear.parameters[k] = inertia;
  return gear;
}

}  // namespace

bool fits_of_gear(const ParameterInfo& p) { return !p.search.empty() || p.name == "damping"; }

HiddenRotors::HiddenRotors(ExtendedTree& model) : joints_(model.tree.num_dofs()) {
  shares_.assign(static_cast<std::size_t>(joints_), -1.0);
  const auto integrates = [](const BoundEffect& e) { return e.info().has(Trait::kIntegrates); };
  if (model.tree.free_base || (std::ranges::none_of(model.series, hides_motor) &&
                               std::ranges::none_of(model.effects, integrates)))
    return;
  const VecX<double> inertia = link_inertias(model.tree);
  for (int j = 0; j < joints_; ++j)
    for (const BoundEffect& e : model.series)
      for (std::size_t k = 0; hides_motor(e) && k < e.joints.size(); ++k)
        if (e.joints[k] == j) add(e, k, inertia[j], model.tree);
  std::erase_if(model.series, hides_motor);
  for (const BoundEffect& e : model.effects)
    for (const int j : e.joints)
      if (integrates(e) && !integrator(j)) {
        integrators_.push_back({j, dofs(), model.tree.num_links()});
        add_beside(model.tree.links[static_cast<std::size_t>(e.links.front())].type, 1.0,
                   model.tree);
      }
  std::vector<BoundEffect> acting;
  for (const BoundEffect& e : model.effects)
    for (const EffectPart& part : parts(e))
      if (part.share > 0.0) acting.push_back(scaled(part.effect, part.share));
  for (const HiddenRotor& r : rotors_) acting.push_back(r.gear);
  model.effects = std::move(acting);
}

void HiddenRotors::add(const BoundEffect& gear, std::size_t k, double link, Tree<double>& tree) {
  const int joint = gear.joints[k];
  const std::string here = "motion: " + gear.info().name + " at '" + gear.where + "': ";
  if (at(joint))
    throw ModelError(here +
                     "the joint has a hidden motor already; one elasticity or backlash a joint");
  if (!gear.runs.empty())
    throw ModelError(here +
                     "it belongs to the drive and acts in every recording; leave out ':run='");
  HiddenRotor r;
  r.joint = joint;
  r.rotor = dofs();
  r.link = tree.num_links();
  r.read = encoder_at_motor(gear);
  r.friction_share = motor_spring(gear).friction_share;
  Link<double>& carried = tree.links[static_cast<std::size_t>(gear.links[k])];
  const double inertia = std::max(carried.armature, kLight * link);
  r.gear = gear_between(gear, {r.joint, r.rotor}, inertia * link / (inertia + link));
  r.gear.links = {gear.links[k]};
  carried.armature = 0.0;
  add_beside(carried.type, inertia, tree);
  shares_[static_cast<std::size_t>(joint)] = r.friction_share;
  rotors_.push_back(std::move(r));
}

const HiddenRotor* HiddenRotors::at(int joint) const {
  const auto found = std::ranges::find(rotors_, joint, &HiddenRotor::joint);
  return found == rotors_.end() ? nullptr : &*found;
}

int HiddenRotors::encoder(int joint) const {
  const HiddenRotor* r = at(joint);
  return r ? r->encoder() : joint;
}

int HiddenRotors::joint_of(int dof) const {
  return dof < joints_ ? dof : joints_behind()[static_cast<std::size_t>(dof - joints_)];
}

std::vector<int> HiddenRotors::joints_behind() const {
  std::vector<int> out;
  for (const HiddenRotor& r : rotors_) out.push_back(r.joint);
  for (const DriveIntegrator& i : integrators_) out.push_back(i.joint);
  return out;
}

int HiddenRotors::drive(int joint) const {
  const HiddenRotor* r = at(joint);
  return r ? r->rotor : joint;
}

const DriveIntegrator* HiddenRotors::integrator(int joint) const {
  const auto found = std::ranges::find(integrators_, joint, &DriveIntegrator::joint);
  return found == integrators_.end() ? nullptr : &*found;
}

void HiddenRotors::at_drives(const Eigen::Ref<const VecX<double>>& u, VecX<double>& out) const {
  out.setZero(dofs());
  out.head(joints_) = u;
  for (const HiddenRotor& r : rotors_) {
    out[r.rotor] = u[r.joint];
    out[r.joint] = 0.0;
  }
}

std::vector<EffectPart> HiddenRotors::parts(const BoundEffect& whole) const {
  std::vector<EffectPart> out = parts_at_sides(whole);
  const bool of_law = whole.info().has(Trait::kReadsCommand) || whole.info().has(Trait::kOfServo);
  if (!of_law || !whole.follows.empty()) return out;
  std::vector<EffectPart> single;
  for (const EffectPart& part : out)
    for (std::size_t k = 0; k < part.effect.joints.size(); ++k) {
      const int joint = joint_of(part.effect.joints[k]);
      EffectPart one = part;
      one.effect.joints = {part.effect.joints[k]};
      one.effect.links = {part.effect.links[k]};
      one.effect.encoders = {encoder(joint)};
      const DriveIntegrator* i = integrator(joint);
      if (i) one.effect.encoders.push_back(i->dof);
      single.push_back(one);
      if (!i || !whole.info().has(Trait::kReadsCommand)) continue;
      one.effect.joints = {i->dof};
      one.effect.links = {i->link};
      one.shapes_alone = true;
      single.push_back(std::move(one));
    }
  return single;
}

/// Parts on either side of hidden motors.
std::vector<EffectPart> HiddenRotors::parts_at_sides(const BoundEffect& whole) const {
  const bool acts = std::ranges::any_of(whole.joints, [&](int j) { return at(j); });
  if (!acts || whole.info().port == Port::kModelParameter) return {{whole}};
  if (hides_motor(whole)) {
    std::vector<EffectPart> out;
    for (const int j : whole.joints) {
      BoundEffect gear = at(j)->gear;
      gear.parameters = whole.parameters;
      for (std::size_t k = 0; k < gear.parameters.size(); ++k)
        if (!fits_of_gear(gear.parameter_info[k])) gear.parameters[k] = at(j)->gear.parameters[k];
      out.push_back({std::move(gear)});
    }
    return out;
  }
  const bool of_drive = whole.info().has(Trait::kRotor) || whole.info().has(Trait::kReadsCommand);
  std::vector<EffectPart> out;
  for (const BoundEffect& e : parts_at_motors(whole, shares_)) {
    if (std::ranges::none_of(e.joints, [&](int j) { return at(j); })) {
      out.push_back({e});
      continue;
    }
    const double share = of_drive ? 1.0 : share_at_motors(e, shares_);
    if (share > 0.0 && reads_acceleration(e) && !e.info().has(Trait::kRotor))
      throw ModelError(
          "motion: " + e.info().name + " at '" + e.where +
          "' cannot act at a joint with elasticity or backlash; leave one of them out");
    if (share < 1.0) out.push_back({e, 1.0 - share});
    if (!(share > 0.0)) continue;
    BoundEffect moved = e;
    for (std::size_t k = 0; k < e.joints.size(); ++k) {
      const HiddenRotor* r = at(e.joints[k]);
      if (!r) continue;
      moved.joints[k] = r->rotor;
      moved.links[k] = r->link;
      if (k < moved.follows.size()) moved.follows[k].dof = r->rotor;
    }
    out.push_back({std::move(moved), share});
  }
  return out;
}

}  // namespace diffnea
