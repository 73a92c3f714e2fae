/// RNEA, ABA and the mass matrix against MuJoCo on the same random trees.

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/rnea.hpp>

#include "support/matrix_near.hpp"
#include "support/mujoco_tree.hpp"
#include "support/random_arm.hpp"
#include "support/random_floating.hpp"

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

namespace {

/// States of a free base in MuJoCo's terms: quaternions are w x y z, the position leads, and with
/// it all that is linear is the world's, ẍ of the origin among it; what is angular is the base's.
struct FreeState {
  const Mujoco& mujoco;
  Mat3<double> R;
  Vec3<double> w, v;

  FreeState(const Mujoco& in, const VecX<double>& q, const VecX<double>& velocity)
      : mujoco(in),
        R(base_pose(q.data()).R),
        w{velocity[0], velocity[1], velocity[2]},
        v{velocity[3], velocity[4], velocity[5]} {
    mjtNum* qpos = mujoco.data->qpos;
    for (int k = 0; k < 3; ++k) qpos[k] = q[k];
    qpos[3] = q[6];
    for (int k = 0; k < 3; ++k) qpos[4 + k] = q[3 + k];
    mujoco.scatter(q.tail(q.size() - 7), qpos + 7);
    write(w, R * v, velocity, mujoco.data->qvel);
  }
  void write(const Vec3<double>& angular, const Vec3<double>& linear, const VecX<double>& x,
             mjtNum* to) const {
    const Vec3<double> parts[] = {linear, angular};
    for (int k = 0; k < 2; ++k) {
      to[3 * k] = parts[k].x;
      to[3 * k + 1] = parts[k].y;
      to[3 * k + 2] = parts[k].z;
    }
    mujoco.scatter(x.tail(x.size() - 6), to + 6);
  }
  VecX<double> read(const mjtNum* from, const Vec3<double>& less) const {
    VecX<double> out(6 + mujoco.dof.size());
    const Vec3<double> linear = transpose_times(R, Vec3<double>{from[0], from[1], from[2]}) - less;
    out << from[3], from[4], from[5], linear.x, linear.y, linear.z, mujoco.gather(from + 6);
    return out;
  }
  void write_acceleration(const VecX<double>& vd) const {
    write({vd[0], vd[1], vd[2]}, R * (Vec3<double>{vd[3], vd[4], vd[5]} + cross(w, v)), vd,
          mujoco.data->qacc);
  }
  VecX<double> acceleration() const { return read(mujoco.data->qacc, cross(w, v)); }
  void write_force(const VecX<double>& tau) const {
    write({tau[0], tau[1], tau[2]}, R * Vec3<double>{tau[3], tau[4], tau[5]}, tau,
          mujoco.data->qfrc_applied);
  }
  VecX<double> force() const { return read(mujoco.data->qfrc_inverse, {0, 0, 0}); }
};

}  // namespace

TEST_CASE("dynamics: with a free base, rnea, aba and the mass matrix agree with MuJoCo",
          "[dynamics][mujoco]") {
  const unsigned seed = GENERATE(range(0u, 30u));
  CAPTURE(seed);
  const RandomFloating s(seed, {.num_dofs = static_cast<int>(seed % 9)});
  const Mujoco mujoco(s.tree);
  const Tree<double> tree = mujoco.with_compiled_inertia(s.tree);
  mjModel* m = mujoco.model.get();
  mjData* d = mujoco.data.get();
  const FreeState state(mujoco, s.q, s.v);

  state.write_acceleration(s.vd);
  mj_inverse(m, d);
  RneaWorkspace<double, double> rnea_ws;
  CHECK_THAT(rnea(tree, s.q, s.v, s.vd, rnea_ws), MatrixNear(state.force(), kTorqueTol));

  state.write_force(s.tau);
  mj_forward(m, d);
  AbaWorkspace<double, double> aba_ws;
  CHECK_THAT(aba(tree, s.q, s.v, s.tau, aba_ws),
             MatrixNear(state.acceleration(), kAccelerationTol));

  // M, by what the inverse dynamics add for each unit acceleration.
  MassMatrixWorkspace<double, double> mass_ws;
  const MatX<double> M = mass_matrix(tree, s.q, mass_ws);
  const FreeState at_rest(mujoco, s.q, 0.0 * s.v);
  at_rest.write_acceleration(0.0 * s.vd);
  mj_inverse(m, d);
  const VecX<double> weight = at_rest.force();
  for (int k = 0; k < tree.num_velocities(); ++k) {
    at_rest.write_acceleration(VecX<double>::Unit(tree.num_velocities(), k));
    mj_inverse(m, d);
    CHECK_THAT(M.col(k), MatrixNear(at_rest.force() - weight, kTorqueTol));
  }
}

}  // namespace dynamics_mujoco_test
