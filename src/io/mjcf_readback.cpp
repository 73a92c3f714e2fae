#include "io/mjcf_readback.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>

#include "io/mjcf.hpp"
#include "io/mjcf_joint.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

/// Numbers are written to the last bit; principal axes, degrees and a flat body's largest moment
/// (1e-9) round. What is overruled differs by far more.
constexpr double kReadBackTol = 1e-8;

bool near(double a, double b, double scale) {
  return a == b || std::abs(a - b) <= kReadBackTol * scale;
}
bool near(double a, double b) { return near(a, b, std::max(std::abs(a), std::abs(b))); }
bool near(const Vec3<double>& a, const Vec3<double>& b) {
  const Vec3<double> d = a - b;
  return dot(d, d) <= kReadBackTol * kReadBackTol * (1.0 + dot(a, a));
}
bool near(const Pose<double>& a, const Pose<double>& b) {
  return near(a.p, b.p) && near(a.R.col[0], b.R.col[0]) && near(a.R.col[1], b.R.col[1]);
}
/// To the body's own scale.
bool near(const SpatialInertia<double>& a, const SpatialInertia<double>& b) {
  const Theta<double> x = a.theta(), y = b.theta();
  double scale = 0.0;
  for (int i = 0; i < kThetaSize; ++i) scale = std::max({scale, std::abs(x[i]), std::abs(y[i])});
  for (int i = 0; i < kThetaSize; ++i)
    if (!near(x[i], y[i], scale)) return false;
  return true;
}
bool near(const BallSpec& a, const BallSpec& b) {
  return near(a.mass, b.mass) && a.string.has_value() == b.string.has_value() &&
         (!a.string || (a.string->link == b.string->link && near(a.string->p_LS, b.string->p_LS) &&
                        near(a.string->length, b.string->length)));
}

/// What of a joint is not as it should be; empty if all is.
std::string difference(const JointTerms& a, const JointTerms& b) {
  if (!near(a.viscous, b.viscous)) return "damping";
  if (!near(a.coulomb, b.coulomb)) return "friction loss";
  if (!near(a.armature, b.armature)) return "armature";
  if (!near(a.stiffness, b.stiffness)) return "stiffness";
  const bool has_spring = a.stiffness != 0.0;
  return has_spring && !near(a.rest, b.rest, 1.0) ? "rest of the spring" : "";
}

std::string difference(const Model& model, const Model& read) {
  const auto alike = [](const ModelLink& a, const ModelLink& b) {
    return a.name == b.name && a.joint == b.joint && a.type == b.type && a.parent == b.parent;
  };
  if (!std::ranges::equal(model.links, read.links, alike)) return "the tree of links";
  if (model.free_base != read.free_base) return "whether the base floats";
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const ModelLink &a = model.links[i], &b = read.links[i];
    if (!near(a.X_PJ, b.X_PJ)) return "the pose of '" + a.name + "'";
    if (!near(a.inertia, b.inertia)) return "the inertia of '" + a.name + "'";
    if (a.type == ModelJoint::kFixed) continue;
    const JointLimits range = mjcf_range(a.limits);
    if (!near(range.lower, b.limits.lower, 1.0) || !near(range.upper, b.limits.upper, 1.0))
      return "the range of joint '" + a.joint + "'";
    const Follow none, f = a.follows.value_or(none), g = b.follows.value_or(none);
    if (f.leader != g.leader || !near(f.ratio, g.ratio) || !near(f.offset, g.offset, 1.0))
      return "the coupling of joint '" + a.joint + "'";
    const std::string term = difference(joint_terms(model, a.joint), joint_terms(read, b.joint));
    if (!term.empty()) return "the " + term + " of joint '" + a.joint + "'";
  }
  if (!near(model.gravity, read.gravity)) return "gravity";
  if (model.ball.has_value() != read.ball.has_value() ||
      (model.ball && !near(*model.ball, *read.ball)))
    return "the ball";
  return "";
}

}  // namespace

void require_it_says(const mjModel& written, const Model& model, const Mjcf& mjcf) {
  const std::string what = difference(model, model_from_mujoco(written, mjcf));
  if (!what.empty())
    throw ModelError(mjcf.where + ": " + what +
                     " would read back as another value than the one put there, which something "
                     "else in the document overrules; write the model as .json");
}

}  // namespace diffnea::io
