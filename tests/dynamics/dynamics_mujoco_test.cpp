/// RNEA, ABA and the mass matrix against MuJoCo on the same random trees.

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/rnea.hpp>

#include "support/matrix_near.hpp"
#include "support/mujoco_tree.hpp"
#include "support/random_arm.hpp"

namespace dynamics_mujoco_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// Torques of order 10²; the MJCF holds 17 digits, so only rounding remains: 1e-12 observed, 10² of
/// margin.
constexpr double kTorqueTol = 1e-10;
/// Accelerations after a solve with a mass matrix of condition 10³ or more, entries to 10³.
constexpr double kAccelerationTol = 1e-8;

}  // namespace

TEST_CASE("dynamics: rnea, aba and the mass matrix agree with MuJoCo", "[dynamics][mujoco]") {
  const unsigned seed = GENERATE(range(0u, 30u));
  CAPTURE(seed);
  const RandomArm arm(seed, {.num_dofs = 1 + static_cast<int>(seed % 9)});
  const Mujoco mujoco(arm.tree);
  const Tree<double> tree = mujoco.with_compiled_inertia(arm.tree);
  mjModel* m = mujoco.model.get();
  mjData* d = mujoco.data.get();
  mujoco.scatter(arm.q, d->qpos);
  mujoco.scatter(arm.qd, d->qvel);

  mujoco.scatter(arm.qdd, d->qacc);
  mj_inverse(m, d);
  RneaWorkspace<double, double> rnea_ws;
  CHECK_THAT(rnea(tree, arm.q, arm.qd, arm.qdd, rnea_ws),
             MatrixNear(mujoco.gather(d->qfrc_inverse), kTorqueTol));

  mujoco.scatter(arm.tau, d->qfrc_applied);
  mj_forward(m, d);
  AbaWorkspace<double, double> aba_ws;
  const VecX<double> qdd = aba(tree, arm.q, arm.qd, arm.tau, aba_ws);
  CHECK_THAT(qdd, MatrixNear(mujoco.gather(d->qacc), kAccelerationTol));

  RowMatX<double> M(tree.num_dofs(), tree.num_dofs());
  mj_fullM(m, M.data(), d->qM);
  MassMatrixWorkspace<double, double> mass_ws;
  const MatX<double> ours = mass_matrix(tree, arm.q, mass_ws);
  for (int i = 0; i < tree.num_dofs(); ++i)
    for (int j = 0; j < tree.num_dofs(); ++j)
      CHECK(std::abs(ours(i, j) - M(mujoco.dof[i], mujoco.dof[j])) < kTorqueTol);
}

}  // namespace dynamics_mujoco_test
