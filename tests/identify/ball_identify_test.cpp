/// identify() of a ball on a string: what was put in comes out. The recordings come from equations
/// of their own (support/camera_ball.hpp).

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/identify.hpp>

#include "identify/passes.hpp"
#include "support/ball_fits.hpp"

namespace ball_identify_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool has_parameter(const IdentifyResult& result, const std::string& name) {
  return std::ranges::any_of(result.parameters,
                             [&](const ParameterEstimate& p) { return p.name == name; });
}

}  // namespace

TEST_CASE("identify a ball: length, attachment and drag where joints are prescribed", "[ball]") {
  const Model truth = test::swinging_arm();
  const IdentifyResult result =
      identify(nominal_arm(), {record_swing(truth, {.seed = 1, .drag = 0.08})},
               {record_swing(truth, {.seed = 2, .pace = 1.07, .drag = 0.08})});
  check_string(result, *truth.ball->string);
  const ParameterEstimate& drag = find(result, "ball.linear_drag.drag");
  CAPTURE(drag.value, drag.std);
  CHECK(std::abs(drag.value - 0.08) < kSigmas * drag.std);
  CHECK(drag.std < 0.02);  // [1/s]; a fit that knows nothing passes the line above
  CHECK(result.summary.converged);
  REQUIRE(result.ball.has_value());
  CHECK(result.ball->held_out);
  CHECK_THAT(result.ball->sigma, WithinRel(kNoise, 0.05));
  REQUIRE(result.errors.size() == 1);
  const JointError& e = result.errors.front();
  CHECK_THAT(e.train, WithinRel(kNoise, 0.05));
  CHECK_THAT(e.test, WithinRel(kNoise, 0.05));
  CHECK(e.nominal_test > 20.0 * kNoise);  // half the length: it cannot follow
  CHECK_THAT(result.model.ball->string->length, WithinAbs(0.40, 2e-3));
  REQUIRE(result.model.effects.size() == 1);
  CHECK(result.model.effects[0].effect == "linear_drag");
}

TEST_CASE("identify a ball: arm and ball in one result where torques are recorded", "[ball]") {
  const Model truth = test::swinging_arm();
  const SwingOptions one{.seed = 3}, two{.seed = 4, .pace = 1.07};
  Recording train = record_swing(truth, one), held_out = record_swing(truth, two);
  test::add_torque(truth, one, train);
  test::add_torque(truth, two, held_out);
  IdentifyOptions options;
  options.choice.effects = {"viscous_friction", "linear_drag"};
  const IdentifyResult result = identify(nominal_arm(), {train}, {held_out}, options);
  check_string(result, *truth.ball->string);
  for (const char* joint : {"joint0", "joint1", "joint2"}) {
    const ParameterEstimate& p = find(result, std::string(joint) + ".viscous_friction.viscous");
    CAPTURE(joint, p.value, p.std);
    CHECK_THAT(p.value, WithinRel(0.3, 0.05));
  }
  REQUIRE(result.errors.size() == 4);
  CHECK(result.errors.back().joint == "ball");
  CHECK(result.errors.front().unit == "N*m");
  // The ball's pull, 0.1 to 0.4 N·m of it, is no error of the arm: noise of 0.01 N·m is.
  for (std::size_t j = 0; j < 3; ++j) CHECK(result.errors[j].test < 0.015);
  CHECK_THAT(result.errors.back().test, WithinRel(kNoise, 0.05));
  CHECK(result.summary.converged);
  CHECK(has_parameter(result, "link2.mass"));
  // The model knows the recording as it came, whose torques hold the ball's pull.
  REQUIRE(result.model.posterior.has_value());
  CHECK(result.model.posterior->recordings == fingerprints(*recordings_in_memory(truth, {train})));
}

TEST_CASE("identify a ball: recordings that do not show it keep their torques", "[ball]") {
  const Model truth = test::swinging_arm();
  Model bare = truth;  // the ball is not there
  bare.ball->mass = 0.0;
  const SwingOptions one{.seed = 3}, two{.seed = 4, .pace = 1.07};
  Recording swing = record_swing(truth, one), excite = record_swing(truth, two);
  test::add_torque(truth, one, swing);
  test::add_torque(bare, two, excite);
  excite.ball.resize(0, 0);
  excite.source = "excite";
  IdentifyOptions options;
  options.choice.effects = {"viscous_friction", "linear_drag"};
  const IdentifyResult result = identify(nominal_arm(), {excite, swing}, {}, options);
  // Noise of 0.01 N·m; the ball's pull, left in one of them or both, is 0.1 to 0.4 N·m.
  for (std::size_t j = 0; j < 3; ++j) CHECK(result.errors[j].train < 0.015);
  CHECK(std::ranges::any_of(result.notes, [](const std::string& n) {
    return n.find("taken out of the torques, but not of") != std::string::npos &&
           n.find("excite") != std::string::npos;
  }));
}

