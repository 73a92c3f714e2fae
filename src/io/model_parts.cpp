#include "io/model_parts.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/bound_effect.hpp>

namespace diffnea::io {
namespace {

/// Rotations and axes that a person wrote with six digits pass.
constexpr double kRotationTol = 1e-5;
constexpr double kRoundingTol = 1e-13;

constexpr std::size_t kMaxLinks = 2000, kMaxEffects = 10'000;

bool finite(const Vec3<double>& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

void check_pose(const Pose<double>& X, const std::string& what) {
  bool ok = finite(X.p);
  for (int i = 0; i < 3 && ok; ++i) {
    const Vec3<double> next = cross(X.R.col[i], X.R.col[(i + 1) % 3]) - X.R.col[(i + 2) % 3];
    ok = finite(X.R.col[i]) && std::abs(dot(X.R.col[i], X.R.col[i]) - 1.0) < kRotationTol &&
         dot(next, next) < kRotationTol * kRotationTol;
  }
  if (!ok) throw ModelError(what + ": its pose is not a rotation and a finite position");
}

void check_ball(const BallSpec& ball, std::size_t num_links, const std::string& where) {
  const auto expect = [&](bool ok, const char* what, double value, const char* unit_and_range) {
    if (!ok) throw ModelError(where + ": " + what + " is " + exact(value) + unit_and_range);
  };
  expect(std::isfinite(ball.mass) && ball.mass > 0.0, "the ball's mass", ball.mass,
         " kg, expected > 0");
  expect(std::isfinite(ball.radius) && ball.radius >= 0.0, "the ball's radius", ball.radius,
         " m, expected > 0, or 0 where it is not known");
  if (!ball.string) return;
  expect(std::isfinite(ball.string->length) && ball.string->length > 0.0, "the string's length",
         ball.string->length, " m, expected > 0 (a ball without a string has none)");
  if (!finite(ball.string->p_LS))
    throw ModelError(where + ": the string's attachment is not a finite position");
  if (ball.string->link < -1 || ball.string->link >= static_cast<int>(num_links))
    throw ModelError(where + ": the string is tied to no link of the model");
}

void check_cup(const Model& model, const std::string& where) {
  const CupSpec& cup = *model.cup;
  const std::string numbers = "inner radius " + exact(cup.inner_radius) + ", wall " +
                              exact(cup.wall) + ", floor " + exact(cup.floor) + ", rim " +
                              exact(cup.rim) + " m";
  if (!std::isfinite(cup.inner_radius + cup.wall + cup.floor + cup.rim) ||
      !(cup.inner_radius > 0.0) || !(cup.wall > 0.0) || !(cup.floor < cup.rim))
    throw ModelError(where + ": the cup has " + numbers +
                     ", expected a radius and a wall above 0 and a floor below the rim");
  if (std::ranges::find(model.frames, "cup", &ModelFrame::name) == model.frames.end())
    throw ModelError(where +
                     ": there is no frame 'cup' that the cup's numbers belong to; add one at the "
                     "cup with its z axis out of the opening (MJCF: <site name=\"cup\"/> in its "
                     "body), or leave the cup out");
}

void check_obstacle(const CapsuleSpec& o, std::size_t num_links, const std::string& what) {
  if (o.link < -1 || o.link >= static_cast<int>(num_links))
    throw ModelError(what + ": is fixed to no link of the model");
  if (!finite(o.p_LA) || !finite(o.p_LB) || !std::isfinite(o.radius) || !(o.radius > 0.0))
    throw ModelError(what + ": expected a finite segment and a radius above 0, which is " +
                     exact(o.radius) + " m");
}

void check_constraint(const ConstraintSpec& c, std::size_t num_links, const std::string& what) {
  for (const ConstraintEnd* end : {&c.first, &c.second}) {
    if (end->link < -1 || end->link >= static_cast<int>(num_links))
      throw ModelError(what + ": acts at no link of the model");
    check_pose(end->X_LF, what);
  }
  if (c.kind == ConstraintKind::kRolling) {
    if (!(std::isfinite(c.radius) && c.radius > 0.0))
      throw ModelError(what + ": the wheel's radius is " + exact(c.radius) + " m, expected > 0");
    if (c.second.link < 0) throw ModelError(what + ": the wheel is no link, expected one");
  } else if (c.first.link == c.second.link) {
    throw ModelError(what + ": both of its ends are on one link, expected two links");
  }
}

double largest(const Theta<double>& t) {
  double m = 0.0;
  for (const double x : t) m = std::max(m, std::abs(x));
  return m;
}

/// The number that a native field of a joint is; null: JointTerms has none for it.
double* term_of(NativeField field, JointTerms& terms) {
  switch (field) {
    case NativeField::kArmature:
      return &terms.armature;
    case NativeField::kDamping:
      return &terms.viscous;
    case NativeField::kFrictionLoss:
      return &terms.coulomb;
    case NativeField::kStiffness:
      return &terms.stiffness;
    case NativeField::kSpringReference:
      return &terms.rest;
    default:
      return nullptr;
  }
}

}  // namespace

void add_joint_terms(Model& model, const ModelLink& link, const JointTerms& terms) {
  const bool slides = link.type == ModelJoint::kPrismatic;
  JointTerms values = terms;
  for (const NativeField field : {NativeField::kArmature, NativeField::kDamping,
                                  NativeField::kFrictionLoss, NativeField::kStiffness}) {
    if (*term_of(field, values) == 0.0) continue;
    EffectSpec effect{effect_of(field), link.joint, {}};
    for (const ParameterInfo& p : find_effect(effect.effect).parameters)
      if (const double* value = term_of(p.native, values))
        effect.parameters.push_back({p.name, *value, slides ? p.unit_prismatic : p.unit});
    model.effects.push_back(std::move(effect));
  }
}

JointTerms joint_terms(const Model& model, const std::string& joint) {
  JointTerms t;
  for (const EffectSpec& e : model.effects) {
    const EffectInfo* info = known_effect(e.effect);
    if (e.where != joint || !info) continue;
    for (const EffectParameter& p : e.parameters)
      for (const ParameterInfo& of : info->parameters)
        if (double* value = term_of(of.native, t); value && of.name == p.name)
          *value = of.native == NativeField::kSpringReference ? p.value : *value + p.value;
  }
  return t;
}

bool is_joint_term(const Model& model, const EffectSpec& effect) {
  const EffectInfo* info = known_effect(effect.effect);
  JointTerms terms;
  const bool at_joint = std::ranges::any_of(model.links, [&](const ModelLink& link) {
    return link.type != ModelJoint::kFixed && link.joint == effect.where;
  });
  return info && at_joint && std::ranges::any_of(info->parameters, [&](const ParameterInfo& p) {
           return term_of(p.native, terms) != nullptr;
         });
}

void require_few_links(std::size_t links, const std::string& where) {
  if (links > kMaxLinks)
    throw ModelError(where + ": has " + std::to_string(links) + " links; the limit is " +
                     std::to_string(kMaxLinks));
}

void validate(const Model& model, const std::string& where) {
  require_few_links(model.links.size(), where);
  if (model.effects.size() > kMaxEffects)
    throw ModelError(where + ": has " + std::to_string(model.effects.size()) +
                     " effects; the limit is " + std::to_string(kMaxEffects));
  std::set<std::string> links, joints, frames;
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const ModelLink& link = model.links[i];
    const std::string what = where + ": link '" + link.name + "'";
    if (link.name.empty()) throw ModelError(where + ": link " + std::to_string(i) + " has no name");
    if (!links.insert(link.name).second)
      throw ModelError(what + ": there are two links of this name");
    if (link.parent < -1 || link.parent >= static_cast<int>(i))
      throw ModelError(what + ": comes before its parent");
    if (link.type != ModelJoint::kFixed) {
      if (link.joint.empty()) throw ModelError(what + ": its joint has no name");
      const double norm = std::sqrt(dot(link.axis, link.axis));
      if (!(std::abs(norm - 1.0) < kRotationTol))
        throw ModelError(what + ": axis of joint '" + link.joint + "' has length " + exact(norm) +
                         ", expected 1");
    }
    if (link.follows &&
        !(std::isfinite(link.follows->ratio) && std::isfinite(link.follows->offset)))
      throw ModelError(what + ": joint '" + link.joint + "' follows '" + link.follows->leader +
                       "' by numbers that are not finite");
    if (!link.joint.empty() && !joints.insert(link.joint).second)
      throw ModelError(where + ": there are two joints named '" + link.joint + "'");
    check_pose(link.X_PJ, what);
    if (!std::ranges::all_of(link.inertia.theta(), [](double x) { return std::isfinite(x); }))
      throw ModelError(what + ": its inertia is not finite");
    if (std::isnan(link.limits.lower) || std::isnan(link.limits.upper) ||
        !(link.limits.velocity >= 0.0) || !(link.limits.effort >= 0.0))
      throw ModelError(what + ": limits of joint '" + link.joint +
                       "' must be numbers, those of velocity and effort not negative");
  }
  if (model.free_base) {
    Model floats = model;
    let_base_float(floats, where);  // throws for links beside the base
    if (model.ball || model.cup || !model.obstacles.empty())
      throw ModelError(where +
                       ": has a ball beside a base that floats; --fix-base "
                       "(fix_base=True) reads the base as fixed where the file has it");
  }
  tree_joints(model);  // throws for a joint that follows none
  for (const ModelFrame& f : model.frames) {
    const std::string what = where + ": frame '" + f.name + "'";
    if (f.name.empty() || !frames.insert(f.name).second)
      throw ModelError(what + ": a frame needs a name of its own");
    if (f.link < -1 || f.link >= static_cast<int>(model.links.size()))
      throw ModelError(what + ": names no link");
    check_pose(f.X_LF, what);
  }
  std::set<std::string> constraints;
  if (model.constraints.size() > kMaxLinks)
    throw ModelError(where + ": has " + std::to_string(model.constraints.size()) +
                     " constraints; the limit is " + std::to_string(kMaxLinks));
  for (const ConstraintSpec& c : model.constraints) {
    const std::string what = where + ": constraint '" + c.name + "'";
    if (c.name.empty() || !constraints.insert(c.name).second)
      throw ModelError(what + ": a constraint needs a name of its own");
    check_constraint(c, model.links.size(), what);
  }
  for (const EffectSpec& e : model.effects)
    for (const EffectParameter& p : e.parameters)
      if (!std::isfinite(p.value))
        throw ModelError(where + ": " + e.effect + " at " + e.where + ": parameter '" + p.name +
                         "' is not finite");
  if (model.ball) check_ball(*model.ball, model.links.size(), where);
  if (model.cup) check_cup(model, where);
  for (std::size_t i = 0; i < model.obstacles.size(); ++i)
    check_obstacle(model.obstacles[i], model.links.size(),
                   where + ": obstacle " + std::to_string(i));
  if (!finite(model.gravity)) throw ModelError(where + ": gravity is not finite");
}

std::string exact(double value) {
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value);
  return {buffer, end.ptr};
}

