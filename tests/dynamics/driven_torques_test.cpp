/// Inverse dynamics of closed loops: against the same bodies in maximal coordinates, and parameters
/// recovered from torques of the driven joints.

#include <cmath>

#include <Eigen/Dense>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/dynamics/driven_torques.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/model/model.hpp>

#include "support/matrix_near.hpp"
#include "support/planar_loop.hpp"

namespace driven_torques_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using test::MatrixNear;
using test::PlanarLoop;

namespace {

/// Two algorithms, torques of order 10 behind a map of order 10.
constexpr double kIdentityTol = 1e-8;

std::vector<int> driven_joints(int bars) {
  return bars == 3 ? std::vector<int>{0} : std::vector<int>{0, 1};
}

/// Drives the loop's first joints with random torques, the passive ones with none.
void drive(PlanarLoop& loop, Rng& rng) {
  loop.tau.setZero();
  for (const int k : driven_joints(static_cast<int>(loop.q.size()))) loop.tau[k] = 5 * rng.normal();
}

/// Accelerations of the joints as the free bodies have them: differences about the axis.
VecX<double> joint_accelerations(const PlanarLoop& loop) {
  const ConstrainedAcceleration<double> found = test::in_maximal_coordinates(loop);
  VecX<double> out(loop.q.size());
  double before = 0.0;
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    const double turn = found.Vd[static_cast<std::size_t>(i)].angular.y;
    out[i] = turn - before;
    before = turn;
  }
  return out;
}

MatX<double> map_of(const PlanarLoop& loop, const std::vector<int>& driven) {
  return driven_map(tree_rows(loop.tree, loop, loop.q, loop.qd).J, driven);
}

/// The loop in another state, closed, that is reached through the driven joints; they stop before a
/// dead point or the end of their reach.
void move(PlanarLoop& loop, Rng& rng) {
  const int bars = static_cast<int>(loop.q.size());
  VecX<double> rate = VecX<double>::Zero(bars);
  for (const int k : driven_joints(bars)) rate[k] = rng.normal();
  rate = project_velocities(loop.tree, loop, loop.q, rate, driven_joints(bars));
  for (int step = 0; step < 10; ++step) {
    PlanarLoop next = loop;
    const ProjectedPositions found =
        project_positions(loop.tree, loop, loop.q + 0.03 * rate, {.held = driven_joints(bars)});
    next.q = found.q;
    if (!found.converged) break;
    const MatX<double> D = map_of(next, driven_joints(bars));
    if (D.rows() == 0 || D.cwiseAbs().maxCoeff() > 10.0) break;
    loop.q = found.q;
  }
  loop.qd = project_velocities(loop.tree, loop, loop.q, 3.0 * test::random_vector(rng, bars));
}

}  // namespace

TEST_CASE("driven torques: they are those that moved the bodies in maximal coordinates",
          "[constraints][loops]") {
  const int bars = GENERATE(3, 4);
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(bars, seed);
  PlanarLoop loop(seed, bars);
  Rng rng(seed + 7);
  drive(loop, rng);
  const VecX<double> qdd = joint_accelerations(loop);
  const std::vector<int> driven = driven_joints(bars);
  const MatX<double> D = map_of(loop, driven);
  REQUIRE(D.rows() == static_cast<Eigen::Index>(driven.size()));
  RneaWorkspace<double, double> ws;
  const VecX<double> tree = rnea<double, double>(loop.tree, loop.q, loop.qd, qdd, ws);
  CHECK_THAT(D * tree, MatrixNear(loop.tau.head(D.rows()), kIdentityTol));
  // The open tree would need something else.
  CHECK((tree.head(D.rows()) - loop.tau.head(D.rows())).norm() > 1e-2);
}

