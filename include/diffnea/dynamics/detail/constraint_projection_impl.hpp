#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/QR>
#include <Eigen/SVD>

#include <diffnea/dynamics/constraint_projection.hpp>

namespace diffnea::detail {

/// The shortest x with J x = b by coordinates that are not held.
inline VecX<double> shortest(const MatX<double>& J, const VecX<double>& b,
                             const std::vector<int>& held) {
  MatX<double> free = J;
  for (const int c : held) {
    if (c < 0 || c >= J.cols())
      throw ShapeError("constraint projection: coordinate " + std::to_string(c) +
                       " is held, expected 0 to " + std::to_string(J.cols() - 1));
    free.col(c).setZero();
  }
  if (J.size() == 0) return VecX<double>::Zero(J.cols());
  Eigen::CompleteOrthogonalDecomposition<MatX<double>> solver;
  solver.setThreshold(kRankTol);
  return solver.compute(free).solve(b);
}

/// g of the rows that constrain positions; 0 of the others.
inline VecX<double> position_errors(const TreeRows<double>& at) {
  VecX<double> g = VecX<double>::Zero(at.J.rows());
  for (Eigen::Index i = 0; i < g.size(); ++i) {
    const ConstraintRow<double>& row = at.rows[static_cast<std::size_t>(i)];
    if (row.of_velocity || (row.relation == Relation::kAtMost && row.g < 0.0)) continue;
    g[i] = row.g;
  }
  return g;
}

/// J without the rows that `skip` says.
template <class Skip>
MatX<double> rows_but(const TreeRows<double>& at, const Skip& skip) {
  MatX<double> J = at.J;
  for (Eigen::Index i = 0; i < J.rows(); ++i)
    if (skip(at.rows[static_cast<std::size_t>(i)])) J.row(i).setZero();
  return J;
}

inline bool is_slack(const ConstraintRow<double>& row) {
  return row.relation == Relation::kAtMost && row.g < -kTouching;
}

inline double largest_entry(const VecX<double>& v) {
  return v.size() > 0 ? v.cwiseAbs().maxCoeff() : 0.0;
}

}  // namespace diffnea::detail

namespace diffnea {

template <class Constraints>
ProjectedPositions project_positions(const Tree<double>& tree, const Constraints& constraints,
                                     VecIn<double> q, const ProjectionOptions& options) {
  const VecX<double> still = VecX<double>::Zero(tree.num_velocities());
  ProjectedPositions out{q};
  TreeRows<double> at = tree_rows(tree, constraints, out.q, still);
  VecX<double> g = detail::position_errors(at);
  const auto closed = [&] { return detail::largest_entry(g) <= options.tolerance; };
  for (; !closed() && out.steps < options.most_steps; ++out.steps) {
    const MatX<double> J = detail::rows_but(at, [](const ConstraintRow<double>& row) {
      return row.of_velocity || (row.relation == Relation::kAtMost && row.g < 0.0);
    });
    VecX<double> step = detail::shortest(J, -g, options.held);
    bool better = false;
    for (int halvings = 0; halvings < 30 && !better; ++halvings, step *= 0.5) {
      const VecX<double> next = integrate<double, double>(tree, out.q, step);
      TreeRows<double> there = tree_rows(tree, constraints, next, still);
      const VecX<double> error = detail::position_errors(there);
      better = error.squaredNorm() < g.squaredNorm();
      if (!better) continue;
      out.q = next;
      at = std::move(there);
      g = error;
    }
    if (!better) break;
  }
  out.residual = detail::largest_entry(g);
  out.converged = closed();
  return out;
}

template <class Constraints>
VecX<double> project_velocities(const Tree<double>& tree, const Constraints& constraints,
                                VecIn<double> q, VecIn<double> v, const std::vector<int>& held) {
  const TreeRows<double> at = tree_rows(tree, constraints, q, v);
  const MatX<double> J = detail::rows_but(at, detail::is_slack);
  VecX<double> wrong(J.rows());
  for (Eigen::Index i = 0; i < wrong.size(); ++i) {
    const ConstraintRow<double>& row = at.rows[static_cast<std::size_t>(i)];
    wrong[i] = detail::is_slack(row) ? 0.0 : row.of_velocity ? row.g : row.gd;
  }
  return v + detail::shortest(J, -wrong, held);
}

template <class Constraints>
VecX<double> project_accelerations(const Tree<double>& tree, const Constraints& constraints,
                                   VecIn<double> q, VecIn<double> v, VecIn<double> vd,
                                   const std::vector<int>& held) {
  require_velocities("project_accelerations: vd", tree, vd);
  const TreeRows<double> at = tree_rows(tree, constraints, q, v);
  const MatX<double> J = detail::rows_but(at, detail::is_slack);
  VecX<double> wrong = J * vd + at.bias;
  for (Eigen::Index i = 0; i < wrong.size(); ++i)
    if (detail::is_slack(at.rows[static_cast<std::size_t>(i)])) wrong[i] = 0.0;
  return vd + detail::shortest(J, -wrong, held);
}

inline MatX<double> constraint_null_space(const MatX<double>& J) {
  const Eigen::Index n = J.cols();
  if (J.size() == 0) return MatX<double>::Identity(n, n);
  Eigen::JacobiSVD<MatX<double>> svd(J, Eigen::ComputeFullV);
  svd.setThreshold(kRankTol);
  return svd.matrixV().rightCols(n - svd.rank());
}

}  // namespace diffnea
