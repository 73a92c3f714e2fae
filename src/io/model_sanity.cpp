#include "io/model_sanity.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <diffnea/core/random.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/dynamics/rnea.hpp>

#include "core/decompositions.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

using detail::number_text;

/// Density of osmium, the densest metal [kg/m³].
constexpr double kDensest = 22'600.0;

/// Radius of gyration / size of the robot that is no body's. The least error of a unit, grams of
/// mass, makes it √1000 as long: half way there, by its logarithm. A hull may be wider than joints.
constexpr double kBeyondRobot = 5.6;

/// Postures that a joint's load is looked at in: the share of them beyond a limit is known to
/// ±0.06.
constexpr int kPostures = 64;

double distance_of(const Vec3<double>& v) { return std::sqrt(dot(v, v)); }

/// Upper bound of the distance between any two joints, frames or centres of mass: the longest way
/// from the root outward, twice where branches part. Sliding joints add their stroke.
double robot_size(const Model& model) {
  std::vector<double> way(model.links.size(), 0.0);  // from the root to what is furthest of a link
  std::array<double, 2> longest{0.0, 0.0};
  std::vector<int> branch(model.links.size(), -1);
  std::vector<double> of_branch;
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const ModelLink& link = model.links[i];
    double step =
        link.parent < 0 ? 0.0 : distance_of(link.X_PJ.p);  // where it stands does not count
    if (link.type == ModelJoint::kPrismatic && std::isfinite(link.limits.upper) &&
        std::isfinite(link.limits.lower))
      step += std::max(std::abs(link.limits.upper), std::abs(link.limits.lower));
    if (link.parent >= 0) {
      way[i] = way[link.parent] + step;
      branch[i] = branch[link.parent];
    }
    const bool parts = link.parent < 0 || model.links[link.parent].parent < 0;
    if (parts) {
      branch[i] = static_cast<int>(of_branch.size());
      of_branch.push_back(0.0);
    }
    const double com = link.inertia.m > 0.0 ? distance_of(link.inertia.h) / link.inertia.m : 0.0;
    double& reach = of_branch[static_cast<std::size_t>(branch[i])];
    reach = std::max(reach, way[i] + com);
  }
  for (const double reach : of_branch) {
    if (reach > longest[0])
      longest = {reach, longest[0]};
    else
      longest[1] = std::max(longest[1], reach);
  }
  return longest[0] + longest[1];
}

/// " of joint 'elbow'" of the joint that moves a link, or that carries it.
std::string at_joint(const ModelLink& link) {
  return link.joint.empty() ? "" : " (joint '" + link.joint + "')";
}

void doubt_body(const ModelLink& link, double size, std::vector<ModelIssue>& out) {
  const double m = link.inertia.m;
  if (!(m > 0.0)) return;
  const Sym3<double> I = com_inertia(link.inertia).I;
  const double trace = I.xx + I.yy + I.zz;
  if (!(trace > 0.0)) return;
  if (I.xx == 1.0 && I.yy == 1.0 && I.zz == 1.0 && I.xy == 0.0 && I.xz == 0.0 && I.yz == 0.0) {
    out.push_back({link.name, "inertia is exactly 1, 1, 1 kg·m²" + at_joint(link) +
                                  " for a mass of " + number_text(m) +
                                  " kg: a placeholder? put the link's own"});
    return;
  }
  Eigen::Matrix3d J;
  J << I.xx, I.xy, I.xz, I.xy, I.yy, I.yz, I.xz, I.yz, I.zz;
  const double largest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(J).eigenvalues()[2],
               gyration = std::sqrt(largest / m);
  if (size > 0.0 && gyration > kBeyondRobot * size) {
    out.push_back({link.name, "radius of gyration is " + number_text(gyration) + " m" +
                                  at_joint(link) + ", the whole robot's joints lie within " +
                                  number_text(size) +
                                  " m: check the inertia's unit (kg·m²; g·mm² are 1e9, kg·mm² 1e6 "
                                  "of them) and the mass's (kg)"});
    return;
  }
  // ∫ρ² = ½ trace; of a ball it is ⅗ m R², and no body of this mass and second moment is larger.
  const double radius = std::sqrt(5.0 / 3.0 * 0.5 * trace / m),
               density = m / (4.0 / 3.0 * std::numbers::pi * radius * radius * radius);
  if (density > kDensest)
    out.push_back({link.name, "mass is " + number_text(m) + " kg" + at_joint(link) +
                                  " within a ball of " + number_text(1e3 * radius) +
                                  " mm at most, as its inertia says: " + number_text(density) +
                                  " kg/m³, no metal is above " + number_text(kDensest) +
                                  "; check the mass's unit (grams?) and the inertia's"});
}