TEST_CASE("identify a ball: a camera that the model calls early", "[ball]") {
  const Model truth = test::swinging_arm();
  const SwingOptions one{.seed = 3};
  Recording train = record_swing(truth, one);
  test::add_torque(truth, one, train);
  constexpr double kEarly = 0.02;  // [s]: row k shows where the ball is that much later
  const double dt = train.time[1] - train.time[0];
  const long shift = std::lround(kEarly / dt);
  REQUIRE(std::abs(static_cast<double>(shift) * dt - kEarly) < 1e-9);
  const long rows = train.rows() - shift;
  train.ball = RowMatX<double>(train.ball.bottomRows(rows));
  train.time.conservativeResize(rows);
  train.q.conservativeResize(rows, Eigen::NoChange);
  train.tau.conservativeResize(rows, Eigen::NoChange);
  Model nominal = nominal_arm();
  nominal.effects = {{"camera_delay", "camera", {{"delay", -kEarly, ""}}}};
  IdentifyOptions options;
  options.choice.effects = {"viscous_friction"};
  const IdentifyResult result = identify(nominal, {train}, {}, options);
  for (std::size_t j = 0; j < 3; ++j) CHECK(result.errors[j].train < 0.015);
  CHECK(std::abs(find(result, "camera.camera_delay.delay").value + kEarly) < 1e-3);
}

TEST_CASE("identify a ball: any length to begin with", "[ball]") {
  const Model truth = test::swinging_arm();
  const double length = GENERATE(0.2, 0.8);
  const IdentifyResult result =
      identify(nominal_arm(length), {record_swing(truth, {.seed = 5})}, {});
  CAPTURE(length);
  check_string(result, *truth.ball->string);
  CHECK(find(result, "string.length").prior == length);
}

TEST_CASE("identify a ball: what is held stays, and what is not known is said", "[ball]") {
  const Model truth = test::swinging_arm();
  const Recording r = record_swing(truth, {.seconds = 8, .seed = 6});
  IdentifyOptions options;
  SECTION("a length that is given") {
    options.choice.fix = {"string.length=0.401"};
    const IdentifyResult result = identify(nominal_arm(0.2), {r}, {}, options);
    const ParameterEstimate& p = find(result, "string.length");
    CHECK(p.fixed);
    CHECK(p.value == 0.401);
    CHECK(result.model.ball->string->length == 0.401);
    CHECK_THAT(find(result, "string.attachment_x").value, WithinAbs(0.28, 3e-3));
  }
  SECTION("no string among what may move") {
    options.choice.fit = {"effects"};
    const IdentifyResult result = identify(truth, {r}, {}, options);
    CHECK(find(result, "string.length").fixed);
    CHECK(result.model.ball->string->length == 0.40);
    CHECK_FALSE(find(result, "ball.linear_drag.drag").fixed);
  }
  SECTION("no effects") {
    options.choice.effects = std::vector<std::string>{};
    const IdentifyResult result = identify(nominal_arm(), {r}, {}, options);
    CHECK(result.parameters.size() == 4);
    CHECK(result.model.effects.empty());
  }
  SECTION("an effect that is none") {
    options.choice.effects = {"liner_drag"};
    CHECK_THROWS_WITH(identify(nominal_arm(), {r}, {}, options), ContainsSubstring("liner_drag"));
  }
  SECTION("an effect at a place that the ball has not") {
    options.choice.effects = {"linear_drag@elbow"};
    CHECK_THROWS_WITH(identify(nominal_arm(), {r}, {}, options), ContainsSubstring("elbow"));
  }
  SECTION("a parameter that is none") {
    const std::string name = GENERATE("string.lenght=0.4", "strng.length", "lnk1.*");
    CAPTURE(name);
    options.choice.fix = {"link1.*", name};  // one of the arm, which nothing fits, is one
    CHECK_THROWS_WITH(
        identify(nominal_arm(), {r}, {}, options),
        ContainsSubstring(name.substr(0, name.find('='))) && ContainsSubstring("string.length"));
  }
  SECTION("a pattern that begins anywhere") {
    options.choice.fix = {"*drag*"};
    const IdentifyResult result = identify(nominal_arm(), {r}, {}, options);
    CHECK(find(result, "ball.linear_drag.drag").fixed);
  }
  SECTION("a length that no string has") {
    options.choice.fix = {"string.length=-1"};
    CHECK_THROWS_WITH(identify(nominal_arm(), {r}, {}, options),
                      ContainsSubstring("string.length=-1") && ContainsSubstring("above 0"));
  }
}

