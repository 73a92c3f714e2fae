#include "excite/recoil.hpp"

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>

#include <diffnea/dynamics/aba.hpp>

#include "support/matrix_near.hpp"
#include "support/random_floating.hpp"

namespace recoil_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// Sums of a dozen products of order 10², after a solve with M, whose condition reaches 10⁴.
constexpr double kSolveTol = 1e-8;
/// Central difference, h = 1e-6, of twists of order 10.
constexpr double kStep = 1e-6;
constexpr double kCentralDifferenceTol = 1e-6;

}  // namespace

TEST_CASE("recoil: forward dynamics without a wrench accelerates base and joints so", "[excite]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  const RandomFloating robot(seed);
  const int n = robot.tree.num_dofs();
  Recoil recoil(robot.tree);
  const VecX<double> q = robot.q.tail(n), qd = robot.v.tail(n), qdd = robot.vd.tail(n);
  recoil.at(q.data(), qd.data(), qdd.data());
  Tree<double> falling = robot.tree;  // and falls as its base does
  falling.gravity = {0, 0, 0};
  RneaWorkspace<double, double> ws;
  VecX<double> tau =
      rnea(falling, VecIn<double>(recoil.q), VecIn<double>(recoil.v), VecIn<double>(recoil.vd), ws);
  CHECK(tau.head<6>().cwiseAbs().maxCoeff() < kSolveTol);
  tau.head<6>().setZero();
  AbaWorkspace<double, double> forward;
  const VecX<double> vd =
      aba(falling, VecIn<double>(recoil.q), VecIn<double>(recoil.v), VecIn<double>(tau), forward);
  CHECK_THAT(vd, MatrixNear(recoil.vd, kSolveTol * recoil.vd.cwiseAbs().maxCoeff()));
}

TEST_CASE("recoil: the acceleration is the twist's change along the joints' motion", "[excite]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  const RandomFloating robot(seed);
  const int n = robot.tree.num_dofs();
  Recoil recoil(robot.tree);
  const VecX<double> q = robot.q.tail(n), qd = robot.v.tail(n), qdd = robot.vd.tail(n);
  const auto twist = [&](double t) {
    const VecX<double> at = q + t * qd + 0.5 * t * t * qdd, speed = qd + t * qdd;
    recoil.at(at.data(), speed.data(), qdd.data());
    return VecX<double>(recoil.v.head<6>());
  };
  const VecX<double> change = (twist(kStep) - twist(-kStep)) / (2 * kStep);
  recoil.at(q.data(), qd.data(), qdd.data());
  CHECK_THAT(change, MatrixNear(recoil.vd.head<6>(),
                                kCentralDifferenceTol * recoil.vd.cwiseAbs().maxCoeff()));
}

}  // namespace recoil_test
