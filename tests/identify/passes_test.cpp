/// Fits that take several passes over the data: what robust weights are worth, friction by the
/// torque that it transmits, and what is said where the passes run out. One pendulum, its motion
/// and torque in closed form.

#include <algorithm>
#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/random.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/identify/torque_regression.hpp>

#include "support/found.hpp"

namespace passes_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using diffnea::test::find;

namespace {

constexpr double kNoise = 0.05;  // of the torque [N·m]

Model pendulum(double mass, double hx) {
  Model model;
  model.name = "pendulum";
  ModelLink link;
  link.name = "bob";
  link.joint = "hinge";
  link.parent = -1;
  link.type = ModelJoint::kRevolute;
  link.axis = {0, 1, 0};
  link.inertia = inertia_from_com<double>(mass, {hx / mass, 0, 0}, {0.1, 0, 0, 0.1, 0, 0.1});
  model.links.push_back(link);
  return model;
}

/// Two incommensurate swings; τ = I q̈ − g h_x cos q about y, h_x along x, and more.
struct Swing {
  double seconds = 40.0, inertia = 0.3, hx = 0.5, mu = 0.0, offset = 0.0;
  unsigned seed = 1;
  double phase = 0.0;
};

Recording recorded(const Swing& s) {
  constexpr double kStep = 0.004;
  Rng rng(s.seed);
  Recording r;
  r.source = "swing-" + std::to_string(s.seed);
  r.joint_names = {"hinge"};
  r.has_tau = {true};
  r.info.torque_sampling = TorqueSampling::kInstant;
  const long rows = std::lround(s.seconds / kStep);
  r.time.resize(rows);
  r.q.resize(rows, 1);
  r.tau.resize(rows, 1);
  for (long k = 0; k < rows; ++k) {
    const double t = kStep * static_cast<double>(k);
    const double a = 2.1 * t + s.phase, b = 3.4 * t;
    const double q = 0.8 * std::sin(a) + 0.5 * std::sin(b);
    const double qd = 0.8 * 2.1 * std::cos(a) + 0.5 * 3.4 * std::cos(b);
    const double qdd = -0.8 * 2.1 * 2.1 * std::sin(a) - 0.5 * 3.4 * 3.4 * std::sin(b);
    const double links = s.inertia * qdd - 9.81 * s.hx * std::cos(q);
    r.time[k] = t;
    r.q(k, 0) = q;
    r.tau(k, 0) =
        links + s.mu * std::abs(links) * std::tanh(qd / 0.01) + s.offset + kNoise * rng.normal();
  }
  return r;
}

/// One torque in a hundred is far off.
Recording with_outliers(Recording r) {
  Rng rng(99);
  for (long k = 0; k < r.rows(); ++k)
    if (rng.uniform() < 0.01) r.tau(k, 0) += 100.0 * kNoise * (rng.uniform() < 0.5 ? -1.0 : 1.0);
  return r;
}

IdentifyOptions with(std::vector<std::string> effects) {
  IdentifyOptions options;
  options.choice.effects = std::move(effects);
  options.preprocess.filter_hz = 20.0;
  // Of the recorded rate: an outlier stays in its row, as in the textbook.
  options.preprocess.decimate_to_hz = 1e3;
  return options;
}

}  // namespace

TEST_CASE("identify: standard errors of robust fits are those of what the loss keeps",
          "[identify]") {
  const Recording clean = recorded({.offset = 0.7});
  IdentifyOptions options = with({"torque_offset"});
  const IdentifyResult plain = identify(pendulum(1.0, 0.4), {clean}, {}, options);
  options.robust = Robust::kCauchy;
  const IdentifyResult robust = identify(pendulum(1.0, 0.4), {with_outliers(clean)}, {}, options);
  const ParameterEstimate &a = find(plain, "hinge.torque_offset.offset"),
                          &b = find(robust, "hinge.torque_offset.offset");
  CAPTURE(a.value, a.std, b.value, b.std);
  REQUIRE(b.identifiable);
  CHECK(std::abs(b.value - 0.7) < 4.0 * b.std);
  // Low-passed, an outlier reaches a dozen rows: some rows less, and 5 % of efficiency.
  CHECK(b.std < 1.6 * a.std);
  CHECK(b.std > 0.8 * a.std);
  CHECK(robust.summary.converged);
}

