/// An arm of three joints that MuJoCo moves, identified first and then diagnosed, as a user does:
/// a spring that carries a weight.

#include <algorithm>
#include <support/mujoco_arm.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/identify/identify.hpp>

#include "diagnose/evidence.hpp"

namespace diffnea::own_arm_test {
namespace {

constexpr const char* kArm = R"(<mujoco model="own">
  <compiler angle="radian"/>
  <worldbody>
    <body name="turret" pos="0 0 0.3">
      <joint name="waist" axis="0 0 1" range="-2.8 2.8" limited="true"/>
      <inertial pos="0 0 0.05" mass="5" diaginertia="0.03 0.03 0.025"/>
      <body name="upper" pos="0 0 0.12">
        <joint name="shoulder" axis="0 1 0" range="-1.8 1.8" limited="true"/>
        <inertial pos="0.005 0 0.16" mass="3.2" diaginertia="0.035 0.035 0.006"/>
        <body name="fore" pos="0 0 0.35">
          <joint name="elbow" axis="0 1 0" range="-2.3 2.3" limited="true"/>
          <inertial pos="0.004 0 0.14" mass="1.8" diaginertia="0.015 0.015 0.002"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="waist" ctrlrange="-40 40" ctrllimited="true"/>
    <motor joint="shoulder" ctrlrange="-60 60" ctrllimited="true"/>
    <motor joint="elbow" ctrlrange="-30 30" ctrllimited="true"/>
  </actuator>
</mujoco>)";

const test::MujocoArm& arm() {
  static const test::MujocoArm kOne(kArm);
  return kOne;
}

std::vector<EffectSpec> friction() {
  std::vector<EffectSpec> out;
  for (const auto& [joint, coulomb] : {std::pair{"waist", 0.5}, {"shoulder", 0.7}, {"elbow", 0.35}})
    for (const EffectSpec& e : {EffectSpec{"viscous_friction", joint, {{"viscous", 0.4, ""}}},
                                EffectSpec{"coulomb_friction", joint, {{"coulomb", coulomb, ""}}}})
      out.push_back(e);
  return out;
}

struct Case {
  IdentifyResult fit;
  Finding finding;
};

Case examine(const std::vector<EffectSpec>& hidden, unsigned seed) {
  const std::vector<Recording> train{arm().recorded(hidden, seed)};
  const std::vector<Recording> test{arm().recorded(hidden, seed + 50)};
  Case out{identify(arm().nominal, train, test), {}};
  out.finding = diagnose(out.fit.model, train, test);
  return out;
}

}  // namespace

TEST_CASE("diagnose: a spring that carries more than its joint is measured to", "[diagnose]") {
  const unsigned seed = GENERATE(1u, 2u);
  std::vector<EffectSpec> hidden = friction();
  hidden.push_back({"joint_spring", "elbow", {{"stiffness", 4.0, ""}, {"rest", 0.3, ""}}});
  const Case c = examine(hidden, seed);
  CAPTURE(seed, c.finding.sentence);
  // No body does what this spring does: the fit leaves much of the joint's torque.
  CHECK(c.fit.errors.at(2).test > 0.3 * c.fit.errors.at(2).torque_rms);
  CHECK(c.finding.verdict == Verdict::kNamed);
  REQUIRE(c.finding.causes.size() == 1);
  const Cause& spring = c.finding.causes.front();
  CHECK(spring.effect == "joint_spring");
  CHECK(spring.where == "elbow");
  CHECK(std::abs(spring.parameters.at(0).value - 4.0) < 0.1);
  // Turns of all joints are left beside it: 1.2 and 2.2 % observed.
  CHECK(c.finding.joints.at(2).extended < 0.03 * c.finding.joints.at(2).torque_rms);
}

TEST_CASE("diagnose: turns are kept where too few rows are left between them", "[diagnose]") {
  Model base = arm().nominal;
  base.effects = friction();
  for (EffectSpec& e : base.effects) e.parameters.resize(1);
  const std::vector<Recording> train{arm().recorded(friction(), 3)};
  FitChoice choice;
  choice.effects = std::vector<std::string>{};
  const FitLayout layout = make_layout(base, choice, {0});
  const auto joints_without_their_turns = [&](double hz) {
    PreprocessOptions options;
    options.decimate_to_hz = hz;
    const PreprocessPlan plan = plan_preprocess(train, options);
    return Evidence(base, {base}, layout, *recordings_in_memory(base, train), plan, 0.0, {})
        .sticking()
        .size();
  };
  // Joints stop and turn. Of few rows a second, those between turns are fewer than four a column.
  CHECK(joints_without_their_turns(4.0) == 0);
  CHECK(joints_without_their_turns(25.0) > 0);
}

}  // namespace diffnea::own_arm_test