TEST_CASE("identify a ball: patterns hold the ball's parameters where an arm is fitted, too",
          "[ball]") {
  const Model truth = test::swinging_arm();
  const SwingOptions o{.seconds = 8, .seed = 7};
  Recording r = record_swing(truth, o);
  test::add_torque(truth, o, r);
  IdentifyOptions options;
  options.choice.effects = {"viscous_friction", "linear_drag"};
  options.choice.fix = {"*drag*", "link0.*"};
  const IdentifyResult result = identify(nominal_arm(), {r}, {}, options);
  CHECK(find(result, "ball.linear_drag.drag").fixed);
  CHECK(find(result, "link0.mass").fixed);
  CHECK_FALSE(find(result, "string.length").fixed);
}

TEST_CASE("identify a ball: occlusions do not bias it", "[ball]") {
  const Model truth = test::swinging_arm();
  Recording r = record_swing(truth, {.seed = 8, .drag = 0.05});
  // 0.3 s of every 1.7 s, and every seventh row that is left.
  for (long k = 0; k < r.rows(); ++k)
    if (std::fmod(r.time[k], 1.7) < 0.3 || k % 14 == 0) r.ball.row(k).setConstant(kNaN);
  const IdentifyResult result = identify(nominal_arm(), {r}, {});
  check_string(result, *truth.ball->string);
  CHECK_THAT(find(result, "ball.linear_drag.drag").value,
             WithinAbs(0.05, kSigmas * find(result, "ball.linear_drag.drag").std));
  CHECK(result.ball->flagged.empty());
}

TEST_CASE("identify a ball: the constrained loss finds the string, with noise and without",
          "[ball]") {
  const Model truth = test::swinging_arm();
  const bool noisy = GENERATE(false, true);
  IdentifyOptions options;
  options.ball.loss = BallLoss::kConstrained;
  const Recording r =
      record_swing(truth, {.seed = 12, .noise = noisy ? kNoise : 0.0, .drag = 0.05});
  const IdentifyResult result = identify(nominal_arm(0.4), {r}, {}, options);
  CAPTURE(noisy, find(result, "string.length").value, find(result, "string.attachment_x").value,
          find(result, "string.attachment_y").value, find(result, "string.attachment_z").value,
          find(result, "ball.linear_drag.drag").value);
  // Without noise, quintics through nine rows leave 1e-5 m; with 1.5 mm standard errors are 0.2 mm.
  const double bound = noisy ? 8e-4 : 3e-5;
  CHECK_THAT(find(result, "string.length").value, WithinAbs(0.40, bound));
  CHECK_THAT(find(result, "string.attachment_x").value, WithinAbs(0.28, bound));
  CHECK_THAT(find(result, "string.attachment_y").value, WithinAbs(0.02, bound));
  CHECK_THAT(find(result, "string.attachment_z").value, WithinAbs(0.05, bound));
}

TEST_CASE("identify a ball: compliance of a string that is a spring", "[ball]") {
  const Model truth = test::swinging_arm();
  IdentifyOptions options;
  options.choice.effects = {"string_extension"};
  const IdentifyResult result =
      identify(nominal_arm(), {record_swing(truth, {.seed = 13, .pace = 1.3, .compliance = 0.02})},
               {}, options);
  const ParameterEstimate& c = find(result, "string.string_extension.compliance");
  CAPTURE(c.value, c.std, find(result, "string.length").value);
  CHECK(c.std < 0.001);
  CHECK_THAT(c.value, WithinRel(0.02, 0.1));
  CHECK_THAT(find(result, "string.length").value, WithinAbs(0.40, 1e-3));
}

TEST_CASE("identify a ball: a camera that is very late", "[ball]") {
  const Model truth = test::swinging_arm();
  Recording r = record_swing(truth, {.seed = 14});
  constexpr long kLate = 30;  // rows of 5 ms: 0.15 s, a third of the swing's time constant
  for (long k = r.rows() - 1; k >= 0; --k)
    k < kLate ? r.ball.row(k).setConstant(kNaN) : r.ball.row(k) = r.ball.row(k - kLate).eval();
  IdentifyOptions options;
  options.choice.effects = {"camera_delay"};
  const IdentifyResult result = identify(nominal_arm(), {r}, {}, options);
  const ParameterEstimate& delay = find(result, "camera.camera_delay.delay");
  CAPTURE(delay.value, delay.std);
  CHECK(delay.std < 1e-3);
  CHECK_THAT(delay.value, WithinAbs(0.15, kSigmas * delay.std));
  check_string(result, *truth.ball->string);
  CHECK_THAT(result.errors.front().train, WithinRel(kNoise, 0.05));
}

}  // namespace ball_identify_test
