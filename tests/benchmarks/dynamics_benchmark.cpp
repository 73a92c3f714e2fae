#include <catch2/benchmark/catch_benchmark.hpp>
#include <catch2/catch_test_macros.hpp>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/rnea.hpp>

#include "support/random_arm.hpp"

namespace diffnea {

TEST_CASE("dynamics of a random arm of 7 joints", "[benchmark]") {
  const test::RandomArm arm(/*seed=*/0, {.num_dofs = 7});
  RneaWorkspace<double, double> rnea_ws;
  AbaWorkspace<double, double> aba_ws;
  const VecX<double> tau = rnea(arm.tree, arm.q, arm.qd, arm.qdd, rnea_ws);

  // The last joint's value depends on every link; returning it keeps the call from being optimised
  // away.
  BENCHMARK("rnea") { return rnea(arm.tree, arm.q, arm.qd, arm.qdd, rnea_ws)[6]; };
  BENCHMARK("aba") { return aba(arm.tree, arm.q, arm.qd, tau, aba_ws)[6]; };
}

}  // namespace diffnea
