/// Parameters that no column stands for: a spring's rest, which may lie on either side of zero, and
/// the tilt of the base, whose torque is its product with what the links weigh.

#include <algorithm>
#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/excite/fourier.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/record.hpp>

#include "support/found.hpp"

namespace shapes_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using diffnea::test::find;

namespace {

/// One draw of noise, fixed: three standard errors leave out 1 in 370.
constexpr double kInterval = 3.0;

Model wam(std::vector<EffectSpec> more) {
  Model m = read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml");
  m.effects = {{"viscous_friction", "all", {{"viscous", 1.5, ""}}}};
  m.effects.insert(m.effects.end(), more.begin(), more.end());
  return m;
}

EffectSpec spring(double stiffness, double rest) {
  return {"joint_spring", "joint2", {{"stiffness", stiffness, ""}, {"rest", rest, ""}}};
}
EffectSpec tilt(double x, double y) {
  return {"base_tilt", "base", {{"gravity_x", x, ""}, {"gravity_y", y, ""}}};
}

Recording recorded(const Model& robot, unsigned seed = 3, double seconds = 20.0) {
  const Model controller = wam({});
  FourierOptions motion;
  motion.duration = seconds;
  motion.seed = seed;
  RecordOptions options;
  options.seed = seed;
  SimulatedRecording r =
      record_model(robot, controller, random_fourier(controller, motion), options);
  REQUIRE(r.failure.empty());
  return r.recording;
}

IdentifyOptions with(std::vector<std::string> fit, std::vector<std::string> effects) {
  IdentifyOptions options;
  options.choice.fit = std::move(fit);
  options.choice.effects = std::move(effects);
  return options;
}

void check_found(const IdentifyResult& result, const std::string& name, double truth,
                 double known) {
  const ParameterEstimate& p = find(result, name);
  CAPTURE(p.name, p.value, p.std, truth);
  REQUIRE(p.identifiable);
  CHECK_FALSE(p.fixed);
  CHECK(p.std < known);
  CHECK(std::abs(p.value - truth) < kInterval * p.std);
}

}  // namespace

TEST_CASE("identify: a spring's rest is found on the other side of zero", "[identify]") {
  const Recording data = recorded(wam({spring(25.0, 0.4)}));
  const Model start = wam({spring(10.0, -0.3)});
  const IdentifyResult result =
      identify(start, {data}, {}, with({"inertia", "effects", "shapes"}, {}));
  check_found(result, "joint2.joint_spring.rest", 0.4, 0.05);
  check_found(result, "joint2.joint_spring.stiffness", 25.0, 2.5);
  const IdentifyResult held = identify(start, {data}, {}, with({"inertia", "effects"}, {}));
  CHECK(find(held, "joint2.joint_spring.rest").value == -0.3);
  CHECK(result.errors[1].train < 0.5 * held.errors[1].train);
}

TEST_CASE("identify: a rest that an offset of the torque absorbs is not told", "[identify]") {
  const IdentifyResult result =
      identify(wam({spring(25.0, 0.0)}), {recorded(wam({spring(25.0, 0.4)}))}, {},
               with({"inertia", "effects", "shapes"}, {"torque_offset@joint2"}));
  CHECK_FALSE(find(result, "joint2.joint_spring.rest").identifiable);
  CHECK_FALSE(find(result, "joint2.torque_offset.offset").identifiable);
}

TEST_CASE("identify: the tilt of the base is found with the inertias", "[identify]") {
  const Model tilted = wam({tilt(0.5, -0.3)});
  const Recording data = recorded(tilted), held_out = recorded(tilted, 4);
  const IdentifyResult result =
      identify(wam({}), {data}, {held_out}, with({"inertia", "effects"}, {"base_tilt"}));
  check_found(result, "base.base_tilt.gravity_x", 0.5, 0.1);
  check_found(result, "base.base_tilt.gravity_y", -0.3, 0.1);
  const IdentifyResult level =
      identify(wam({}), {data}, {held_out}, with({"inertia", "effects"}, {}));
  // Joint 1 turns about the vertical: on a level base nothing that it carries weighs on it.
  CHECK(result.errors[0].test < 0.5 * level.errors[0].test);

  SECTION("a model that has a tilt keeps it, or is fitted on") {
    const auto of_model = with({"inertia", "effects"}, {});
    check_found(identify(result.model, {held_out}, {}, of_model), "base.base_tilt.gravity_x", 0.5,
                0.1);
    IdentifyOptions held = of_model;
    held.choice.fix = {"base.base_tilt.*"};
    const IdentifyResult fit = identify(tilted, {data}, {}, held);
    CHECK(find(fit, "base.base_tilt.gravity_y").value == -0.3);
    CHECK(find(fit, "base.base_tilt.gravity_y").fixed);
    CHECK(fit.errors[0].train < 1.05 * result.errors[0].train);
  }
  SECTION("the forward loss finds it too") {
    IdentifyOptions forward = with({"inertia", "effects"}, {"base_tilt"});
    forward.loss = Loss::kForward;
    check_found(identify(wam({}), {data}, {}, forward), "base.base_tilt.gravity_x", 0.5, 0.2);
  }
}

TEST_CASE("identify: a base that tilted between two recordings", "[identify]") {
  const IdentifyResult result =
      identify(wam({}), {recorded(wam({})), recorded(wam({tilt(0.4, 0.2)}), 5)}, {},
               with({"inertia", "effects"}, {"base_tilt@base:run=1"}));
  check_found(result, "base:run=1.base_tilt.gravity_x", 0.4, 0.1);
  check_found(result, "base:run=1.base_tilt.gravity_y", 0.2, 0.1);
}

TEST_CASE("identify: the motion loss holds a tilt, and says so where it cannot", "[identify]") {
  const Recording data = recorded(wam({tilt(0.5, -0.3)}), 3, 5.0);
  IdentifyOptions options = with({"effects"}, {});
  options.loss = Loss::kMotion;
  options.motion.horizon = 0.5;
  CHECK_THROWS_WITH(
      identify(wam({tilt(0.5, -0.3)}), {data}, {}, options),
      ContainsSubstring("does not fit base.base_tilt.gravity_x") && ContainsSubstring("--fix"));
  options.choice.fix = {"base.base_tilt.*"};
  const IdentifyResult tilted = identify(wam({tilt(0.5, -0.3)}), {data}, {}, options);
  options.choice.fix.clear();
  const IdentifyResult level = identify(wam({}), {data}, {}, options);
  CHECK(tilted.errors[0].train < 0.5 * level.errors[0].train);
}

}  // namespace shapes_test
