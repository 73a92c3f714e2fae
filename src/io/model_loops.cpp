#include "io/model_loops.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include <diffnea/dynamics/tree_constraints.hpp>
#include <diffnea/model/lock.hpp>

#include "dynamics/closed_posture.hpp"

namespace diffnea::io {
namespace {

VecX<double> reference_positions(const Model& model, const Tree<double>& tree) {
  VecX<double> q(tree.num_positions());
  if (model.free_base) {
    const Pose<double>& X = model.links[0].X_PJ;
    const Eigen::Quaterniond turn(to_eigen(X.R));
    q.head<3>() = to_eigen(X.p);
    q.segment<4>(3) = turn.coeffs();
  }
  const std::vector<std::string> joints = joint_names(model);
  const Eigen::Index first = q.size() - static_cast<Eigen::Index>(joints.size());
  for (std::size_t i = 0; i < joints.size(); ++i)
    q[first + static_cast<Eigen::Index>(i)] = resting_position(model, joints[i]);
  return q;
}

double length(const Vec3<double>& v) { return std::sqrt(dot(v, v)); }

ConstraintGap gap_of(const ConstraintSpec& c, const Pose<double>& J, const Pose<double>& K) {
  switch (c.kind) {
    case ConstraintKind::kConnect:
      return {length(K.p - J.p)};
    case ConstraintKind::kWeld:
      return {length(K.p - J.p), length(log(Mat3<double>(transpose(J.R) * K.R)))};
    case ConstraintKind::kHinge:
      return {length(K.p - J.p),
              std::atan2(length(cross(J.R.col[2], K.R.col[2])), dot(J.R.col[2], K.R.col[2]))};
    case ConstraintKind::kRolling: {
      const double across = std::hypot(K.R.col[2].x, K.R.col[2].y);
      return {std::abs(K.p.z - c.radius * across)};
    }
  }
  return {};
}

}  // namespace

LoopReport report_loops(const Model& model) {
  const Tree<double> tree = make_tree(model);
  const TreeConstraints<double> constraints = tree_constraints(model);
  const TreeMap map = map_to_tree(model);
  const VecX<double> q = reference_positions(model, tree);
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(tree, q, kinematics);
  const auto in_world = [&](const ConstraintEnd& end) {
    const auto [link, X_LF] = place_in_tree(map, end.link);
    return frame_pose(kinematics, link, X_LF * end.X_LF);
  };
  LoopReport out;
  for (const ConstraintSpec& c : model.constraints)
    out.gaps.push_back(gap_of(c, in_world(c.first), in_world(c.second)));
  const ClosedPosture closed = closed_posture(model, tree, constraints, q);
  out.closes = closed.closes;
  out.remains = closed.residual;
  for (const double x : difference<double, double>(tree, q, closed.q))
    out.farthest = std::max(out.farthest, std::abs(x));
  const VecX<double> still = VecX<double>::Zero(tree.num_velocities());
  out.coordinates = tree.num_velocities();
  out.left = static_cast<int>(
      constraint_null_space(tree_rows(tree, constraints, closed.q, still).J).cols());
  return out;
}

}  // namespace diffnea::io
