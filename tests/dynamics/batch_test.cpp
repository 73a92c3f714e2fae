#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/dynamics/rnea.hpp>

#include "support/matrix_near.hpp"
#include "support/random_floating.hpp"
#include "support/random_followers.hpp"

namespace batch_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// The same operations, but for fused multiply-add and a vectorised sine of 1 ulp: 1e-14 of the
/// largest value observed, 10² of margin.
constexpr double kRelativeTol = 1e-12;

RowMatX<double> random_rows(Rng& rng, int rows, int n, double scale) {
  RowMatX<double> out(rows, n);
  for (int k = 0; k < rows; ++k) out.row(k) = random_vector(rng, n, scale);
  return out;
}

double scaled_tolerance(const RowMatX<double>& truth) {
  return kRelativeTol * (1.0 + (truth.size() > 0 ? truth.cwiseAbs().maxCoeff() : 0.0));
}

}  // namespace

TEST_CASE("batch: every instruction set and number of rows gives the scalar results",
          "[dynamics][threads]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  const int rows = GENERATE(0, 1, 3, 8, 21, 300);
  CAPTURE(seed, rows);
  const RandomArm arm(seed, {.num_dofs = 1 + static_cast<int>(seed)});
  const int n = arm.tree.num_dofs();
  Rng rng(seed);
  const RowMatX<double> Q = random_rows(rng, rows, n, 1.5), Qd = random_rows(rng, rows, n, 2.0),
                        X = random_rows(rng, rows, n, 5.0);
  RowMatX<double> tau(rows, n), qdd(rows, n), Y(rows * n, kThetaSize * n);
  RneaWorkspace<double, double> rnea_ws;
  AbaWorkspace<double, double> aba_ws;
  RegressorWorkspace<double, double> regressor_ws;
  for (int k = 0; k < rows; ++k) {
    const VecX<double> q = Q.row(k), qd = Qd.row(k), x = X.row(k);
    tau.row(k) = rnea(arm.tree, q, qd, x, rnea_ws);
    qdd.row(k) = aba(arm.tree, q, qd, x, aba_ws);
    Y.middleRows(k * n, n) = torque_regressor(arm.tree, q, qd, x, regressor_ws);
  }
  std::vector<std::string> choices = batch_instruction_sets();
  choices.emplace_back();  // the best there is, and no packs for a single row
  for (const std::string& name : choices) {
    for (const int threads : {1, 3}) {
      CAPTURE(name, threads);
      const BatchOptions options{.num_threads = threads, .instruction_set = name};
      CHECK_THAT(rnea_batch(arm.tree, Q, Qd, X, options), MatrixNear(tau, scaled_tolerance(tau)));
      CHECK_THAT(aba_batch(arm.tree, Q, Qd, X, options), MatrixNear(qdd, scaled_tolerance(qdd)));
      CHECK_THAT(regressor_batch(arm.tree, Q, Qd, X, options), MatrixNear(Y, scaled_tolerance(Y)));
    }
  }
}

TEST_CASE("batch: a wrong shape and an unknown instruction set are refused by name", "[dynamics]") {
  const RandomArm arm(0);
  const int n = arm.tree.num_dofs();
  const RowMatX<double> good = RowMatX<double>::Zero(4, n),
                        narrow = RowMatX<double>::Zero(4, n - 1),
                        short_ = RowMatX<double>::Zero(3, n);
  CHECK_THROWS_AS(rnea_batch(arm.tree, good, narrow, good), ShapeError);
  CHECK_THROWS_AS(aba_batch(arm.tree, good, good, short_), ShapeError);
  CHECK_THROWS_AS(regressor_batch(arm.tree, narrow, good, good), ShapeError);
  CHECK_THROWS_AS(rnea_batch(arm.tree, good, good, good, {.instruction_set = "abacus"}), Error);
}

