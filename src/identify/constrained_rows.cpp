#include "identify/constrained_rows.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/dynamics/driven_torques.hpp>

#include "core/decompositions.hpp"

namespace diffnea {
namespace {

/// Noise of a coordinate over the largest, at least: weights are no more than its square apart.
constexpr double kLeastNoise = 1e-4;
/// Share of the largest column of Nᵀ from which a coordinate adds a motion.
constexpr double kAddsMotion = 1e-6;

/// Coordinates of `from` whose rows of N are independent, of those and of `taken`, the largest
/// first.
std::vector<int> independent(const MatX<double>& N, const std::vector<int>& from,
                             const std::vector<int>& taken) {
  MatX<double> columns(N.cols(), static_cast<Eigen::Index>(from.size()));
  for (std::size_t i = 0; i < from.size(); ++i)
    columns.col(static_cast<Eigen::Index>(i)) = N.row(from[i]).transpose();
  if (!taken.empty()) {  // remainder beside the taken ones
    const MatX<double> known = N(taken, Eigen::all).transpose();
    const MatX<double> Q = Eigen::HouseholderQR<MatX<double>>(known).householderQ() *
                           MatX<double>::Identity(N.cols(), known.cols());
    columns -= Q * (Q.transpose() * columns);
  }
  std::vector<int> out;
  if (columns.size() == 0) return out;
  const Eigen::ColPivHouseholderQR<MatX<double>> qr(columns);
  const VecX<double> sizes = qr.matrixQR().diagonal().cwiseAbs();
  for (Eigen::Index k = 0; k < sizes.size(); ++k)
    if (sizes[k] > kAddsMotion)
      out.push_back(from[static_cast<std::size_t>(qr.colsPermutation().indices()[k])]);
  return out;
}

}  // namespace

ConstrainedRows::ConstrainedRows(const Model& model, const PreprocessPlan* plan,
                                 std::vector<int> among)
    : constraints_(tree_constraints(model)),
      joints_(joint_names(model)),
      tree_(make_tree(model)),
      among_(std::move(among)) {
  const long n = tree_.num_dofs(), base = tree_.num_velocities() - n;
  weights_ = VecX<double>::Ones(base + n);
  if (plan == nullptr || static_cast<long>(plan->q_noise.size()) < n + (base > 0 ? 7 : 0)) return;
  const Eigen::Map<const VecX<double>> noise(plan->q_noise.data(),
                                             static_cast<long>(plan->q_noise.size()));
  VecX<double> of_velocity(base + n);
  of_velocity.tail(n) = noise.head(n);
  if (base > 0) {  // a turn is twice the quaternion's
    of_velocity.head(3).setConstant(2.0 * noise.segment(n + 3, 4).maxCoeff());
    of_velocity.segment(3, 3).setConstant(noise.segment(n, 3).maxCoeff());
  }
  const double least = kLeastNoise * of_velocity.maxCoeff();
  if (least > 0.0) weights_ = of_velocity.cwiseMax(least).cwiseAbs2().cwiseInverse();
}

void ConstrainedRows::project(const VecX<double>& q, VecX<double>& v, VecX<double>& vd) const {
  const MatX<double> N = constraint_null_space(tree_rows(tree_, constraints_, q, v).J);
  const MatX<double> weighed = N.transpose() * weights_.asDiagonal();
  const MatX<double> G = Eigen::LDLT<MatX<double>>(MatX<double>(weighed * N)).solve(weighed);
  v = N * (G * v);
  const TreeRows<double> at = tree_rows(tree_, constraints_, q, v);
  const VecX<double> still = -at.J.completeOrthogonalDecomposition().solve(at.bias);
  vd = still + N * (G * (vd - still));
}

int ConstrainedRows::coordinate(int row) const {
  const int n = tree_.num_dofs(), base = tree_.num_velocities() - n;
  return row < n ? base + row : row - n;
}

void ConstrainedRows::choose(const Preprocessed& block, const VecX<double>& q) {
  source_ = block.source;
  if (block.rows() == 0) return;
  const int n = tree_.num_dofs(), base = tree_.num_velocities() - n;
  std::vector<int> driven, others;  // indices below n_v
  for (int j = 0; j < n; ++j) {
    if (block.has_tau[static_cast<std::size_t>(j)])
      driven.push_back(base + j);
    else if (std::isnan(block.tau(0, j)))
      throw DataError(source_ + ": the torque of joint '" + joints_[static_cast<std::size_t>(j)] +
                      "' beside constraints is neither recorded nor known to be zero; record it "
                      "(tau_" +
                      joints_[static_cast<std::size_t>(j)] +
                      "), or declare the joint passive (--passive)");
    else
      others.push_back(base + j);
  }
  for (int k = 0; k < base; ++k) (block.has_base_wrench ? driven : others).push_back(k);
  if (!chosen_.empty()) return;
  const VecX<double> still = VecX<double>::Zero(tree_.num_velocities());
  const MatX<double> N = constraint_null_space(tree_rows(tree_, constraints_, q, still).J);
  const auto row_of = [&](int c) { return c < base ? n + c : c - base; };
  const auto allowed = [&](std::vector<int> from) {
    if (!among_.empty())
      std::erase_if(from, [&](int c) { return std::ranges::count(among_, row_of(c)) == 0; });
    return from;
  };
  const std::vector<int> moved = independent(N, allowed(driven), {});
  const std::vector<int> rest = independent(N, allowed(others), moved);
  for (const int c : moved) chosen_.push_back(row_of(c));
  for (const int c : rest) chosen_.push_back(row_of(c));
  mixes_ = moved.size() < driven.size();
  // A drive that is not among them has a share in every other row.
  if (moved.size() == driven.size())
    for (const int c : rest) zero_.push_back(row_of(c));
}

bool ConstrainedRows::has(int row) const {
  return std::ranges::find(chosen_, row) != chosen_.end();
}
bool ConstrainedRows::is_zero(int row) const {
  return std::ranges::find(zero_, row) != zero_.end();
}

/// D with its columns in the order of the rows.
MatX<double> ConstrainedRows::map(const Tree<double>& tree, const VecX<double>& q) const {
  std::vector<int> coordinates;
  for (const int row : chosen_) coordinates.push_back(coordinate(row));
  const VecX<double> still = VecX<double>::Zero(tree.num_velocities());
  const MatX<double> D = driven_map(tree_rows(tree, constraints_, q, still).J, coordinates);
  MatX<double> out(D.rows(), D.cols());
  for (int row = 0; row < D.cols(); ++row) out.col(row) = D.col(coordinate(row));
  return out;
}

void ConstrainedRows::eliminate(const Tree<double>& tree, const VecX<double>& q, double time,
                                Eigen::Ref<RowMatX<double>> rows) const {
  const MatX<double> D = map(tree, q);
  if (D.rows() == 0)
    throw DataError(source_ + ": at " + detail::number_text(time) +
                    " s the loop is at a dead point, where the driven joints do not hold it; "
                    "leave that part of the recording out");
  const RowMatX<double> of_chosen = D * rows;
  rows.setZero();
  for (std::size_t i = 0; i < chosen_.size(); ++i)
    rows.row(chosen_[i]) = of_chosen.row(static_cast<Eigen::Index>(i));
}

VecX<double> ConstrainedRows::unit_acceleration(int row, const VecX<double>& q) const {
  const MatX<double> D = map(tree_, q);
  const auto i = std::ranges::find(chosen_, row) - chosen_.begin();
  VecX<double> out(D.cols());
  for (int r = 0; r < D.cols(); ++r) out[coordinate(r)] = D(i, r);
  return out;
}

}  // namespace diffnea
