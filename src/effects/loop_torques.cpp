#include "effects/loop_torques.hpp"

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/dynamics/driven_torques.hpp>

#include "core/number_text.hpp"

namespace diffnea {

MatX<double> LoopTorques::map(const Tree<double>& tree, const VecX<double>& q) const {
  const VecX<double> still = VecX<double>::Zero(tree.num_velocities());
  MatX<double> D = driven_map(tree_rows(tree, constraints_, q, still).J, leads_);
  if (D.rows() == 0) {
    std::vector<std::string> at;
    for (const double angle : q) at.push_back(detail::number_text(angle, 4));
    throw DataError("torques of a closed loop: at q = (" + detail::join(at) +
                    ") it is at a dead point, where the driven joints do not hold it; leave that "
                    "part of the recording out");
  }
  for (std::size_t i = 0; i < leads_.size(); ++i) {  // rounding is no torque
    D.col(leads_[i]).setZero();
    D(static_cast<Eigen::Index>(i), leads_[i]) = 1.0;
  }
  return D;
}

std::vector<MatX<double>> LoopTorques::maps(const Tree<double>& tree,
                                            const RowMatX<double>& q) const {
  std::vector<MatX<double>> out;
  out.reserve(static_cast<std::size_t>(q.rows()));
  for (Eigen::Index k = 0; k < q.rows(); ++k) out.push_back(map(tree, q.row(k).transpose()));
  return out;
}

RowMatX<double> LoopTorques::at_leads(const std::vector<MatX<double>>& maps,
                                      const RowMatX<double>& torque) const {
  RowMatX<double> out = RowMatX<double>::Zero(torque.rows(), torque.cols());
  for (Eigen::Index k = 0; k < torque.rows(); ++k) {
    const VecX<double> at = maps[static_cast<std::size_t>(k)] * torque.row(k).transpose();
    for (std::size_t i = 0; i < leads_.size(); ++i)
      out(k, leads_[i]) = at[static_cast<Eigen::Index>(i)];
  }
  return out;
}

}  // namespace diffnea
