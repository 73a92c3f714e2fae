#include <array>
#include <support/bump_table.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include "diffnea/effects/catalogue.hpp"
#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/effects/forward_dynamics.hpp>

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;

namespace diffnea::effects_test {
namespace {

/// The same formula in another order of operations: rounding of a few sums of order 10.
constexpr double kSameFormula = 1e-12;
/// Central difference, h = 1e-6, against tanh(q̇/0.05): third derivative 2/0.05³, leaves h²·10³ =
/// 1e-9, and rounding 1e-16·10/h = 1e-9; 10² of margin.
constexpr double kCentralDifferenceTol = 1e-7;

Model arm() {
  Model model;
  model.name = "arm";
  for (int i = 0; i < 3; ++i) {
    ModelLink link;
    link.name = "link" + std::to_string(i);
    link.joint = i == 0 ? "base_yaw" : i == 1 ? "elbow" : "slide";
    link.parent = i - 1;
    link.type = i == 2 ? ModelJoint::kPrismatic : ModelJoint::kRevolute;
    model.links.push_back(link);
  }
  return model;
}

struct State {
  double q[3], qd[3], qdd[3], tau[3];
  JointSample<double> sample(int run = 0) const { return {2.0, run, q, qd, qdd, tau}; }
};

State random_state(unsigned seed) {
  Rng rng(seed);
  State s{};
  for (double* row : {s.q, s.qd, s.qdd, s.tau})
    for (int i = 0; i < 3; ++i) row[i] = rng.normal();
  s.qd[0] *= 0.05;  // the smooth part of tanh
  return s;
}

/// Parameters of every effect, apart from one another and from 1.
EffectSpec spec_of(const EffectInfo& info) {
  EffectSpec spec{info.name, info.place == Place::kJointPair ? "base_yaw,elbow" : "base_yaw", {}};
  if (info.place == Place::kTip) spec.where = "tip";
  if (info.place == Place::kBase) spec.where = "base";
  double value = 0.7;
  for (const ParameterInfo& p : info.parameters) {
    const double v = p.name == "smoothing" ? 0.05 : value > p.most ? 0.5 * p.most : value;
    spec.parameters.push_back({p.per_run ? p.name + "_0" : p.name, v, ""});
    value += 0.4;
  }
  if (info.name == "residual") spec.table = test::bump_table("base_yaw", "base_yaw");
  return spec;
}

std::vector<double> torque(const BoundEffect& e, const JointSample<double>& x) {
  std::vector<double> tau(e.num_joints, 0.0);
  add_torque(e, x, e.parameters.data(), tau.data());
  return tau;
}

double sign_of(double x) { return x < 0 ? -1.0 : 1.0; }

/// τ of joint 0 (and 1) written from the table of effects, not from the code.
std::pair<double, double> by_hand(const std::string& name, const State& x) {
  const double v = x.qd[0], a = 0.7, b = 1.1, c = 1.5;
  const double exponential = std::exp(2.0 * v / 0.05);
  const double s = (exponential - 1.0) / (exponential + 1.0);  // tanh
  if (name == "armature") return {a * x.qdd[0], 0.0};
  if (name == "asymmetric_coulomb") return {v > 0 ? a * s : b * s, 0.0};
  if (name == "asymmetric_viscous") return {v > 0 ? a * v : b * v, 0.0};
  if (name == "cogging") return {a * std::sin(c * x.q[0]) + b * std::cos(c * x.q[0]), 0.0};
  if (name == "coulomb_friction") return {a * s, 0.0};
  if (name == "joint_spring") return {a * x.q[0] - a * b, 0.0};
  if (name == "load_friction")  // motoring a, braking half of it
    return {(sign_of(v) == sign_of(x.tau[0]) ? a : a * 0.5) * std::abs(x.tau[0]) * s, 0.0};
  if (name == "quadratic_friction") return {a * v * v * sign_of(v), 0.0};
  if (name == "session_offset" || name == "torque_offset") return {a, 0.0};
  if (name == "stribeck_friction") return {a * s / std::exp(v * v / (b * b)), 0.0};
  if (name == "sublinear_friction") return {a * s * std::pow(v * v, 0.25), 0.0};
  if (name == "torque_gain") return {a * x.tau[0], 0.0};
  if (name == "transmission_coupling") {  // 1.9: ratio
    const double w = v + 1.9 * x.qd[1], wd = x.qdd[0] + 1.9 * x.qdd[1];
    const double f = a * wd + b * w + c * std::tanh(w / 0.05);
    return {f, 1.9 * f};
  }
  if (name == "viscous_friction") return {a * v, 0.0};
  if (name == "warm_up") return {a * v / std::exp(2.0 / b), 0.0};  // the sample is at 2 s
  if (name == "cable_differential_friction") {
    // Lagrange: the shafts' dissipation is Σ F(w) dw/dq̇.
    double tau0 = 0.0, tau1 = 0.0;
    for (const double side : {1.0, -1.0}) {
      const double w = x.qd[0] + side * c * x.qd[1];
      const double f = a * std::tanh(w / 0.05) + b * w;
      tau0 += f;
      tau1 += f * side * c;
    }
    return {tau0, tau1};
  }
  if (name == "residual") {
    const BumpTable t = test::bump_table("", "");
    const auto spline = [](double u) {  // the two cubics on either side, as high as 1
      const double r = std::abs(u);
      return r < 1.0 ? 1.0 - 1.5 * r * r + 0.75 * r * r * r
                     : (r < 2.0 ? 0.25 * (2.0 - r) * (2.0 - r) * (2.0 - r) : 0.0);
    };
    double tau = 0.0;
    for (std::size_t k = 0; k < 3; ++k)
      tau += t.weights[k] * spline((x.q[0] - t.centres[2 * k]) / t.widths[2 * k]) *
             spline((x.qd[0] - t.centres[2 * k + 1]) / t.widths[2 * k + 1]);
    return {a * tau, 0.0};
  }
  // Nothing is commanded: a drive is off.
  if (name == "position_servo" || name == "supply_sag" || name == "integral_action" ||
      name == "feed_forward")
    return {0.0, 0.0};
  FAIL("no hand-written formula for " << name);
  return {};
}

}  // namespace

TEST_CASE("effects: each torque is the formula of the table", "[effects]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  const State x = random_state(seed);
  for (const EffectInfo& info : catalogue()) {
    if (info.port != Port::kJointTorque) continue;
    CAPTURE(info.name);
    const BoundEffect effect = bind(spec_of(info), arm());
    const std::vector<double> tau = torque(effect, x.sample());
    const auto [tau0, tau1] = by_hand(info.name, x);
    CHECK_THAT(tau[0], WithinAbs(tau0, kSameFormula));
    CHECK_THAT(tau[1], WithinAbs(tau1, kSameFormula));
    CHECK(tau[2] == 0.0);
  }
}

TEST_CASE("effects: Jet derivatives match central differences, in the parameters and the state",
          "[effects]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  const State x = random_state(seed);
  for (const EffectInfo& info : catalogue()) {
    if (info.port != Port::kJointTorque) continue;
    CAPTURE(info.name);
    const BoundEffect effect = bind(spec_of(info), arm());
    const int num_parameters = static_cast<int>(effect.parameters.size());
    // Directions 0 … p−1: the parameters; then q, q̇, q̈, τ of joint 0.
    for (int k = 0; k < num_parameters + 4; ++k) {
      CAPTURE(k);
      const auto moved = [&](double h) {
        BoundEffect e = effect;
        State y = x;
        if (k < num_parameters)
          e.parameters[k] += h;
        else
          *std::array{y.q, y.qd, y.qdd, y.tau}[k - num_parameters] += h;
        return torque(e, y.sample());
      };
      const double h = 1e-6;
      const std::vector<double> up = moved(h), down = moved(-h);

      JetD q[3], qd[3], qdd[3], tau[3], out[3];
      for (int i = 0; i < 3; ++i) {
        q[i] = JetD(x.q[i]), qd[i] = JetD(x.qd[i]), qdd[i] = JetD(x.qdd[i]),
        tau[i] = JetD(x.tau[i]);
        out[i] = JetD(0.0);
      }
      std::vector<JetD> p(effect.parameters.begin(), effect.parameters.end());
      (k < num_parameters ? p[k] : *std::array{q, qd, qdd, tau}[k - num_parameters]).v[0] = 1.0;
      add_torque(effect, JointSample<JetD>{2.0, 0, q, qd, qdd, tau}, p.data(), out);
      for (int i = 0; i < 3; ++i) {
        const double difference = (up[i] - down[i]) / (2.0 * h);
        CHECK_THAT(out[i].v[0],
                   WithinAbs(difference, kCentralDifferenceTol * (1.0 + std::abs(difference))));
      }
    }
  }
}

TEST_CASE("effects: derivatives at standstill are finite", "[effects]") {
  const JetD zero(0.0), velocity(0.0, 0);
  for (const EffectInfo& info : catalogue()) {
    if (info.port != Port::kJointTorque) continue;
    CAPTURE(info.name);
    const BoundEffect effect = bind(spec_of(info), arm());
    const JetD q[3] = {zero, zero, zero}, qd[3] = {velocity, zero, zero};
    const std::vector<JetD> p(effect.parameters.begin(), effect.parameters.end());
    JetD out[3] = {zero, zero, zero};
    add_torque(effect, JointSample<JetD>{0.0, 0, q, qd, q, q}, p.data(), out);
    CHECK(std::isfinite(out[0].a));
    CHECK(out[0].v.allFinite());
  }
}

TEST_CASE("effects: what reads the acceleration or the transmitted torque says so", "[effects]") {
  const State x = random_state(1);
  const double nothing[3] = {std::nan(""), std::nan(""), std::nan("")};
  for (const EffectInfo& info : catalogue()) {
    if (info.port != Port::kJointTorque) continue;
    CAPTURE(info.name);
    const BoundEffect effect = bind(spec_of(info), arm());
    // What a formula does not look at cannot make its torque NaN.
    const std::vector<double> tau = torque(effect, {2.0, 0, x.q, x.qd, nothing, nothing});
    const bool looked = !std::ranges::all_of(tau, [](double t) { return std::isfinite(t); });
    CHECK(reads_acceleration(effect) == (looked && info.name != "armature"));  // of the link tree
  }
}

TEST_CASE("effects: a torque depends on what its header says it reads", "[effects]") {
  const State x = random_state(1);
  for (const EffectInfo& info : catalogue()) {
    if (info.port != Port::kJointTorque || info.has(Trait::kReadsAcceleration) ||
        info.has(Trait::kReadsCommand) || info.has(Trait::kOfServo))
      continue;
    CAPTURE(info.name);
    const BoundEffect effect = bind(spec_of(info), arm());
    // NaN makes a torque NaN only where its formula looks at it.
    const double nothing[3] = {std::nan(""), std::nan(""), std::nan("")}, rest[3] = {0, 0, 0};
    const auto at = [&](const double* qd) {
      return torque(effect, {std::nan(""), 0, nothing, qd, nothing, nothing});
    };
    const auto finite = [](const std::vector<double>& tau) {
      return std::ranges::all_of(tau, [](double t) { return std::isfinite(t); });
    };
    CHECK((info.reads == Reads::kNothing) == finite(at(nothing)));
    CHECK((info.reads == Reads::kMotion) == !finite(at(x.qd)));
    if (info.reads != Reads::kSpeed && info.reads != Reads::kSpeedLinearly) continue;
    CHECK(at(rest) == std::vector<double>(3, 0.0));
    double twice[3];
    for (int j = 0; j < 3; ++j) twice[j] = -2.0 * x.qd[j];
    bool linear = true;
    for (std::size_t j = 0; j < 3; ++j)
      linear = linear && std::abs(at(twice)[j] + 2.0 * at(x.qd)[j]) <= kSameFormula;
    CHECK((info.reads == Reads::kSpeedLinearly) == linear);
  }
}

TEST_CASE("effects: linear columns times linear parameters are the torque", "[effects]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  const State x = random_state(seed);
  for (const EffectInfo& info : catalogue()) {
    if (info.port != Port::kJointTorque) continue;
    CAPTURE(info.name);
    const BoundEffect effect = bind(spec_of(info), arm());
    const std::vector<int> linear = effect.linear_parameters();
    CHECK(linear.size() + effect.shape_parameters().size() == effect.parameters.size());
    std::vector<double> columns(linear.size() * 3, 99.0), sum(3, 0.0);
    linear_columns(effect, x.sample(), columns.data());
    for (std::size_t k = 0; k < linear.size(); ++k)
      for (int j = 0; j < 3; ++j) sum[j] += columns[3 * k + j] * effect.parameters[linear[k]];
    const std::vector<double> tau = torque(effect, x.sample());
    for (int j = 0; j < 3; ++j) CHECK_THAT(sum[j], WithinAbs(tau[j], kSameFormula));
  }
}

TEST_CASE("effects: friction takes power from the motion, never gives it", "[effects]") {
  const unsigned seed = GENERATE(range(0u, 50u));
  CAPTURE(seed);
  const State x = random_state(seed);
  for (const EffectInfo& info : catalogue()) {
    const bool is_friction =
        info.name.find("friction") != std::string::npos || info.name.starts_with("asymmetric");
    if (!is_friction) continue;
    CAPTURE(info.name);
    const std::vector<double> tau = torque(bind(spec_of(info), arm()), x.sample());
    double power = 0.0;  // of the drive against the friction
    for (int j = 0; j < 3; ++j) power += tau[j] * x.qd[j];
    CHECK(power >= 0.0);
  }
}

TEST_CASE("effects: units and initial values are those of the joint's type", "[effects]") {
  const BoundEffect turning = bind({"coulomb_friction", "elbow", {}}, arm());
  CHECK(turning.joints == std::vector<int>{1});
  CHECK(turning.parameter_info[0].unit == "N*m");
  CHECK(turning.parameter_info[1].unit == "rad/s");
  CHECK(turning.parameters == std::vector<double>{0.0, 0.01});
  const BoundEffect sliding = bind({"coulomb_friction", "slide", {{"coulomb", 3.0, "N"}}}, arm());
  CHECK(sliding.parameter_info[0].unit == "N");
  CHECK(sliding.parameter_info[1].unit == "m/s");
  CHECK(sliding.parameters == std::vector<double>{3.0, 0.001});
  // What bind resolved reads back the same.
  const BoundEffect again = bind(to_spec(sliding), arm());
  CHECK(again.parameters == sliding.parameters);
  CHECK(again.where == "slide");
}

TEST_CASE("effects: bound at `all`, an effect shares its parameters over all joints", "[effects]") {
  const State x = random_state(3);
  const BoundEffect gain = bind({"torque_gain", "all", {{"gain_error", 0.1, "1"}}}, arm());
  const std::vector<double> tau = torque(gain, x.sample());
  for (int j = 0; j < 3; ++j) CHECK_THAT(tau[j], WithinAbs(0.1 * x.tau[j], kSameFormula));
  CHECK_THROWS_WITH(bind({"viscous_friction", "all", {}}, arm()),
                    ContainsSubstring("N*m*s/rad at one joint and in N*s/m at another"));
}

TEST_CASE("effects: joints may be named as places are, but for `all`", "[effects]") {
  const auto named = [](const std::string& name) {
    Model model = arm();
    model.links[moving_links(model)[0]].joint = name;
    return model;
  };
  for (const std::string name : {"base", "tip"})
    CHECK(bind({"coulomb_friction", name, {}}, named(name)).joints == std::vector<int>{0});
  CHECK(bind({"payload", "tip", {}}, named("tip")).joints ==
        bind({"payload", "tip", {}}, arm()).joints);
  CHECK_THROWS_WITH(bind({"coulomb_friction", "all", {}}, named("all")),
                    ContainsSubstring("a joint of the model is named 'all'"));
}

TEST_CASE("effects: a session offset acts in its own run alone", "[effects]") {
  const State x = random_state(0);
  const BoundEffect effect =
      bind({"session_offset", "elbow", {{"offset_7", 2.0, "N*m"}}}, arm(), {4, 9, 4});
  REQUIRE(effect.parameters == std::vector<double>{0.0, 2.0, 0.0});
  CHECK(effect.parameter_info[0].name == "offset_4");
  CHECK(effect.parameter_info[2].name == "offset_9");
  CHECK(torque(effect, x.sample(7)) == std::vector<double>{0.0, 2.0, 0.0});
  CHECK(torque(effect, x.sample(4)) == std::vector<double>{0.0, 0.0, 0.0});
  std::vector<double> columns(9);
  linear_columns(effect, x.sample(9), columns.data());
  CHECK(columns == std::vector<double>{0, 0, 0, 0, 0, 0, 0, 1, 0});
}

TEST_CASE("effects: a payload adds its ten parameters to the link that holds it", "[effects]") {
  EffectSpec spec{"payload", "tip", {}};
  for (const ParameterInfo& p : find_effect("payload").parameters)
    spec.parameters.push_back({p.name, 1.0 + static_cast<double>(spec.parameters.size()), p.unit});
  const BoundEffect tip = bind(spec, arm());
  CHECK(tip.joints == std::vector<int>{2});
  spec.where = "elbow";
  const BoundEffect elbow = bind(spec, arm());
  CHECK(elbow.joints == std::vector<int>{1});

  Tree<double> tree = make_tree(arm());
  add_to_tree(elbow, elbow.parameters.data(), tree);
  const Theta<double> theta = tree.links[1].inertia.theta();
  for (int i = 0; i < kThetaSize; ++i) CHECK(theta[i] == 1.0 + i);
  CHECK(tree.links[2].inertia.m == 0.0);
  double columns[30];
  CHECK_THROWS_WITH(linear_columns(elbow, random_state(0).sample(), columns),
                    ContainsSubstring("torque regressor"));
}

TEST_CASE("effects: a search starts at values that the parameter can take", "[effects]") {
  for (const EffectInfo& info : catalogue())
    for (const ParameterInfo& p : info.parameters) {
      CAPTURE(info.name, p.name);
      CHECK(p.unit.empty() == false);
      // Parameters of the ball's effects are linear about 0, and that may be far from where they
      // are.
      if (p.linear && !acts_on_ball(info)) CHECK(p.search.empty());
      for (const auto* values : {&p.search, &p.search_prismatic})
        for (const double v : *values) CHECK((v > 0.0 || p.sign == Sign::kFree));
      if (scale(p) == Scale::kLog) CHECK(p.initial > 0.0);
    }
  const BoundEffect sliding = bind({"stribeck_friction", "slide", {}}, arm());
  CHECK(sliding.parameter_info[1].search.front() ==
        0.002);  // [m/s], a tenth of the joint that turns
  const std::vector<double> grid = log_grid(1.0, 8.0, 4);
  REQUIRE(grid.size() == 4);
  for (int i = 0; i < 4; ++i) CHECK_THAT(grid[i], WithinAbs(1 << i, kSameFormula));
}

TEST_CASE("effects: what switches an effect on", "[effects]") {
  const auto amplitudes = [](const char* name) {
    return bind(spec_of(find_effect(name)), arm()).amplitude_parameters();
  };
  CHECK(amplitudes("stribeck_friction") == std::vector<int>{0});
  CHECK(amplitudes("encoder_offset") == std::vector<int>{0});
  CHECK(amplitudes("actuator_delay") == std::vector<int>{0});
  CHECK(amplitudes("joint_elasticity") == std::vector<int>{2});
  CHECK(amplitudes("saturation").empty());
  CHECK(amplitudes("presliding_lugre").empty());
}

TEST_CASE("effects: a cogging wave has the amplitude and phase of its sine and cosine",
          "[effects]") {
  const CoggingWave wave = cogging_wave(0.3, -0.4);
  for (const double angle : {0.0, 1.0, 4.0})
    CHECK_THAT(wave.amplitude * std::sin(angle + wave.phase),
               WithinAbs(0.3 * std::sin(angle) - 0.4 * std::cos(angle), kSameFormula));
}

TEST_CASE("effects: a wrong name is answered with the right ones", "[effects]") {
  const Model model = arm();
  CHECK_THROWS_WITH(
      find_effect("colomb_friction"),
      ContainsSubstring("did you mean 'coulomb_friction'?") &&
          ContainsSubstring("choices: actuator_delay, actuator_lag, armature, asymmetric_coulomb"));
  CHECK_THROWS_WITH(find_effect("zzz"), !ContainsSubstring("did you mean"));
  CHECK_THROWS_WITH(bind({"armature", "elbo", {}}, model),
                    ContainsSubstring("did you mean 'elbow'? choices: base_yaw, elbow, slide"));
  CHECK_THROWS_WITH(bind({"armature", "tip", {}}, model),
                    ContainsSubstring("expected a joint's name or `all`"));
  CHECK_THROWS_WITH(bind({"armature", "", {}}, model), ContainsSubstring("not said where"));
  CHECK_THROWS_WITH(bind({"armature", "elbow", {{"inertia", 1.0, ""}}}, model),
                    ContainsSubstring("no parameter 'inertia'; choices: armature"));
  CHECK_THROWS_WITH(bind({"armature", "elbow", {{"armature", 1.0, "kg"}}}, model),
                    ContainsSubstring("given in kg, expected kg*m^2"));
  CHECK_THROWS_WITH(bind({"armature", "elbow", {{"armature", -1.0, ""}}}, model),
                    ContainsSubstring("expected a number that is 0 or above"));
  CHECK_THROWS_WITH(
      bind({"joint_elasticity", "elbow", {{"friction_share", 1.5, ""}}}, model),
      ContainsSubstring("friction_share = 1.5, expected a number that is 0 or above, at most 1"));
  CHECK_THROWS_WITH(
      bind({"armature", "elbow", {{"armature", 1.0, ""}, {"armature", 1.0, ""}}}, model),
      ContainsSubstring("given twice"));
  for (const char* pair : {"elbow", "elbow,elbow", "elbow,slide,base_yaw"})
    CHECK_THROWS_AS(bind({"cable_differential_friction", pair, {}}, model), ModelError);
  CHECK(bind({"cable_differential_friction", "elbow, base_yaw", {}}, model).joints ==
        std::vector<int>{1, 0});
}

}  // namespace diffnea::effects_test
