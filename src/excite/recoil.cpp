#include "excite/recoil.hpp"

#include <utility>

#include "core/decompositions.hpp"

namespace diffnea {

Recoil::Recoil(Tree<double> tree) : tree_(std::move(tree)) {
  tree_.gravity = {0.0, 0.0, 0.0};
  q = VecX<double>::Unit(tree_.num_positions(), kBasePositions - 1);
  v = vd = VecX<double>::Zero(tree_.num_velocities());
}

void Recoil::at(const double* joints, const double* velocities, const double* accelerations) {
  const long n = tree_.num_dofs();
  using Map = Eigen::Map<const VecX<double>>;
  q.tail(n) = Map(joints, n);
  v.tail(n) = Map(velocities, n);
  vd << VecX<double>::Zero(kBaseVelocities), Map(accelerations, n);
  const MatX<double> rows = mass_matrix(tree_, VecIn<double>(q), mass_).topRows<kBaseVelocities>();
  const Eigen::LLT<MatX<double>> base(rows.leftCols<kBaseVelocities>());
  v.head<kBaseVelocities>() = -base.solve(rows.rightCols(n) * v.tail(n));
  reaction = rnea(tree_, VecIn<double>(q), VecIn<double>(v), VecIn<double>(vd), ws_)
                 .head<kBaseVelocities>();
  vd.head<kBaseVelocities>() = -base.solve(reaction);
}

}  // namespace diffnea
