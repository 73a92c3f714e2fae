#pragma once
/// Torque rows of a robot whose constraints close loops: those of the driven joints, with the
/// constraints' forces eliminated (dynamics/driven_torques.hpp). Effects at passive joints count.

#include <string>
#include <vector>

#include <diffnea/dynamics/tree_constraints.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

/// Maps of one model's states.
class LoopRows {
 public:
  explicit LoopRows(const Model& model);

  /// Takes the joints with a recorded torque as those that are driven.
  /// @throws DataError if they are not as many as the motions that the constraints leave, or the
  ///         torque of another joint is not known to be zero
  void choose(const Preprocessed& block);

  /// Rows of the tree's joints become those of the driven ones, D rows; all others 0.
  /// @param tree  of the same links as the model
  /// @param rows  (n × columns)
  /// @throws DataError naming the time, at a dead point
  void eliminate(const Tree<double>& tree, const VecX<double>& q, double time,
                 Eigen::Ref<RowMatX<double>> rows) const;

 private:
  TreeConstraints<double> constraints_;
  std::vector<std::string> joints_;
  Tree<double> tree_;  ///< the model's, to count motions
  std::vector<int> driven_;
  VecX<double> still_;
  std::string source_;
};

}  // namespace diffnea
