#include "excite/limits.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <diffnea/core/error.hpp>

#include "core/c_numbers.hpp"
#include "core/constants.hpp"

namespace diffnea {
namespace {

/// The value for a joint: its own, else that for all.
template <class T>
const T* find(const std::map<std::string, T>& values, const std::string& joint) {
  for (const std::string& name : {joint, std::string()})
    if (const auto at = values.find(name); at != values.end()) return &at->second;
  return nullptr;
}

template <class T>
void check_names(const Model& model, const std::map<std::string, T>& values) {
  for (const auto& [joint, value] : values)
    if (!joint.empty()) find_joint(model, joint);
}

/// Narrows the limits of a degree of freedom to what the joints that follow it can move along.
void keep_followers_inside(const Model& model, int dof, JointLimits& limits) {
  const std::vector<int> links = tree_links(model);
  for (const TreeJoint& j : tree_joints(model)) {
    if (!j.follows || j.drive.dof != dof || j.drive.ratio == 0.0) continue;
    const JointLimits& of = model.links[static_cast<std::size_t>(links[j.link])].limits;
    double low = (of.lower - j.drive.offset) / j.drive.ratio,
           high = (of.upper - j.drive.offset) / j.drive.ratio;
    if (low > high) std::swap(low, high);
    low = std::max(limits.lower, low);
    high = std::min(limits.upper, high);
    if (low < high) {  // else the file's own limits contradict its coupling
      limits.lower = low;
      limits.upper = high;
    }
    limits.velocity = std::min(limits.velocity, of.velocity / std::abs(j.drive.ratio));
  }
}

}  // namespace

bool is_given(double limit) { return limit > 0.0 && std::isfinite(limit); }

std::string short_number(double x) {
  char text[32];
  detail::print(text, sizeof text, "%.4g", x);
  return text;
}

JointRange range_of(const ModelLink& link, const FourierOptions& o) {
  const bool turns = link.type == ModelJoint::kRevolute;
  const JointLimits& l = link.limits;
  if (l.lower > l.upper)
    throw ModelError("excite: the limits of joint '" + link.joint + "' are inverted: lower " +
                     short_number(l.lower) + ", upper " + short_number(l.upper) +
                     "; correct the model");
  JointRange r;
  r.half = turns ? o.half_range : o.half_stroke;
  r.velocity = turns ? o.velocity : o.slide_velocity;
  r.effort = is_given(l.effort) ? l.effort * o.effort_share : kInfinity;
  r.driven = !link.passive;
  const bool low = std::isfinite(l.lower), high = std::isfinite(l.upper);
  if (low && high) {
    r.middle = 0.5 * (l.lower + l.upper);
    r.half = 0.5 * (l.upper - l.lower) * o.position_share;
    // Joints that may turn right round need not.
    if (turns) r.half = std::min(r.half, 2.0);
  } else if (low) {
    r.middle = std::max(0.0, l.lower + r.half);
  } else if (high) {
    r.middle = std::min(0.0, l.upper - r.half);
  }
  if (is_given(l.velocity)) r.velocity = std::min(l.velocity, 2.0 * r.velocity) * o.velocity_share;
  r.acceleration = r.velocity / o.ramp;
  return r;
}

std::vector<JointRange> joint_ranges(const Model& model, const FourierOptions& options,
                                     const LimitOverrides& limits) {
  check_names(model, limits.position);
  for (const auto* values : {&limits.velocity, &limits.acceleration, &limits.effort}) {
    check_names(model, *values);
    for (const auto& [joint, value] : *values)
      if (!is_given(value))
        throw ModelError("excite: got a limit of " + short_number(value) + " for " +
                         (joint.empty() ? "all joints" : "joint '" + joint + "'") +
                         ", expected a number above 0");
  }
  std::vector<JointRange> out;
  bool driven = false, moves = false;
  for (const int i : moving_links(model)) {
    ModelLink link = model.links[static_cast<std::size_t>(i)];
    keep_followers_inside(model, static_cast<int>(out.size()), link.limits);
    if (const auto* p = find(limits.position, link.joint)) {
      link.limits.lower = p->first;
      link.limits.upper = p->second;
    }
    JointRange r = range_of(link, options);
    if (find(limits.position, link.joint)) r.half = 0.5 * (link.limits.upper - link.limits.lower);
    if (const double* v = find(limits.velocity, link.joint)) {
      r.velocity = *v;
      r.acceleration = *v / options.ramp;
    }
    if (const double* a = find(limits.acceleration, link.joint)) r.acceleration = *a;
    if (const double* e = find(limits.effort, link.joint)) r.effort = *e;
    if (!r.driven) r = {.effort = kInfinity};
    driven |= r.driven;
    moves |= r.moves();
    out.push_back(r);
  }
  if (!driven) throw ModelError(model.name + ": no joint has a motor; there is nothing to excite");
  if (!moves)
    throw ModelError(model.name +
                     ": the limits of every joint with a motor leave no range, there is nothing to "
                     "excite; correct them, or leave them out");
  return out;
}

}  // namespace diffnea
