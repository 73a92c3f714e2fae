#pragma once
/// How a base that floats moves while its joints do: thrown without turning, it keeps the momentum
/// of rest. No weight acts in free fall, and where the base is does not matter. Internal to
/// excite/.

#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/rnea.hpp>

namespace diffnea {

class Recoil {
 public:
  /// @param tree  on a free base; its gravity does not act
  explicit Recoil(Tree<double> tree);

  /// The whole robot where its joints are at (q, q̇, q̈), (n) [rad, m]: M v = 0 and M v̇ + h = 0 in
  /// the six rows of the base.
  void at(const double* q, const double* qd, const double* qdd);

  VecX<double> q;         ///< (7 + n), the base upright at the origin
  VecX<double> v, vd;     ///< (6 + n), the base's twist first, and their derivative
  VecX<double> reaction;  ///< (6) wrench that would hold the base against the joints [N·m, N]

 private:
  Tree<double> tree_;
  MassMatrixWorkspace<double, double> mass_;
  RneaWorkspace<double, double> ws_;
};

}  // namespace diffnea
