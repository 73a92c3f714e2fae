#pragma once
/// Torques of a robot whose constraints close loops, as its leading joints have to give them:
///
///   D(q) τ at the leading joints, 0 elsewhere   (dynamics/driven_torques.hpp)
///
/// Torques of leading joints alone are left as they are: mapping twice is mapping once. Internal to
/// the library.

#include <vector>

#include <diffnea/dynamics/tree_constraints.hpp>

namespace diffnea {

class LoopTorques {
 public:
  /// @param leads  joints, as many as constraints leave motions
  LoopTorques(TreeConstraints<double> constraints, std::vector<int> leads)
      : constraints_(std::move(constraints)), leads_(std::move(leads)) {}

  const TreeConstraints<double>& constraints() const { return constraints_; }
  const std::vector<int>& leads() const { return leads_; }

  /// D, (leads × n), columns of leading joints exactly those of the identity.
  /// @throws DataError where the leading joints do not hold all motions (a dead point)
  MatX<double> map(const Tree<double>& tree, const VecX<double>& q) const;
  /// The same at every posture. @param q  (N, n)
  std::vector<MatX<double>> maps(const Tree<double>& tree, const RowMatX<double>& q) const;
  /// Torques of all joints at the leading ones. @param maps  of every row  @param torque  (N, n)
  RowMatX<double> at_leads(const std::vector<MatX<double>>& maps,
                           const RowMatX<double>& torque) const;

 private:
  TreeConstraints<double> constraints_;
  std::vector<int> leads_;
};

}  // namespace diffnea
