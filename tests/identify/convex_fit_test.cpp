#include <Eigen/QR>
#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_all.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/identify/convex_fit.hpp>
#include <diffnea/model/physical.hpp>

namespace convex_fit_test {

using namespace diffnea;
using Catch::Approx;

namespace {

/// A barrier of 1e-6 moves a parameter by 1e-6 of the unit in which the data press: 1e-4 observed
/// over the seeds where data of unit weight meet bodies of order 1.
constexpr double kBarrierTol = 1e-3;

VecX<double> random_body(Rng& rng) {
  Theta<double> phi;
  for (double& x : phi) x = 0.3 * rng.normal();
  const Theta<double> t = theta_from_log_cholesky(phi);
  return Eigen::Map<const VecX<double>>(t.data(), kThetaSize);
}

MatX<double> random_matrix(Rng& rng, int rows, int cols) {
  MatX<double> m(rows, cols);
  for (long i = 0; i < m.size(); ++i) m.data()[i] = rng.normal();
  return m;
}

ConvexFitProblem two_bodies(Rng& rng, VecX<double>& truth) {
  ConvexFitProblem problem;
  truth.resize(21);
  truth << random_body(rng), random_body(rng), 0.7;
  problem.R = 10.0 * random_matrix(rng, 30, 21);
  problem.d = problem.R * truth;
  problem.start.resize(21);
  problem.start << random_body(rng), random_body(rng), 0.1;
  problem.bodies = {0, 10};
  problem.nonnegative = {20};
  return problem;
}

}  // namespace

TEST_CASE("convex fit: finds consistent truth without noise", "[identify]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  Rng rng(seed);
  VecX<double> truth;
  const ConvexFitProblem problem = two_bodies(rng, truth);
  const ConvexFitResult fit = solve_convex_fit(problem);
  CHECK(fit.converged);
  CHECK((fit.x - truth).norm() < kBarrierTol);
  CHECK(fit.active_bodies.empty());
  CHECK(fit.active_nonnegative.empty());
}

TEST_CASE("convex fit: an impossible optimum ends on the boundary and says so", "[identify]") {
  Rng rng(7);
  VecX<double> truth;
  ConvexFitProblem problem = two_bodies(rng, truth);
  truth[0] = -0.5;   // the data ask for a negative mass …
  truth[20] = -0.3;  // … and for negative friction
  problem.d = problem.R * truth;
  const ConvexFitResult fit = solve_convex_fit(problem);
  CHECK(fit.converged);
  CHECK(fit.active_bodies == std::vector<int>{0});
  CHECK(fit.active_nonnegative == std::vector<int>{20});
  CHECK(fit.consistency_cost > 1.0);
  Theta<double> body;
  std::copy_n(fit.x.data(), kThetaSize, body.begin());
  CHECK(smallest_pseudo_inertia_eigenvalue(body) > 0.0);
  // Optimal: no consistent body nearby is better (the problem is convex, so nearby is enough).
  const double at_optimum = (problem.R * fit.x - problem.d).squaredNorm();
  for (int trial = 0; trial < 200; ++trial) {
    VecX<double> other = truth;
    other.head(10) = random_body(rng);
    other.segment(10, 10) = random_body(rng);
    other[20] = std::abs(rng.normal());
    const VecX<double> near = fit.x + 1e-3 * (other - fit.x);
    CHECK((problem.R * near - problem.d).squaredNorm() > at_optimum - 1e-4);
  }
}

TEST_CASE("convex fit: fixed parameters stay, the others fit around them", "[identify]") {
  Rng rng(3);
  VecX<double> truth;
  ConvexFitProblem problem = two_bodies(rng, truth);
  for (int k = 10; k < 20; ++k) {
    problem.fixed.push_back(k);
    problem.start[k] = truth[k];
  }
  const ConvexFitResult fit = solve_convex_fit(problem);
  CHECK(fit.x.segment(10, 10) == problem.start.segment(10, 10));
  CHECK((fit.x - truth).norm() < kBarrierTol);
}

TEST_CASE("convex fit: what the data do not see stays at the prior", "[identify]") {
  Rng rng(4);
  VecX<double> truth;
  ConvexFitProblem problem = two_bodies(rng, truth);
  const MatX<double> N = MatX<double>(random_matrix(rng, 21, 2));
  // Remove two directions from the data; hold them by a weak prior.
  const MatX<double> Q =
      Eigen::HouseholderQR<MatX<double>>(N).householderQ() * MatX<double>::Identity(21, 2);
  problem.R -= problem.R * Q * Q.transpose();
  problem.d = problem.R * truth;
  problem.prior_information = Q * Q.transpose();
  problem.start = truth;
  for (double& x : problem.start) x += 0.1 * rng.normal();
  const ConvexFitResult fit = solve_convex_fit(problem);
  CHECK(fit.converged);
  CHECK(fit.active_bodies.empty());
  CHECK((Q.transpose() * (problem.start - truth)).norm() > 20 * kBarrierTol);
  CHECK((Q.transpose() * (fit.x - problem.start)).norm() < kBarrierTol);
  const VecX<double> seen = fit.x - truth - Q * (Q.transpose() * (fit.x - truth));
  CHECK(seen.norm() < kBarrierTol);
}

TEST_CASE("convex fit: bad problems are refused", "[identify]") {
  Rng rng(5);
  VecX<double> truth;
  ConvexFitProblem problem = two_bodies(rng, truth);
  problem.start[0] = -1.0;
  CHECK_THROWS_AS(solve_convex_fit(problem), ModelError);
  problem = two_bodies(rng, truth);
  problem.d.resize(3);
  CHECK_THROWS_AS(solve_convex_fit(problem), ShapeError);
}

}  // namespace convex_fit_test
