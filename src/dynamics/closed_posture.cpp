#include "dynamics/closed_posture.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/random.hpp>

#include "core/decompositions.hpp"

namespace diffnea {
namespace {

constexpr int kMostSteps = 20;  ///< Gauss–Newton's: near a closed posture three do
/// Firmness that a posture has at least, if any that is found has (LoopMotion::follow).
constexpr double kFirm = 0.1;
constexpr int kTries = 200;      ///< random postures, where the loop is open at the given one
constexpr double kSpread = 1.5;  ///< largest standard deviation of these [rad, m]

double largest(const VecX<double>& x) { return x.size() > 0 ? x.cwiseAbs().maxCoeff() : 0.0; }

/// Tells whether frames of welds and axes of hinges are no half turn apart.
bool faces(const Model& model, const Tree<double>& tree, const VecX<double>& q) {
  const TreeMap map = map_to_tree(model);
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(tree, q, kinematics);
  const auto turn = [&](const ConstraintEnd& end) {
    const auto [link, X_LF] = place_in_tree(map, end.link);
    return frame_pose(kinematics, link, X_LF * end.X_LF).R;
  };
  return std::ranges::all_of(model.constraints, [&](const ConstraintSpec& c) {
    if (c.kind != ConstraintKind::kWeld && c.kind != ConstraintKind::kHinge) return true;
    const Mat3<double> J = turn(c.first), K = turn(c.second);
    double same = dot(J.col[2], K.col[2]);
    if (c.kind == ConstraintKind::kWeld)
      same = std::min({same, dot(J.col[0], K.col[0]), dot(J.col[1], K.col[1])});
    return same > 0.0;
  });
}

/// How firmly the drives hold a posture: least length of a motion of unit length at them. No drive
/// holds a base that floats, so that all postures are alike.
double firmness(const Tree<double>& tree, const TreeConstraints<double>& constraints,
                const std::vector<int>& drives, const VecX<double>& q) {
  if (tree.free_base) return std::numeric_limits<double>::infinity();
  const VecX<double> still = VecX<double>::Zero(tree.num_velocities());
  const MatX<double> N = constraint_null_space(tree_rows(tree, constraints, q, still).J);
  if (drives.empty() || N.cols() == 0 || std::ssize(drives) < N.cols()) return 0.0;
  const MatX<double> of_drives = N(drives, Eigen::all);
  return Eigen::JacobiSVD<MatX<double>>(of_drives).singularValues()[N.cols() - 1];
}

}  // namespace

ProjectionOptions closing(const std::vector<int>& held) {
  return {.held = held, .tolerance = 1e-11, .most_steps = kMostSteps};
}

std::vector<int> driven_joints(const Model& model) {
  std::vector<int> out;
  const std::vector<int> moving = moving_links(model);
  for (std::size_t j = 0; j < moving.size(); ++j)
    if (!model.links[static_cast<std::size_t>(moving[j])].passive)
      out.push_back(static_cast<int>(j));
  return out;
}

ClosedPosture closed_posture(const Model& model, const Tree<double>& tree,
                             const TreeConstraints<double>& constraints, const VecX<double>& q) {
  const int n = tree.num_dofs();
  const std::vector<int> moving = moving_links(model), drives = driven_joints(model);
  VecX<double> low(n), high(n);
  for (int j = 0; j < n; ++j) {
    const JointLimits& l =
        model.links[static_cast<std::size_t>(moving[static_cast<std::size_t>(j)])].limits;
    low[j] = l.lower;
    high[j] = l.upper;
  }
  Rng rng(1);
  double best = std::numeric_limits<double>::infinity();
  ClosedPosture out;
  for (int k = 0; k <= kTries; ++k) {
    VecX<double> start = q;
    auto joints = start.tail(n);
    for (int j = 0; j < n && k > 0; ++j)
      joints[j] = std::clamp(joints[j] + kSpread * k / kTries * rng.normal(), low[j], high[j]);
    const ProjectedPositions found = project_positions(tree, constraints, start, closing({}));
    if (k == 0) out = {found.q, false, found.residual};
    if (!(found.residual <= kClosedLoop) || !faces(model, tree, found.q)) continue;
    const VecX<double> at = found.q.tail(n);
    const VecX<double> beyond = (low - at).cwiseMax(at - high).cwiseMax(0.0);
    const double firm = firmness(tree, constraints, drives, found.q);
    // Beyond a limit, or loosely held, counts as far away.
    const double far =
        largest(at - q.tail(n)) + 100.0 * largest(beyond) + (firm < kFirm ? 10.0 : 0.0);
    if (far < best) {
      best = far;
      out = {found.q, true, found.residual};
    }
    if (k == 0 && far < 10.0) return out;
  }
  return out;
}

}  // namespace diffnea