/// Links that move others, hang away from their joints, and weigh nothing.
void doubt_massless(const Model& model, std::vector<ModelIssue>& out) {
  const TreeMap map = map_to_tree(model);
  const Tree<double> tree = make_tree(model);
  const std::vector<int> links = tree_links(model);
  for (int k = 0; k < tree.num_links(); ++k) {
    if (tree.links[k].inertia.m > 0.0 || tree.links[k].armature > 0.0) continue;
    double furthest = 0.0;
    for (const Link<double>& child : tree.links)
      if (child.parent == k) furthest = std::max(furthest, distance_of(child.X_PJ.p));
    if (furthest == 0.0) continue;  // axes that meet, as of a joint drawn as several
    const ModelLink& link = model.links[links[k]];
    out.push_back({link.name, "link has no mass" + at_joint(link) + ", though it carries a joint " +
                                  number_text(furthest) +
                                  " m away: its own weight is missing; state <inertial>"});
  }
}

/// Joints that gravity alone overloads in most postures within the limits.
void doubt_loads(const Model& model, std::vector<ModelIssue>& out) {
  const std::vector<int> moving = moving_links(model);
  const int n = static_cast<int>(moving.size());
  const Tree<double> tree = make_tree(model);
  RneaWorkspace<double, double> ws;
  Rng rng(1);
  RowMatX<double> load(kPostures, n);
  VecX<double> q = VecX<double>::Zero(tree.num_positions());
  if (tree.free_base) q[6] = 1.0;  // hung upright
  const long first = q.size() - n;
  for (int k = 0; k < kPostures; ++k) {
    for (int j = 0; j < n; ++j) {
      const ModelLink& link = model.links[moving[j]];
      const bool turns = link.type == ModelJoint::kRevolute;
      const double far = turns ? std::numbers::pi : 0.0;
      const bool limited = std::isfinite(link.limits.lower) && std::isfinite(link.limits.upper) &&
                           link.limits.lower <= link.limits.upper &&
                           link.limits.upper - link.limits.lower <= 1e3;
      q[first + j] =
          limited ? rng.uniform(link.limits.lower, link.limits.upper) : rng.uniform(-far, far);
    }
    load.row(k) = gravity_torques<double, double>(tree, q, ws).tail(n).transpose().cwiseAbs();
  }
  for (int j = 0; j < n; ++j) {
    const ModelLink& link = model.links[moving[j]];
    const double effort = link.limits.effort;
    if (link.passive || !std::isfinite(effort) || !(effort > 0.0)) continue;
    std::array<double, kPostures> sorted;
    for (int k = 0; k < kPostures; ++k) sorted[k] = load(k, j);
    std::ranges::sort(sorted);
    const double median = sorted[kPostures / 2];
    if (!(median > effort)) continue;
    const std::string unit = link.type == ModelJoint::kRevolute ? " N·m" : " N";
    out.push_back({link.name, "gravity takes " + number_text(median) + unit + " at joint '" +
                                  link.joint + "' in half of its postures, up to " +
                                  number_text(sorted.back()) + unit + ", and its effort limit is " +
                                  number_text(effort) + unit +
                                  ": check the masses (grams?) that it carries, and the limit"});
  }
}

}  // namespace

std::vector<ModelIssue> doubtful_inertias(const Model& model) {
  std::vector<ModelIssue> out;
  // A body that floats alone may be larger than its one link tells.
  const double size = model.free_base && moving_links(model).empty() ? 0.0 : robot_size(model);
  for (const ModelLink& link : model.links) doubt_body(link, size, out);
  doubt_massless(model, out);
  doubt_loads(model, out);
  return out;
}

}  // namespace diffnea::io