TEST_CASE("driven torques: with more drives than motions they are the shortest",
          "[constraints][loops]") {
  const PlanarLoop loop(3, 3);
  const MatX<double> one = map_of(loop, {0}), all = map_of(loop, {0, 1, 2});
  REQUIRE(all.rows() == 3);
  Rng rng(1);
  const VecX<double> tree = test::random_vector(rng, 3);
  const MatX<double> N = constraint_null_space(tree_rows(loop.tree, loop, loop.q, loop.qd).J);
  CHECK_THAT(N.transpose() * (all * tree), MatrixNear(N.transpose() * tree, 1e-12));
  CHECK((all * tree).norm() <= (one * tree).norm());
}

TEST_CASE("driven torques: a dead point and too few drives are told", "[constraints][loops]") {
  PlanarLoop loop(1, 3);
  // Crank and ground in line: the angle between coupler and rocker is at its extreme.
  for (int k = 1; k <= 20; ++k) {
    VecX<double> next = loop.q;
    next[0] = -1.1 * (1.0 - k / 20.0);
    loop.q = project_positions(loop.tree, loop, next, {.held = {0}}).q;
  }
  CHECK(map_of(loop, {0}).rows() == 1);
  CHECK(map_of(loop, {2}).rows() == 0);
  CHECK(map_of(PlanarLoop(1, 4), {0}).rows() == 0);
  CHECK(map_of(loop, {}).rows() == 0);
  CHECK_THROWS_WITH(map_of(loop, {3}), ContainsSubstring("coordinate 3 is driven"));
}

TEST_CASE("driven torques: base parameters of a loop lie in their intervals",
          "[constraints][loops]") {
  // Torques of the driven joints with noise, positions logged; accelerations are those of the free
  // bodies. The regressor's row space is what the loop can tell: base parameters.
  const int bars = GENERATE(3, 4);
  CAPTURE(bars);
  constexpr int kSeeds = 20, kStates = 60;
  constexpr double kNoise = 0.05;  // [N·m]
  int inside = 0, of = 0;
  Eigen::Index rank = -1;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    PlanarLoop loop(11, bars);  // one robot, other states and noise
    Rng rng(seed + 100);
    const std::vector<int> driven = driven_joints(bars);
    const auto rows = static_cast<Eigen::Index>(driven.size());
    MatX<double> A(kStates * rows, 10 * bars);
    VecX<double> b(kStates * rows);
    const PlanarLoop start = loop;
    for (int k = 0; k < kStates; ++k) {
      loop = start;
      move(loop, rng);
      drive(loop, rng);
      const VecX<double> qdd = joint_accelerations(loop);
      const MatX<double> D = map_of(loop, driven);
      REQUIRE(D.rows() == rows);
      RegressorWorkspace<double, double> ws;
      const RowMatX<double>& Y =
          torque_regressor<double, double>(loop.tree, loop.q, loop.qd, qdd, ws);
      A.middleRows(k * rows, rows) = D * Y;
      for (Eigen::Index i = 0; i < rows; ++i)
        b[k * rows + i] = loop.tau[driven[static_cast<std::size_t>(i)]] + kNoise * rng.normal();
    }
    Eigen::JacobiSVD<MatX<double>> svd(A, Eigen::ComputeThinU | Eigen::ComputeThinV);
    svd.setThreshold(1e-8);
    if (rank < 0) rank = svd.rank();
    CHECK(svd.rank() == rank);
    const VecX<double> truth =
        svd.matrixV().leftCols(rank).transpose() * inertial_parameters(loop.tree);
    const VecX<double> found = (svd.matrixU().leftCols(rank).transpose() * b)
                                   .cwiseQuotient(svd.singularValues().head(rank));
    for (Eigen::Index i = 0; i < rank; ++i, ++of)
      inside += std::abs(found[i] - truth[i]) <= 1.96 * kNoise / svd.singularValues()[i];
  }
  // The plane's three moments and masses of each bar, less what only the loop's closing shares.
  CHECK(rank >= 2 * bars);
  CHECK(rank < 4 * bars);
  const double share = static_cast<double>(inside) / of;
  CAPTURE(rank, inside, of);
  CHECK(share >= 0.90);
  CHECK(share <= 0.98);
}

}  // namespace driven_torques_test
