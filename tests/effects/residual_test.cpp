/// The effect `residual`: its torque against the recursion that defines B-splines, where it ends,
/// and what its file holds.

#include <cmath>
#include <limits>
#include <support/bump_table.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/io/model_file.hpp>

namespace residual_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;

namespace {

/// The same polynomial in another order of operations: rounding of terms of order 10.
constexpr double kSameFormula = 1e-13;
/// Central difference, h = 1e-6 on accelerations of order 100: rounding leaves 1e-8 of them.
constexpr double kDifferenceTol = 1e-5;

/// Cox and de Boor's recursion on the knots −2 … 2, as high as 1.
double spline(double u, int degree = 3, int first = -2) {
  if (degree == 0) return u >= first && u < first + 1 ? 1.0 : 0.0;
  const double left = (u - first) / degree, right = (first + degree + 1 - u) / degree;
  const double b = left * spline(u, degree - 1, first) + right * spline(u, degree - 1, first + 1);
  return degree == 3 ? 1.5 * b : b;
}

Model arm() { return read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml"); }

double torque(const BoundEffect& e, const VecX<double>& q, const VecX<double>& qd) {
  VecX<double> tau = VecX<double>::Zero(q.size());
  JointSample<double> x;
  x.q = q.data();
  x.qd = qd.data();
  add_torque(e, x, e.parameters.data(), tau.data());
  for (long j = 0; j < tau.size(); ++j)
    if (j != e.joints[0]) CHECK(tau[j] == 0.0);
  return tau[e.joints[0]];
}

EffectSpec residual(double scale = 1.0) {
  return {"residual", "joint2", {{"scale", scale, ""}}, test::bump_table("joint2", "joint4")};
}

}  // namespace

TEST_CASE("residual: its torque is the weighted sum of products of B-splines", "[effects]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  Rng rng(seed);
  VecX<double> q(4), qd(4);
  for (double& x : q) x = rng.uniform(-1.5, 1.5);
  for (double& x : qd) x = rng.uniform(-1.5, 1.5);
  const BoundEffect e = bind(residual(0.7), arm());
  const BumpTable t = *residual().table;
  double expected = 0.0;
  for (std::size_t b = 0; b < 3; ++b)
    expected += t.weights[b] * spline((q[1] - t.centres[2 * b]) / t.widths[2 * b]) *
                spline((qd[3] - t.centres[2 * b + 1]) / t.widths[2 * b + 1]);
  CHECK_THAT(torque(e, q, qd), WithinAbs(0.7 * expected, kSameFormula));
}

TEST_CASE("residual: beyond two widths it is 0, and never above its bound", "[effects]") {
  EffectSpec spec = residual();
  spec.table->bound = 0.25;
  const BoundEffect e = bind(spec, arm());
  VecX<double> q = VecX<double>::Zero(4), qd = q;
  bool reached = false;
  for (double a = -6.0; a <= 6.0; a += 0.05)
    for (double v = -6.0; v <= 6.0; v += 0.05) {
      q[1] = a;
      qd[3] = v;
      const double tau = torque(e, q, qd);
      CHECK(std::abs(tau) <= 0.25);
      reached = reached || std::abs(tau) == 0.25;
      // Every centre and two of its widths, and a little for rounding of the steps.
      if (a < -1.71 || a > 2.81 || v < -2.56 || v > 2.66) CHECK(tau == 0.0);
    }
  CHECK(reached);
  q[1] = std::numeric_limits<double>::quiet_NaN();  // what a simulator asks formulas with
  CHECK(std::isnan(torque(e, q, qd)));
}

TEST_CASE("residual: a simulation has its derivatives, another joint's too", "[dynamics]") {
  Model model = arm();
  model.effects = {residual()};
  ForwardDynamics dynamics(extend(model));
  const unsigned seed = GENERATE(range(0u, 5u));
  CAPTURE(seed);
  Rng rng(seed);
  VecX<double> q(4), qd(4), u(4);
  for (double& x : q) x = rng.uniform(-0.5, 0.5);
  for (double& x : qd) x = rng.uniform(-0.5, 0.5);
  for (double& x : u) x = rng.uniform(-10.0, 10.0);
  dynamics.linearise(q.data(), qd.data(), u.data(), 0);
  const RowMatX<double> of_q = dynamics.dqdd_dq(), of_qd = dynamics.dqdd_dqd();
  constexpr double kStep = 1e-6;
  const auto moved = [&](VecX<double>& x, int j, double by) {
    VecX<double> qdd(4);
    const double before = x[j];
    x[j] += by;
    dynamics.acceleration(q.data(), qd.data(), u.data(), 0, qdd.data());
    x[j] = before;
    return qdd;
  };
  for (int j = 0; j < 4; ++j) {
    const VecX<double> by_q = (moved(q, j, kStep) - moved(q, j, -kStep)) / (2.0 * kStep);
    const VecX<double> by_qd = (moved(qd, j, kStep) - moved(qd, j, -kStep)) / (2.0 * kStep);
    for (int i = 0; i < 4; ++i) {
      CHECK_THAT(of_q(i, j), WithinAbs(by_q[i], kDifferenceTol * (1.0 + std::abs(by_q[i]))));
      CHECK_THAT(of_qd(i, j), WithinAbs(by_qd[i], kDifferenceTol * (1.0 + std::abs(by_qd[i]))));
    }
  }
}

TEST_CASE("residual: a model file holds every number of its table", "[io]") {
  Model model = arm();
  EffectSpec spec = residual(1.0 / 3.0);
  spec.table->weights[1] = 0.1 + 0.2;
  model.effects = {spec};
  const std::string text = model_to_json(model);
  const Model back = model_from_json(text, "text");
  REQUIRE(back.effects.size() == 1);
  REQUIRE(back.effects[0].table);
  CHECK(back.effects[0].table->variables == spec.table->variables);
  CHECK(back.effects[0].table->centres == spec.table->centres);
  CHECK(back.effects[0].table->widths == spec.table->widths);
  CHECK(back.effects[0].table->weights == spec.table->weights);
  CHECK(back.effects[0].table->bound == spec.table->bound);
  CHECK(model_to_json(back) == text);
}

TEST_CASE("residual: a table that cannot be one is refused by name", "[effects]") {
  const auto refusal = [](auto change) {
    EffectSpec spec = residual();
    change(spec);
    try {
      bind(spec, arm());
    } catch (const ModelError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  CHECK_THAT(refusal([](EffectSpec& s) { s.table.reset(); }), ContainsSubstring("no table"));
  CHECK_THAT(refusal([](EffectSpec& s) { s.where = "all"; }),
             ContainsSubstring("expected that joint's name"));
  CHECK_THAT(refusal([](EffectSpec& s) { s.table->variables[1] = "qdd_joint4"; }),
             ContainsSubstring("expected q_<joint> or qd_<joint>"));
  CHECK_THAT(refusal([](EffectSpec& s) { s.table->centres.pop_back(); }),
             ContainsSubstring("got 5 centres, expected 6"));
  CHECK_THAT(refusal([](EffectSpec& s) { s.table->widths[0] = 0.0; }),
             ContainsSubstring("widths must be above 0"));
  CHECK_THAT(refusal([](EffectSpec& s) { s.table->bound = -1.0; }),
             ContainsSubstring("expected a finite number, 0 or above"));
  CHECK_THAT(refusal([](EffectSpec& s) {
               s.effect = "coulomb_friction";
               s.parameters.clear();
             }),
             ContainsSubstring("of the effect residual alone"));
}

}  // namespace residual_test