TEST_CASE("identify: robust weights move shapes, too", "[identify]") {
  // A spring's rest has a column of its own: where outliers pull at it, the weights must know.
  Recording r = recorded({});
  r.tau.col(0).array() += 4.0 * (r.q.col(0).array() - 0.3);
  for (long k = 2000; k < 2400; ++k) r.tau(k, 0) += 8.0;  // 1.6 s of something else
  IdentifyOptions options = with({"joint_spring"});
  options.choice.fit = {"inertia", "effects", "shapes"};
  options.choice.fix = {"bob.*"};
  const Model model = pendulum(1.0, 0.5);
  Model start = model;
  start.links[0].inertia.I = {0.06, 0, 0, 0.3, 0, 0.3};  // as recorded
  const ParameterEstimate plain =
      find(identify(start, {r}, {}, options), "hinge.joint_spring.rest");
  options.robust = Robust::kCauchy;
  const IdentifyResult result = identify(start, {r}, {}, options);
  const ParameterEstimate& rest = find(result, "hinge.joint_spring.rest");
  CAPTURE(plain.value, plain.std, rest.value, rest.std);
  REQUIRE(rest.identifiable);
  CHECK(std::abs(rest.value - 0.3) < 0.2 * std::abs(plain.value - 0.3));
  CHECK(rest.std < 0.3 * plain.std);
}

TEST_CASE("identify: what did not settle within the passes has not converged", "[identify]") {
  const Recording r = with_outliers(recorded({.offset = 0.7}));
  IdentifyOptions options = with({"torque_offset"});
  options.robust = Robust::kHuber;
  const IdentifyResult full = identify(pendulum(1.0, 0.4), {r}, {}, options);
  REQUIRE(full.summary.converged);
  CHECK(full.summary.termination == "converged");
  options.max_passes = 1;  // weights get their five all the same
  const IdentifyResult few = identify(pendulum(1.0, 0.4), {r}, {}, options);
  CHECK(std::abs(find(few, "bob.hx").value - find(full, "bob.hx").value) <
        find(full, "bob.hx").std);

  IdentifyOptions shapes = with({"stribeck_friction"});
  shapes.choice.fit.emplace_back("shapes");
  shapes.max_passes = 2;
  const IdentifyResult cut = identify(pendulum(1.0, 0.4), {recorded({.mu = 0.1})}, {}, shapes);
  CHECK_FALSE(cut.summary.converged);
  CHECK_THAT(cut.summary.termination, ContainsSubstring("and the shapes have not settled"));
}

TEST_CASE("identify: load friction is in proportion to the fitted torque, not the model's",
          "[identify]") {
  const Recording train = recorded({.mu = 0.15}),
                  test = recorded({.mu = 0.15, .seed = 2, .phase = 1});
  Model light = pendulum(1.0, 0.5);  // 30 % of what the links transmit is missing
  light.links[0].inertia.m *= 0.7;
  light.links[0].inertia.h = light.links[0].inertia.h * 0.7;
  light.links[0].inertia.I = {0.03, 0, 0, 0.2, 0, 0.2};
  const IdentifyResult result = identify(light, {train}, {test}, with({"load_friction"}));
  const ParameterEstimate& mu = find(result, "hinge.load_friction.mu");
  CAPTURE(mu.value, mu.std);
  CHECK(std::abs(mu.value - 0.15) < 0.004);  // filters blur its jumps: 2 %
  CHECK(result.summary.converged);
  CHECK(result.errors[0].test < 1.3 * result.errors[0].train);
}

TEST_CASE("regression: rows beyond what is kept are spread over all runs", "[identify]") {
  const Model model = pendulum(1.0, 0.5);
  const auto source = recordings_in_memory(
      model, {recorded({.seconds = 60.0}), recorded({.seconds = 30.0, .seed = 2, .phase = 1.0})});
  FitChoice choice;
  choice.effects = std::vector<std::string>{"torque_offset"};
  const FitLayout layout = make_layout(model, choice, {0, 1});
  const PreprocessPlan plan = plan_preprocess(source->sample(), with({}).preprocess);
  RegressionOptions options;
  options.keep_bytes = 12L * 8 * 8000;  // of 22 500 rows of twelve numbers
  TorqueRegression regression(model, layout, plan, {layout.prior(), VecX<double>()}, options);
  source->for_each([&](const Recording& r) {
    regression.add(preprocess(r, plan));
    return true;
  });
  const JointRows& kept = regression.kept()[0];
  CHECK(kept.values.size() * sizeof(double) <= static_cast<std::size_t>(options.keep_bytes));
  long of[2] = {0, 0};
  for (const int run : kept.run) ++of[run];
  CHECK(of[0] + of[1] > 4000);  // no less than half of the budget
  CHECK(of[1] >= 1024);
  CHECK(kept.factored.at(0) + kept.factored.at(1) == regression.factors()[0].factor.rows());
  // Plots show the beginning without a gap.
  for (std::size_t k = 1; k < kMaxSeriesRows; ++k)
    REQUIRE(std::abs(kept.time[k] - kept.time[k - 1] - kept.step) < 1e-9);
}

}  // namespace passes_test