TEST_CASE("batch: where joints follow others, too, it gives the scalar results",
          "[dynamics][threads]") {
  const unsigned seed = GENERATE(range(0u, 8u));
  CAPTURE(seed);
  const RandomFollowers c(seed);
  const int n = c.tree.num_dofs(), rows = 21;
  Rng rng(seed + 100);
  RowMatX<double> Y(rows, n), Yd(rows, n), X(rows, n), tau(rows, n), qdd(rows, n),
      regressor(rows * n, 10 * c.tree.num_links());
  RneaWorkspace<double, double> rnea_ws;
  AbaWorkspace<double, double> aba_ws;
  RegressorWorkspace<double, double> regressor_ws;
  for (int k = 0; k < rows; ++k) {
    Y.row(k) = random_vector(rng, n, 1.5);
    Yd.row(k) = random_vector(rng, n, 2.0);
    X.row(k) = random_vector(rng, n, 5.0);
    const VecX<double> y = Y.row(k), yd = Yd.row(k), x = X.row(k);
    tau.row(k) = rnea(c.tree, y, yd, x, rnea_ws);
    qdd.row(k) = aba(c.tree, y, yd, x, aba_ws);
    regressor.middleRows(k * n, n) = torque_regressor(c.tree, y, yd, x, regressor_ws);
  }
  const auto near = [](const RowMatX<double>& truth, double relative) {
    return MatrixNear(truth, relative * (1.0 + truth.cwiseAbs().maxCoeff()));
  };
  for (const std::string& name : batch_instruction_sets()) {
    CAPTURE(name);
    const BatchOptions options{.num_threads = 1, .instruction_set = name};
    CHECK_THAT(rnea_batch(c.tree, Y, Yd, X, options), near(tau, 1e-12));
    CHECK_THAT(aba_batch(c.tree, Y, Yd, X, options), near(qdd, 1e-10));
    CHECK_THAT(regressor_batch(c.tree, Y, Yd, X, options), near(regressor, 1e-12));
  }
}

TEST_CASE("batch: with a free base, too, it gives the scalar results", "[dynamics][threads]") {
  const unsigned seed = GENERATE(range(0u, 8u));
  const bool follows = seed % 2 == 1;
  CAPTURE(seed);
  RandomFloating s(seed, {.num_dofs = 2 + static_cast<int>(seed)});
  if (follows)  // the last joint moves with the first
    for (int j = 0; j < 2 + static_cast<int>(seed); ++j)
      s.tree.coordinates.joints.push_back(j <= static_cast<int>(seed)
                                              ? JointDrive{s.tree.coordinates.count++, 1.0, 0.0}
                                              : JointDrive{0, -0.5, 0.2});
  const int n = s.tree.num_velocities(), rows = 21;
  Rng rng(seed + 100);
  RowMatX<double> Q(rows, s.tree.num_positions()), V(rows, n), X(rows, n), tau(rows, n),
      vd(rows, n), regressor(rows * n, 10 * s.tree.num_links());
  RneaWorkspace<double, double> rnea_ws;
  AbaWorkspace<double, double> aba_ws;
  RegressorWorkspace<double, double> regressor_ws;
  for (int k = 0; k < rows; ++k) {
    const VecX<double> q = random_positions(rng, s.tree), v = random_vector(rng, n, 2.0),
                       x = random_vector(rng, n, 5.0);
    Q.row(k) = q;
    V.row(k) = v;
    X.row(k) = x;
    tau.row(k) = rnea(s.tree, q, v, x, rnea_ws);
    vd.row(k) = aba(s.tree, q, v, x, aba_ws);
    regressor.middleRows(k * n, n) = torque_regressor(s.tree, q, v, x, regressor_ws);
  }
  const auto near = [](const RowMatX<double>& truth, double relative) {
    return MatrixNear(truth, relative * (1.0 + truth.cwiseAbs().maxCoeff()));
  };
  for (const std::string& name : batch_instruction_sets()) {
    CAPTURE(name);
    const BatchOptions options{.num_threads = 1, .instruction_set = name};
    CHECK_THAT(rnea_batch(s.tree, Q, V, X, options), near(tau, 1e-12));
    CHECK_THAT(aba_batch(s.tree, Q, V, X, options), near(vd, 1e-10));
    CHECK_THAT(regressor_batch(s.tree, Q, V, X, options), near(regressor, 1e-12));
  }
  Q(7, 3) += 1e-3;
  CHECK_THROWS_MATCHES(
      rnea_batch(s.tree, Q, V, X), DataError,
      Catch::Matchers::MessageMatches(Catch::Matchers::ContainsSubstring("row 7")));
}

}  // namespace batch_test
