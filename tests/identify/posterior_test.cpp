/// Draws of the posterior that identification leaves: its correlations, what is possible, and what
/// no recording tells.

#include <algorithm>
#include <cmath>
#include <map>
#include <support/camera_ball.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/identify/posterior.hpp>
#include <diffnea/model/physical.hpp>

namespace posterior_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr int kMany = 2000;
/// Of a standard deviation estimated from 2000 draws: 5/√(2·2000).
constexpr double kSpread = 0.08;

/// A posterior of parameters named so, from their covariance.
Posterior posterior(const std::vector<std::string>& names, const MatX<double>& covariance) {
  const MatX<double> H = covariance.inverse();
  return {names, std::vector<double>(names.size(), 0.0), {H.data(), H.data() + H.size()}, {}};
}

struct Moments {
  double mean_a = 0.0, mean_b = 0.0, std_a = 0.0, std_b = 0.0, correlation = 0.0;
};
template <class A, class B>
Moments moments(const std::vector<Model>& draws, const A& a, const B& b) {
  Moments m;
  const double n = static_cast<double>(draws.size());
  for (const Model& d : draws) {
    m.mean_a += a(d) / n;
    m.mean_b += b(d) / n;
  }
  double ab = 0.0;
  for (const Model& d : draws) {
    const double x = a(d) - m.mean_a, y = b(d) - m.mean_b;
    m.std_a += x * x / n;
    m.std_b += y * y / n;
    ab += x * y / n;
  }
  m.std_a = std::sqrt(m.std_a);
  m.std_b = std::sqrt(m.std_b);
  m.correlation = ab / (m.std_a * m.std_b);
  return m;
}

double length(const Model& m) { return m.ball->string->length; }
double along(const Model& m) { return m.ball->string->p_LS.z; }

double effect_value(const Model& model, const std::string& effect, const std::string& where) {
  for (const EffectSpec& e : model.effects)
    if (e.effect == effect && e.where == where) return e.parameters.front().value;
  FAIL("no " << effect << " at " << where);
  return 0.0;
}

}  // namespace

TEST_CASE("draws: length and attachment of a string move together, as they were found",
          "[posterior]") {
  Model model = test::swinging_arm();
  constexpr double kLength = 4e-3, kAlong = 5e-3, kCorrelation = -0.99;
  const double both = kCorrelation * kLength * kAlong;
  model.posterior =
      posterior({"string.length", "string.attachment_z"},
                (MatX<double>(2, 2) << kLength * kLength, both, both, kAlong * kAlong).finished());
  const std::vector<Model> draws = draw_models(model, kMany, 1);
  const Moments m = moments(draws, length, along);
  CHECK_THAT(m.mean_a, WithinAbs(length(model), 5.0 * kLength / std::sqrt(kMany)));
  CHECK_THAT(m.mean_b, WithinAbs(along(model), 5.0 * kAlong / std::sqrt(kMany)));
  CHECK_THAT(m.std_a, WithinRel(kLength, kSpread));
  CHECK_THAT(m.std_b, WithinRel(kAlong, kSpread));
  CHECK_THAT(m.correlation, WithinAbs(kCorrelation, 0.005));  // (1 − ρ²)/√n · 5 = 0.002
  for (const Model& d : draws) REQUIRE(d.ball->string->p_LS.x == model.ball->string->p_LS.x);
}