std::string exact(const Vec3<double>& v) {
  return exact(v.x) + " " + exact(v.y) + " " + exact(v.z);
}

ComInertia com_inertia(const SpatialInertia<double>& inertia) {
  return {inertia.h * (1.0 / inertia.m), inertia_about_com(inertia)};
}

bool is_zero(const SpatialInertia<double>& inertia) {
  return std::ranges::all_of(inertia.theta(), [](double x) { return x == 0.0; });
}

bool same(const SpatialInertia<double>& a, const SpatialInertia<double>& b) {
  const Theta<double> x = a.theta(), y = b.theta();
  const double scale = std::max(largest(x), largest(y));
  for (int i = 0; i < kThetaSize; ++i)
    if (std::abs(x[i] - y[i]) > kRoundingTol * scale) return false;
  return true;
}

bool same(const Pose<double>& a, const Pose<double>& b) {
  for (int i = 0; i < 3; ++i) {
    const Vec3<double> d = a.R.col[i] - b.R.col[i];
    if (dot(d, d) > kRoundingTol * kRoundingTol) return false;
  }
  const Vec3<double> d = a.p - b.p;
  return dot(d, d) <= kRoundingTol * kRoundingTol * (1.0 + dot(a.p, a.p));
}

}  // namespace diffnea::io
