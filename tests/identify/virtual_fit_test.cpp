/// The paper's virtual parameters reach the optimum of the convex fit, and say where they cannot.

#include <algorithm>
#include <cmath>
#include <support/wam_study.hpp>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/identify/virtual_fit.hpp>
#include <diffnea/model/physical.hpp>

namespace virtual_fit_test {

using namespace diffnea;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;

namespace {

VecX<double> random_body(Rng& rng) {
  Theta<double> phi;
  for (double& x : phi) x = 0.3 * rng.normal();
  const Theta<double> t = theta_from_log_cholesky(phi);
  return Eigen::Map<const VecX<double>>(t.data(), kThetaSize);
}

/// Two bodies and a friction, of which 60 noisy rows tell everything.
ConvexFitProblem noisy(unsigned seed) {
  Rng rng(seed);
  VecX<double> truth(21);
  truth << random_body(rng), random_body(rng), 0.7;
  ConvexFitProblem problem;
  problem.R.resize(60, 21);
  for (double& x : problem.R.reshaped()) x = 10.0 * rng.normal();
  problem.d = problem.R * truth;
  for (double& x : problem.d) x += 0.1 * rng.normal();
  problem.start.resize(21);
  problem.start << random_body(rng), random_body(rng), 0.1;
  problem.bodies = {0, 10};
  problem.nonnegative = {20};
  problem.prior_information = 1e-4 * MatX<double>::Identity(21, 21);
  return problem;
}

}  // namespace

TEST_CASE("virtual fit: the optimum of the convex fit", "[identify]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  const ConvexFitProblem problem = noisy(seed);
  const ConvexFitResult convex = solve_convex_fit(problem), found = solve_virtual_fit(problem);
  REQUIRE(convex.converged);
  REQUIRE(found.converged);
  // The barrier keeps the convex one a thousandth of a standard error away from it.
  CHECK((problem.R * (found.x - convex.x)).norm() < 1e-2);
  CHECK(found.objective == Approx(convex.objective).epsilon(1e-4));
}

TEST_CASE("virtual fit: a recorded arm's errors do not depend on the coordinates", "[identify]") {
  const test::WamDraw draw = test::draw_wam(300, 20.0);
  IdentifyOptions options;
  const IdentifyResult convex = identify(draw.nominal, {draw.train}, {}, options);
  options.linear.parameters = FitParameters::kVirtual;
  const IdentifyResult found = identify(draw.nominal, {draw.train}, {}, options);
  REQUIRE(found.summary.converged);
  for (std::size_t k = 0; k < convex.parameters.size(); ++k) {
    CAPTURE(convex.parameters[k].name);
    if (!convex.parameters[k].identifiable) continue;
    // Along flat valleys near the boundary the descent creeps: 1.4 observed.
    CHECK(std::abs(found.parameters[k].value - convex.parameters[k].value) <
          2.0 * convex.parameters[k].std);
  }
  for (std::size_t j = 0; j < convex.errors.size(); ++j)
    CHECK(found.errors[j].train == Approx(convex.errors[j].train).epsilon(5e-3));
}

TEST_CASE("virtual fit: an impossible optimum is approached at the boundary", "[identify]") {
  ConvexFitProblem problem = noisy(3);
  VecX<double> wanted = solve_convex_fit(problem).x;
  wanted[0] = -0.5;  // a negative mass
  problem.d = problem.R * wanted;
  const ConvexFitResult convex = solve_convex_fit(problem), found = solve_virtual_fit(problem);
  // At the boundary squares have no slope: the descent ends 3 % above here, never below.
  CHECK(found.objective > 0.9999 * convex.objective);
  CHECK(found.objective < 1.1 * convex.objective);
  Theta<double> body;
  std::copy_n(found.x.data(), kThetaSize, body.begin());
  CHECK(smallest_pseudo_inertia_eigenvalue(body) > -1e-9);
}

TEST_CASE("virtual fit: what virtual parameters cannot express is refused", "[identify]") {
  ConvexFitProblem problem = noisy(1);
  problem.fixed = {0};
  CHECK_THROWS_WITH(solve_virtual_fit(problem), ContainsSubstring("hold all ten or none"));
  problem.fixed.clear();
  problem.entropic_prior = 1.0;
  CHECK_THROWS_WITH(solve_virtual_fit(problem), ContainsSubstring("entropic prior"));
}

TEST_CASE("virtual fit: a link that is held in part is refused by name", "[identify]") {
  const test::WamDraw draw = test::draw_wam(300, 10.0);
  IdentifyOptions options;
  options.linear.parameters = FitParameters::kVirtual;
  options.choice.fix = {"forearm.mass"};
  CHECK_THROWS_WITH(
      identify(draw.nominal, {draw.train}, {}, options),
      ContainsSubstring("forearm: 1 of its ten") && ContainsSubstring("--fix \"forearm.*\""));
}

}  // namespace virtual_fit_test
