#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include <diffnea/dynamics/constrained_tree.hpp>

namespace diffnea::detail {

/// Largest |J_ij| / |covector at the joint| that is rounding alone: no joint moves along such a
/// row. A planar loop's rows across its plane are of that kind.
inline constexpr double kNoLever = 1e-13;

template <class T>
double magnitude(const Wrench<T>& W) {
  double sum = 0.0;
  for (const Vec3<T>* v : {&W.torque, &W.force})
    sum += std::abs(value(v->x)) + std::abs(value(v->y)) + std::abs(value(v->z));
  return sum;
}

/// Adds Jᵀ e of a covector on a link, in that link, to the coordinates that move it.
/// @param scale  gains the largest magnitude of the covector at the joints between link and world
template <class P, class T>
void add_coordinates(const Tree<P>& tree, const std::vector<BodyState<T>>& links, int link,
                     const Wrench<T>& W_L, Eigen::Ref<VecX<T>> row, double& scale) {
  const int first = tree.first_joint(), lead = tree.free_base ? kBaseVelocities : 0;
  const Pose<T>& X_WL = links[static_cast<std::size_t>(link)].X_WB;
  for (int i = link; i >= 0; i = tree.links[static_cast<std::size_t>(i)].parent) {
    const Wrench<T> W =
        i == link ? W_L : to_parent(inverse(links[static_cast<std::size_t>(i)].X_WB) * X_WL, W_L);
    scale = std::max(scale, magnitude(W));
    if (i < first) {  // a free base
      Wrench<T> parts = W;
      for (int k = 0; k < kBaseVelocities; ++k) row[k] = row[k] + component(parts, k);
      continue;
    }
    const JointDrive drive = tree.drive(i);
    T& entry = row[lead + drive.dof];
    entry = entry + dot(joint_twist(tree.links[static_cast<std::size_t>(i)]), W) * T(drive.ratio);
  }
}

}  // namespace diffnea::detail

namespace diffnea {

template <Scalar P, Scalar T, class Constraints>
void tree_rows(const Tree<P>& tree, const Constraints& constraints,
               const LinkKinematics<T>& kinematics, std::vector<BodyState<T>>& links,
               TreeRows<T>& out) {
  links.resize(kinematics.links.size());
  for (std::size_t i = 0; i < links.size(); ++i)
    links[i] = {kinematics.links[i].X_WL, kinematics.links[i].V};
  out.rows.clear();
  constraints(std::as_const(links), out.rows);
  detail::check_rows(out.rows, links.size());
  const auto m = static_cast<Eigen::Index>(out.rows.size());
  const Eigen::Index n = tree.num_velocities();
  MatX<T> transposed = MatX<T>::Constant(n, m, T(0.0));
  out.bias.resize(m);
  for (Eigen::Index r = 0; r < m; ++r) {
    const ConstraintRow<T>& row = out.rows[static_cast<std::size_t>(r)];
    out.bias[r] = row.bias;
    double scale = 0.0, largest = 0.0;
    for (std::size_t s = 0; s < kMostBodies; ++s) {
      const int link = row.bodies[s];
      if (link == kWorld) continue;
      detail::add_coordinates<P, T>(tree, links, link, row.J[s], transposed.col(r), scale);
      out.bias[r] = out.bias[r] + dot(kinematics.links[static_cast<std::size_t>(link)].A, row.J[s]);
    }
    for (Eigen::Index c = 0; c < n; ++c)
      largest = std::max(largest, std::abs(value(transposed(c, r))));
    if (largest <= detail::kNoLever * scale) transposed.col(r).setConstant(T(0.0));
  }
  out.J = transposed.transpose();
}

template <class Constraints>
TreeRows<double> tree_rows(const Tree<double>& tree, const Constraints& constraints,
                           VecIn<double> q, VecIn<double> v) {
  LinkKinematics<double> kinematics;
  const VecX<double> zero = VecX<double>::Zero(tree.num_velocities());
  forward_kinematics<double, double>(tree, q, v, zero, kinematics);
  std::vector<BodyState<double>> links;
  TreeRows<double> out;
  tree_rows(tree, constraints, kinematics, links, out);
  return out;
}

template <Scalar P, Scalar S, class Constraints>
const VecX<Prod<P, S>>& constrained_forward_dynamics(const Tree<P>& tree,
                                                     const Constraints& constraints, VecIn<S> q,
                                                     VecIn<S> v, VecIn<S> tau,
                                                     const Stabilisation& stabilisation,
                                                     ConstrainedTreeWorkspace<P, S>& ws) {
  using R = Prod<P, S>;
  require_velocities("constrained_forward_dynamics: tau", tree, tau);
  const Eigen::Index n = tree.num_velocities();
  const VecX<S> zero = VecX<S>::Constant(n, S(0.0));
  rnea<P, S>(tree, q, v, zero, ws.rnea);
  forward_kinematics<P, S>(tree, ws.rnea, ws.kinematics);
  tree_rows(tree, constraints, ws.kinematics, ws.links, ws.constraints);
  const MatX<R>& J = ws.constraints.J;
  const std::vector<ConstraintRow<R>>& rows = ws.constraints.rows;
  const Eigen::Index m = J.rows();

  const Eigen::LLT<MatX<R>> M(mass_matrix<P, S>(tree, q, ws.mass));
  if (M.info() != Eigen::Success)
    throw ModelError(
        "constrained_forward_dynamics: the mass matrix is singular: something that moves has no "
        "inertia; expected masses and inertias, or rotor inertia, on every joint");
  ws.qdd.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) ws.qdd[i] = R(0.0) + tau[i] - ws.rnea.tau[i];
  M.solveInPlace(ws.qdd);
  const MatX<R> mobility = M.solve(MatX<R>(J.transpose()));  // M⁻¹Jᵀ

  VecX<R> demand(m);
  std::vector<int> candidates;
  for (Eigen::Index i = 0; i < m; ++i) {
    const ConstraintRow<R>& row = rows[static_cast<std::size_t>(i)];
    const std::optional<R> target = detail::target_of(row, stabilisation);
    if (!target) continue;
    demand[i] = ws.constraints.bias[i] - *target;
    for (Eigen::Index c = 0; c < n; ++c) demand[i] = demand[i] + J(i, c) * ws.qdd[c];
    candidates.push_back(static_cast<int>(i));
  }
  ws.multiplier = VecX<R>::Constant(m, R(0.0));
  if (!candidates.empty()) {
    const MatX<R> A = J * mobility;
    const std::vector<R> lambda = detail::solve_complementary(A, demand, rows, candidates);
    for (Eigen::Index i = 0; i < m; ++i) ws.multiplier[i] = lambda[static_cast<std::size_t>(i)];
  }
  ws.force = -(J.transpose() * ws.multiplier);
  ws.qdd -= mobility * ws.multiplier;
  return ws.qdd;
}

}  // namespace diffnea
