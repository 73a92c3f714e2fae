#include "identify/loop_rows.hpp"

#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/dynamics/driven_torques.hpp>

namespace diffnea {

LoopRows::LoopRows(const Model& model)
    : constraints_(tree_constraints(model)),
      joints_(joint_names(model)),
      tree_(make_tree(model)),
      still_(VecX<double>::Zero(tree_.num_velocities())) {}

void LoopRows::choose(const Preprocessed& block) {
  source_ = block.source;
  driven_.clear();
  if (block.rows() == 0) return;
  std::vector<std::string> driven;
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    if (block.has_tau[j]) {
      driven_.push_back(static_cast<int>(j));
      driven.push_back(joints_[j]);
    } else if (std::isnan(block.tau(0, static_cast<Eigen::Index>(j)))) {
      throw DataError(source_ + ": the torque of joint '" + joints_[j] +
                      "' in a closed loop is neither recorded nor known to be zero; record it "
                      "(tau_" +
                      joints_[j] + "), or declare the joint passive (--passive)");
    }
  }
  const VecX<double> q = block.q.row(0).transpose();
  const auto left = constraint_null_space(tree_rows(tree_, constraints_, q, still_).J).cols();
  if (left != static_cast<Eigen::Index>(driven_.size()))
    throw DataError(source_ + ": constraints leave " + std::to_string(left) +
                    " degrees of freedom, and torques of " + std::to_string(driven_.size()) +
                    " joints are recorded (" + detail::join_or_none(driven) +
                    "), expected as many; record all drives, or declare joints without one "
                    "passive (--passive)");
}

void LoopRows::eliminate(const Tree<double>& tree, const VecX<double>& q, double time,
                         Eigen::Ref<RowMatX<double>> rows) const {
  const MatX<double> D = driven_map(tree_rows(tree, constraints_, q, still_).J, driven_);
  if (D.rows() == 0)
    throw DataError(source_ + ": at " + detail::number_text(time) +
                    " s the loop is at a dead point, where the driven joints do not hold it; "
                    "leave that part of the recording out");
  const RowMatX<double> of_driven = D * rows;
  rows.setZero();
  for (std::size_t i = 0; i < driven_.size(); ++i)
    rows.row(driven_[i]) = of_driven.row(static_cast<Eigen::Index>(i));
}

}  // namespace diffnea