TEST_CASE("draws: every body is one that can be, and no friction is below 0", "[posterior]") {
  Model model = test::swinging_arm();
  model.effects.push_back({"viscous_friction", "joint1", {{"viscous", 0.05, ""}}});
  const ModelLink& link = model.links[static_cast<std::size_t>(moving_links(model)[1])];
  const Theta<double> theta = link.inertia.theta();
  std::vector<std::string> names{"joint1.viscous_friction.viscous"};
  for (const char* p : {"mass", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"})
    names.push_back(link.name + "." + p);
  // So wide that most of the Gaussian is impossible, and narrower than what counts as not known.
  MatX<double> covariance = MatX<double>::Zero(11, 11);
  covariance(0, 0) = 0.1 * 0.1;
  const double m = theta[0], size = std::sqrt((theta[4] + theta[7] + theta[9]) / m);
  for (int k = 0; k < 10; ++k) {
    const double scale = k == 0 ? m : k < 4 ? m * size : m * size * size;
    covariance(k + 1, k + 1) = std::pow(0.3 * scale, 2);
  }
  model.posterior = posterior(names, covariance);
  int moved = 0;
  for (const Model& d : draw_models(model, 200, 3)) {
    const Theta<double> t = d.links[static_cast<std::size_t>(moving_links(d)[1])].inertia.theta();
    CHECK(smallest_pseudo_inertia_eigenvalue(t) > -1e-12 * t[0]);
    CHECK(effect_value(d, "viscous_friction", "joint1") >= 0.0);
    CHECK(check_model(d).empty());
    moved += std::abs(t[0] - m) > 0.05 * m ? 1 : 0;
  }
  CHECK(moved > 100);
}

TEST_CASE("draws: what the data see keeps its spread, what they do not see stays", "[posterior]") {
  Model model = test::swinging_arm();
  model.effects.push_back({"viscous_friction", "joint0", {{"viscous", 1.0, ""}}});
  model.effects.push_back({"viscous_friction", "joint1", {{"viscous", 2.0, ""}}});
  const std::string link = model.links[static_cast<std::size_t>(moving_links(model)[0])].name;
  // Friction's sum is known to 0.02, its difference to 0.1; the mass not at all.
  MatX<double> J(2, 2);
  J << 1.0, 1.0, 1.0, -1.0;
  const MatX<double> W = VecX<double>{{1.0 / (0.02 * 0.02), 1.0 / (0.1 * 0.1)}}.asDiagonal();
  MatX<double> H = MatX<double>::Zero(3, 3);
  H.topLeftCorner(2, 2) = J.transpose() * W * J;
  model.posterior = Posterior{
      {"joint0.viscous_friction.viscous", "joint1.viscous_friction.viscous", link + ".mass"},
      {1.0, 2.0, 0.0},
      {H.data(), H.data() + H.size()},
      {}};
  const std::vector<Model> draws = draw_models(model, kMany, 5);
  const auto friction = [](const char* joint) {
    return [joint](const Model& d) { return effect_value(d, "viscous_friction", joint); };
  };
  const auto a = friction("joint0"), b = friction("joint1");
  const Moments m = moments(
      draws, [&](const Model& d) { return a(d) + b(d); },
      [&](const Model& d) { return a(d) - b(d); });
  CHECK_THAT(m.std_a, WithinRel(0.02, kSpread));
  CHECK_THAT(m.std_b, WithinRel(0.1, kSpread));
  CHECK_THAT(m.correlation, WithinAbs(0.0, 5.0 / std::sqrt(kMany)));
  const VecX<double> pi = inertial_parameters(make_tree(model));
  for (const Model& d : draws) REQUIRE(inertial_parameters(make_tree(d)) == pi);
}

TEST_CASE("draws: identify leaves the ball's posterior beside the arm's", "[posterior]") {
  const Model truth = test::swinging_arm();
  const test::SwingOptions swing{.seconds = 8, .seed = 3};
  Recording train = test::record_swing(truth, swing);
  test::add_torque(truth, swing, train);
  IdentifyOptions options;
  options.choice.effects = {"viscous_friction", "linear_drag"};
  const IdentifyResult fit = identify(truth, {train}, {}, options);
  REQUIRE(fit.model.posterior);
  CHECK(knows_arm(*fit.model.posterior));
  const std::vector<Model> draws = draw_models(fit.model, kMany, 7);
  const Moments m = moments(draws, length, along);
  std::map<std::string, double> std;
  for (const ParameterEstimate& p : fit.parameters) std[p.name] = p.std;
  CHECK_THAT(m.std_a, WithinRel(std.at("string.length"), kSpread));
  CHECK_THAT(m.std_b, WithinRel(std.at("string.attachment_z"), kSpread));
  const Moments friction = moments(
      draws, [](const Model& d) { return effect_value(d, "viscous_friction", "joint2"); }, length);
  CHECK(friction.std_a > 0.0);
  CHECK_THAT(friction.correlation, WithinAbs(0.0, 5.0 / std::sqrt(kMany)));
}

TEST_CASE("draws: the first are the same however many are asked for", "[posterior]") {
  Model model = test::swinging_arm();
  model.posterior = posterior({"string.length"}, MatX<double>::Constant(1, 1, 1e-6));
  const std::vector<Variation> vary{{"string.string_mass.mass_ratio", 0.0, 0.1}};
  const std::vector<Model> few = draw_models(model, 3, 9, vary),
                           many = draw_models(model, 9, 9, vary),
                           others = draw_models(model, 3, 10, vary);
  for (std::size_t k = 0; k < few.size(); ++k) {
    CHECK(length(few[k]) == length(many[k]));
    CHECK(length(few[k]) != length(others[k]));
    CHECK(effect_value(few[k], "string_mass", "string") ==
          effect_value(many[k], "string_mass", "string"));
  }
}

TEST_CASE("draws: what is varied lies in its range, with or without a posterior", "[posterior]") {
  Model model = test::swinging_arm();
  model.effects.push_back({"linear_drag", "ball", {{"drag", 0.5, ""}}});
  const bool with = GENERATE(true, false);
  if (with)
    model.posterior = posterior({"ball.linear_drag.drag"}, MatX<double>::Constant(1, 1, 1e-4));
  const std::vector<Model> draws =
      draw_models(model, 400, 11,
                  {parse_variation("string.string_damping.damping=0:0.4"),
                   parse_variation("string.length=0.39:0.41")});
  double lowest = 1.0, highest = 0.0;
  for (const Model& d : draws) {
    const double damping = effect_value(d, "string_damping", "string");
    lowest = std::min(lowest, damping);
    highest = std::max(highest, damping);
    CHECK(length(d) >= 0.39);
    CHECK(length(d) <= 0.41);
    CHECK((effect_value(d, "linear_drag", "ball") == 0.5) == !with);
    REQUIRE(d.effects.size() == model.effects.size() + 1);
    CHECK(d.effects.back().effect == "string_damping");
  }
  // All 400 on one side of a twentieth of the range: (19/20)^400 = 1e-9.
  CHECK(lowest < 0.02);
  CHECK(highest > 0.38);
  CHECK(lowest >= 0.0);
  CHECK(highest <= 0.4);
  const Model absent = with_varied_effects(model, {{"string.string_mass.mass_ratio", 0.01, 0.1}});
  CHECK(effect_value(absent, "string_mass", "string") == 0.0);
}

TEST_CASE("draws: what cannot be is said", "[posterior]") {
  Model model = test::swinging_arm();
  CHECK_THROWS_WITH(draw_models(model, 4, 1),
                    ContainsSubstring("has no posterior") && ContainsSubstring("identify"));
  const auto vary = [&](const std::string& text) {
    return draw_models(model, 4, 1, {parse_variation(text)});
  };
  CHECK_THROWS_WITH(vary("string.string_mas.mass_ratio=0:1"), ContainsSubstring("string_mass"));
  CHECK_THROWS_WITH(vary("string.string_mass.mas=0:1"), ContainsSubstring("mass_ratio"));
  CHECK_THROWS_WITH(vary("elbow.string_mass.mass_ratio=0:1"), ContainsSubstring("elbow"));
  CHECK_THROWS_WITH(vary("string.string_mass.mass_ratio=-1:1"), ContainsSubstring("mass_ratio"));
  CHECK_THROWS_WITH(vary("string.length=0:1"), ContainsSubstring("positive length"));
  CHECK_THROWS_WITH(vary("link0.mass=0:1"), ContainsSubstring("WHERE.EFFECT.PARAMETER"));
  for (const char* text : {"string.length", "=0:1", "string.length=0.4", "string.length=a:b",
                           "string.length=0:nan", "string.length=0.3:"})
    CHECK_THROWS_WITH(parse_variation(text), ContainsSubstring("PARAMETER=LOW:HIGH"));
  CHECK_THROWS_WITH(parse_variation("string.length=0.5:0.4"), ContainsSubstring("low end"));

  model.posterior = posterior({"wrist.mass"}, MatX<double>::Constant(1, 1, 1.0));
  CHECK_THROWS_WITH(draw_models(model, 4, 1), ContainsSubstring("wrist.mass"));
  model.posterior = posterior({"link1.mass"}, MatX<double>::Constant(1, 1, 1e-4));
  model.ball->string->length_std = 1e-4;
  CHECK_THROWS_WITH(draw_models(model, 4, 1), ContainsSubstring("says nothing of the string"));
}

}  // namespace posterior_test
