/// Robots whose limbs have no part in each other's motion: each limb is fitted, and diagnosed, as a
/// robot of its own.

#include "identify/limb_robots.hpp"

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/diagnose/diagnose.hpp>

#include "support/servo_bench.hpp"

namespace diffnea::limb_robots_test {
namespace {

using Catch::Matchers::ContainsSubstring;

/// Two pendulums on servos, on one stand; one is heavier, and held by a spring.
const std::array<test::SprungServo, 2> kServos{
    {{}, {.mass = 0.8, .stiffness = 8.0, .spring = 0.6, .rate = 1.6}}};
const std::array<std::string, 2> kJoints{"left", "right"};

Model alone(std::size_t k) {
  Model out = test::servo_bench(kServos[k].mass, kServos[k].length, kServos[k].inertia);
  out.links[1].name = kJoints[k] + "_arm";
  out.links[1].joint = kJoints[k];
  return out;
}

Model robot() {
  Model out = alone(0);
  out.links.push_back(alone(1).links[1]);
  return out;
}

Recording log_of(std::size_t k) {
  Recording r = kServos[k].record(6.0);
  r.joint_names = {kJoints[k]};
  return r;
}

Recording log_of_both() {
  Recording out = log_of(0);
  const Recording right = log_of(1);
  out.joint_names = {kJoints[0], kJoints[1]};
  out.has_tau = {false, false};
  for (auto member : {&Recording::q, &Recording::qcmd, &Recording::tau}) {
    RowMatX<double>& m = out.*member;
    m.conservativeResize(Eigen::NoChange, 2);
    m.col(1) = (right.*member).col(0);
  }
  return out;
}

}  // namespace

TEST_CASE("limbs: a servo beside another is fitted as it is alone", "[identify]") {
  IdentifyOptions options;
  options.choice.fix = {"left.torque_offset.*"};  // a limb has it, the other not
  const IdentifyResult both = identify(robot(), {log_of_both()}, {}, options);
  REQUIRE(both.errors.size() == 2);
  REQUIRE(both.model.posterior);
  std::size_t told = 0;
  for (const std::size_t k : {0, 1}) {
    CAPTURE(kJoints[k]);
    if (k == 1) options.choice.fix.clear();
    const IdentifyResult one = identify(alone(k), {log_of(k)}, {}, options);
    CHECK(both.errors[k].joint == kJoints[k]);
    CHECK(both.errors[k].train == one.errors[0].train);
    for (const ParameterEstimate& p : one.parameters) {
      CAPTURE(p.name);
      const auto same = std::ranges::find(both.parameters, p.name, &ParameterEstimate::name);
      REQUIRE(same != both.parameters.end());
      CHECK(same->value == p.value);
      CHECK((same->std == p.std || std::isnan(p.std)));
      CHECK(same->fixed == p.fixed);
    }
    // The model has what the fit found, the posterior a block for each.
    for (const EffectSpec& e : one.model.effects) {
      const auto there = std::ranges::find_if(both.model.effects, [&](const EffectSpec& s) {
        return s.effect == e.effect && s.where == e.where;
      });
      REQUIRE(there != both.model.effects.end());
      for (std::size_t i = 0; i < e.parameters.size(); ++i)
        CHECK(there->parameters[i].value == e.parameters[i].value);
    }
    const Posterior &of_one = *one.model.posterior, &of_both = *both.model.posterior;
    const std::size_t n = of_one.names.size(), m = of_both.names.size();
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) {
        CHECK(of_both.names[told + i] == of_one.names[i]);
        CHECK(of_both.information[(told + i) * m + told + j] == of_one.information[i * n + j]);
      }
    told += n;
  }
  CHECK(told == both.model.posterior->names.size());
}

TEST_CASE("limbs: what the robot held hangs on one of them", "[identify]") {
  const auto held = GENERATE(as<std::string>{}, "tip", "right", "left");
  Recording log = log_of_both();
  log.info.payload = HeldBody{"weight", held, 0.2, std::array{0.0, 0.0, -0.1},
                              std::array{0.0, 0.0, 0.0, 0.0, 0.0, 0.0}};
  const IdentifyResult both = identify(robot(), {log}, {});
  const std::size_t of = held == "left" ? 0 : 1;  // the tip is the last link
  for (const std::size_t k : {0, 1}) {
    Recording own = log_of(k);
    if (k == of) {
      own.info.payload = log.info.payload;
      own.info.payload->where = kJoints[k];
    }
    const IdentifyResult one = identify(alone(k), {own}, {});
    CAPTURE(held, kJoints[k]);
    CHECK(test::estimate(both, kJoints[k] + ".position_servo.stiffness").value ==
          test::estimate(one, kJoints[k] + ".position_servo.stiffness").value);
  }
}

TEST_CASE("limbs: a choice that no limb has is refused, an unmoved limb goes with another",
          "[identify]") {
  IdentifyOptions options;
  options.choice.fix = {"middle.*"};
  CHECK_THROWS_WITH(identify(robot(), {log_of_both()}, {}, options),
                    ContainsSubstring("no parameter matches 'middle.*'"));
  options.choice.fix.clear();
  Recording still = log_of_both();
  still.q.col(1).setZero();
  still.qcmd.col(1).setZero();
  const IdentifyResult fit = identify(robot(), {still}, {}, options);
  CHECK(fit.errors.size() == 2);
  CHECK(test::estimate(fit, "left.position_servo.stiffness").value > 0.0);
  CHECK(std::ranges::any_of(fit.notes, [](const std::string& note) {
    return note.find("right") != note.npos && note.find("never moves") != note.npos;
  }));
}

TEST_CASE("limbs: what one lacks is named there, with its own size", "[diagnose]") {
  DiagnoseOptions options;
  options.effects = {"joint_spring", "quadratic_friction"};
  const Finding both = diagnose(robot(), {log_of_both()}, {}, options);
  REQUIRE(both.causes.size() == 1);
  CHECK(both.causes[0].effect == "joint_spring");
  CHECK(both.causes[0].where == "right");
  CHECK(both.causes[0].share == 1.0);
  CHECK(both.candidates.size() + both.absorbed.size() == 4);
  CHECK(both.joints.size() == 2);
  const Finding one = diagnose(alone(1), {log_of(1)}, {}, options);
  REQUIRE(one.causes.size() == 1);
  CHECK(both.causes[0].parameters[0].value == one.causes[0].parameters[0].value);
  CHECK(both.causes[0].delta_bic == one.causes[0].delta_bic);
  // Held-out errors of the other servo stay.
  CHECK(both.gain.before < one.gain.before);
  CHECK(both.gain.before > one.gain.before / 2.0);

  // Two joints lack a spring each: of both limbs' causes those that are lacked most stay.
  Recording sprung = log_of_both();
  test::SprungServo left = kServos[0];
  left.spring = 0.3;
  sprung.q.col(0) = left.record(6.0).q.col(0);
  options.effects = {"joint_spring@right", "joint_spring@left"};
  const Finding two = diagnose(robot(), {sprung}, {}, options);
  REQUIRE(two.causes.size() == 2);
  options.max_causes = 1;
  const Finding most = diagnose(robot(), {sprung}, {}, options);
  REQUIRE(most.causes.size() == 1);
  CHECK(most.causes[0].where == two.causes[0].where);  // the first of the sorted
  options.max_causes = 0;
  options.effects = {"joint_spring@middle"};
  CHECK_THROWS_WITH(diagnose(robot(), {log_of_both()}, {}, options), ContainsSubstring("middle"));
}

}  // namespace diffnea::limb_robots_test
