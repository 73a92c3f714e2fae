/// identify() of a ball: what was put in comes out, and what cannot be true is flagged. The
/// recordings come from equations of their own (support/camera_ball.hpp).

#include <algorithm>
#include <cmath>
#include <limits>
#include <support/camera_ball.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/identify.hpp>

#include "identify/passes.hpp"

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using test::FlightsOptions;
using test::record_flights;
using test::record_swing;
using test::SwingOptions;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kNoise = 1.5e-3;  // of the camera [m]
/// Standard errors that an estimate may be off by: 4 of 40 checked numbers happens once in 400.
constexpr double kSigmas = 4.0;
/// What the joints' filter leaves of the hand's motion [m]; 0.1 mm on the length (observed).
constexpr double kHand = 2e-4;

const ParameterEstimate& parameter(const IdentifyResult& result, const std::string& name) {
  const auto at =
      std::ranges::find(result.parameters, name, [](const ParameterEstimate& p) { return p.name; });
  if (at == result.parameters.end()) throw Error("the result has no parameter " + name);
  return *at;
}
bool has_parameter(const IdentifyResult& result, const std::string& name) {
  return std::ranges::any_of(result.parameters,
                             [&](const ParameterEstimate& p) { return p.name == name; });
}
void check_string(const IdentifyResult& result, const StringSpec& truth) {
  const auto check = [&](const std::string& name, double expected) {
    const ParameterEstimate& p = parameter(result, name);
    CAPTURE(name, p.value, expected, p.std);
    CHECK(p.identifiable);
    CHECK(std::abs(p.value - expected) < kSigmas * p.std + kHand);
    CHECK(std::abs(p.value - expected) < 2e-3);
  };
  check("string.length", truth.length);
  check("string.attachment_x", truth.p_LS.x);
  check("string.attachment_y", truth.p_LS.y);
  check("string.attachment_z", truth.p_LS.z);
}

/// The arm before the fit: another length, tied elsewhere.
Model nominal_arm(double length = 0.2) {
  Model model = test::swinging_arm();
  model.ball->string->length = length;
  model.ball->string->p_LS = {0.25, 0.0, 0.08};
  return model;
}

bool flagged_near(const IdentifyResult& result, double time, double within = 0.006) {
  return std::ranges::any_of(result.ball->flagged, [&](const BallFlag& f) {
    return f.channel == "ball" && std::abs(f.time - time) < within;
  });
}

}  // namespace

TEST_CASE("identify a ball: length, attachment and drag where joints are prescribed", "[ball]") {
  const Model truth = test::swinging_arm();
  const IdentifyResult result =
      identify(nominal_arm(), {record_swing(truth, {.seed = 1, .drag = 0.08})},
               {record_swing(truth, {.seed = 2, .pace = 1.07, .drag = 0.08})});
  check_string(result, *truth.ball->string);
  const ParameterEstimate& drag = parameter(result, "ball.linear_drag.drag");
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
    const ParameterEstimate& p =
        parameter(result, std::string(joint) + ".viscous_friction.viscous");
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
  CHECK(std::abs(parameter(result, "camera.camera_delay.delay").value + kEarly) < 1e-3);
}

TEST_CASE("identify a ball: any length to begin with", "[ball]") {
  const Model truth = test::swinging_arm();
  const double length = GENERATE(0.2, 0.8);
  const IdentifyResult result =
      identify(nominal_arm(length), {record_swing(truth, {.seed = 5})}, {});
  CAPTURE(length);
  check_string(result, *truth.ball->string);
  CHECK(parameter(result, "string.length").prior == length);
}

TEST_CASE("identify a ball: what is held stays, and what is not known is said", "[ball]") {
  const Model truth = test::swinging_arm();
  const Recording r = record_swing(truth, {.seconds = 8, .seed = 6});
  IdentifyOptions options;
  SECTION("a length that is given") {
    options.choice.fix = {"string.length=0.401"};
    const IdentifyResult result = identify(nominal_arm(0.2), {r}, {}, options);
    const ParameterEstimate& p = parameter(result, "string.length");
    CHECK(p.fixed);
    CHECK(p.value == 0.401);
    CHECK(result.model.ball->string->length == 0.401);
    CHECK_THAT(parameter(result, "string.attachment_x").value, WithinAbs(0.28, 3e-3));
  }
  SECTION("no string among what may move") {
    options.choice.fit = {"effects"};
    const IdentifyResult result = identify(truth, {r}, {}, options);
    CHECK(parameter(result, "string.length").fixed);
    CHECK(result.model.ball->string->length == 0.40);
    CHECK_FALSE(parameter(result, "ball.linear_drag.drag").fixed);
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
    CHECK(parameter(result, "ball.linear_drag.drag").fixed);
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
  CHECK(parameter(result, "ball.linear_drag.drag").fixed);
  CHECK(parameter(result, "link0.mass").fixed);
  CHECK_FALSE(parameter(result, "string.length").fixed);
}

TEST_CASE("identify a ball: occlusions do not bias it", "[ball]") {
  const Model truth = test::swinging_arm();
  Recording r = record_swing(truth, {.seed = 8, .drag = 0.05});
  // 0.3 s of every 1.7 s, and every seventh row that is left.
  for (long k = 0; k < r.rows(); ++k)
    if (std::fmod(r.time[k], 1.7) < 0.3 || k % 14 == 0) r.ball.row(k).setConstant(kNaN);
  const IdentifyResult result = identify(nominal_arm(), {r}, {});
  check_string(result, *truth.ball->string);
  CHECK_THAT(parameter(result, "ball.linear_drag.drag").value,
             WithinAbs(0.05, kSigmas * parameter(result, "ball.linear_drag.drag").std));
  CHECK(result.ball->flagged.empty());
}

TEST_CASE("identify a ball: rows off any path are flagged with their times, and not fitted",
          "[ball]") {
  const Model truth = test::swinging_arm();
  const Recording clean = record_swing(truth, {.seed = 9});
  Recording r = clean;
  std::vector<long> bad;
  for (const long first : {300, 900, 1500, 2100, 2700}) bad.push_back(first);  // single rows
  for (const long first : {600, 1200, 1800})
    for (long k = 0; k < 3; ++k) bad.push_back(first + 2 * k);  // three on end
  for (const long k : bad) r.ball(k, k % 3) += 0.3;
  const IdentifyResult result = identify(nominal_arm(), {r}, {}),
                       without = identify(nominal_arm(), {clean}, {});
  check_string(result, *truth.ball->string);
  for (const long k : bad) {
    CAPTURE(k, r.time[k]);
    CHECK(flagged_near(result, r.time[k]));
    CHECK(std::ranges::none_of(result.ball->time, [&](double t) { return t == r.time[k]; }));
  }
  // Neighbours of a burst may go with it, no more.
  CHECK(result.ball->flagged.size() <= bad.size() + 6);
  CHECK_THAT(result.ball->sigma, WithinRel(without.ball->sigma, 0.05));
  CHECK_THAT(parameter(result, "string.length").value,
             WithinAbs(parameter(without, "string.length").value, 1e-4));
  CHECK(std::ranges::any_of(result.notes, [](const std::string& n) {
    return n.find("flagged") != std::string::npos && n.starts_with(kWarning);
  }));
}

TEST_CASE("identify a ball: the raw held-out error counts rows that the path contradicts",
          "[ball]") {
  const Model truth = test::swinging_arm();
  Recording held_out = record_swing(truth, {.seed = 22, .pace = 1.07});
  // Twelve rows on end 30 mm aside: their neighbours agree with them, the path does not.
  constexpr double kAside = 0.03;
  long aside = 0, seen = 0;
  for (long k = 0; k < held_out.rows(); k += 2, ++seen)
    if (k % 800 >= 400 && k % 800 < 424) held_out.ball(k, 0) += kAside, ++aside;
  const IdentifyResult result =
      identify(nominal_arm(), {record_swing(truth, {.seed = 21})}, {held_out});
  const JointError& e = result.errors.front();
  CAPTURE(e.test, e.test_raw, aside, seen);
  CHECK_THAT(e.test, WithinRel(kNoise, 0.05));
  // Share of the rows, one of three axes; the windows' states give way to them by some percent.
  const double expected = std::hypot(
      kNoise, kAside * std::sqrt(static_cast<double>(aside) / (3.0 * static_cast<double>(seen))));
  CHECK_THAT(e.test_raw, WithinRel(expected, 0.1));
}

TEST_CASE("identify a ball: rows beyond the reach of a string that is held are flagged", "[ball]") {
  const Model truth = test::swinging_arm();
  const Recording r = record_swing(truth, {.seconds = 8, .seed = 10});
  IdentifyOptions options;
  options.choice.fix = {"string.length=0.3", "string.attachment_*"};
  const IdentifyResult result = identify(truth, {r}, {}, options);
  const auto beyond = std::ranges::count_if(result.ball->flagged, [](const BallFlag& f) {
    return f.reason.find("further from the anchor") != std::string::npos;
  });
  CAPTURE(result.ball->sigma, result.ball->rows());
  CHECK(beyond > result.ball->rows() / 2);
  for (const BallFlag& f : result.ball->flagged) {
    CHECK(f.time >= 0.0);
    CHECK(f.time <= 8.0);
  }
  // One that is longer than the data show is never taut: none is beyond it, and the error says so.
  options.choice.fix[0] = "string.length=0.5";
  const IdentifyResult longer = identify(truth, {r}, {}, options);
  CHECK(longer.errors.front().train > 3.0 * kNoise);
  // The noise is the camera's, however bad the fit.
  CHECK_THAT(result.ball->sigma, WithinRel(kNoise, 0.05));
  CHECK_THAT(longer.ball->sigma, WithinRel(kNoise, 0.05));
}

TEST_CASE("identify a ball: one that is never taut is refused, with its largest distance",
          "[ball]") {
  const Model truth = test::swinging_arm();
  Recording r = record_swing(truth, {.seconds = 6, .seed = 11});
  // Lies on a table, or is led about; the hand moves above it.
  const bool lies = GENERATE(true, false);
  double largest = 0.0;
  Rng rng(4);
  for (long k = 0; k < r.rows(); k += 2) {
    const double turn = lies ? 0.0 : 2.0 * r.time[k];
    const Vec3<double> x{0.7 + 0.1 * std::sin(turn), 0.1 * std::cos(turn), 0.7};
    const Vec3<double> d = test::anchor_at(truth.ball->string->p_LS, r.time[k], {}) - x;
    r.ball.row(k) << x.x + kNoise * rng.normal(), x.y + kNoise * rng.normal(),
        x.z + kNoise * rng.normal();
    largest = std::max(largest, std::sqrt(dot(d, d)));
  }
  CAPTURE(lies, largest);
  CHECK_THROWS_WITH(identify(truth, {r}, {}),
                    ContainsSubstring("nowhere taut") && ContainsSubstring("the largest is"));
}

TEST_CASE("identify a ball: drag and lift of one in flight, without any joint", "[ball]") {
  IdentifyOptions options;
  options.choice.effects = {"quadratic_drag", "magnus"};
  // C_M ρ A r/m of a table tennis ball
  const double per_unit = 1.2 * M_PI * std::pow(0.02, 3) / 2.7e-3;
  const FlightsOptions o{.lift = 0.3 * per_unit, .seed = 1};
  FlightsOptions other = o;
  other.seed = 2;
  const IdentifyResult result =
      identify(test::flying_ball(), {record_flights(o)}, {record_flights(other)}, options);
  const ParameterEstimate &drag = parameter(result, "ball.quadratic_drag.drag"),
                          &lift = parameter(result, "ball.magnus.magnus");
  CAPTURE(drag.value, drag.std, lift.value, lift.std);
  CHECK(std::abs(drag.value - o.drag) < kSigmas * drag.std);
  CHECK(std::abs(lift.value - 0.3) < kSigmas * lift.std);
  CHECK(drag.std < 0.01);
  CHECK(lift.std < 0.01);
  CHECK_THAT(result.errors.front().test, WithinRel(kNoise, 0.06));
  CHECK(result.ball->flagged.empty());
  CHECK_FALSE(result.ball->has_string);
}

TEST_CASE("identify a ball: spins of the wrong sign are flagged, and lift is right", "[ball]") {
  IdentifyOptions options;
  options.choice.effects = {"quadratic_drag", "magnus"};
  const double per_unit = 1.2 * M_PI * std::pow(0.02, 3) / 2.7e-3;
  std::vector<double> wrong;
  const Recording r = record_flights(
      {.flights = 60, .lift = 0.3 * per_unit, .false_spins = 0.2, .seed = 3}, &wrong);
  REQUIRE(wrong.size() > 5);
  const IdentifyResult result = identify(test::flying_ball(), {r}, {}, options);
  const ParameterEstimate& lift = parameter(result, "ball.magnus.magnus");
  CAPTURE(lift.value, lift.std, wrong.size());
  CHECK(std::abs(lift.value - 0.3) < kSigmas * lift.std + 0.01);
  std::vector<double> named;
  for (const BallFlag& f : result.ball->flagged)
    if (f.channel == "spin") named.push_back(f.time);
  std::ranges::sort(named);
  std::size_t found = 0;
  for (const double t : wrong)
    found += std::ranges::any_of(named, [&](double n) { return std::abs(n - t) < 0.02; });
  CAPTURE(found, named.size());
  CHECK(found + 1 >= wrong.size());  // a spin along the flight shows no lift
  CHECK(named.size() <= found + 2);  // and none but those, or nearly
}

TEST_CASE("identify a ball: the constrained loss is exact without noise, and biased with it",
          "[ball]") {
  const Model truth = test::swinging_arm();
  const bool noisy = GENERATE(false, true);
  IdentifyOptions options;
  options.ball.loss = BallLoss::kConstrained;
  const Recording r =
      record_swing(truth, {.seed = 12, .noise = noisy ? kNoise : 0.0, .drag = 0.05});
  const IdentifyResult result = identify(nominal_arm(0.4), {r}, {}, options);
  CAPTURE(noisy, parameter(result, "string.length").value,
          parameter(result, "string.attachment_x").value,
          parameter(result, "string.attachment_y").value,
          parameter(result, "string.attachment_z").value,
          parameter(result, "ball.linear_drag.drag").value);
  // Without noise, cubics through five rows and softplus leave 0.1 mm. With 1.5 mm, soft ends of
  // the penalties and the smoothed path shorten the string by 1.2 to 1.7 mm (six recordings;
  // attachment 0.4 mm), ten of its standard errors: the trajectory loss is what noise asks for.
  const double bound = noisy ? 3e-3 : 3e-4;
  CHECK_THAT(parameter(result, "string.length").value, WithinAbs(0.40, bound));
  CHECK_THAT(parameter(result, "string.attachment_x").value, WithinAbs(0.28, bound));
  CHECK_THAT(parameter(result, "string.attachment_y").value, WithinAbs(0.02, bound));
  CHECK_THAT(parameter(result, "string.attachment_z").value, WithinAbs(0.05, bound));
}

TEST_CASE("identify a ball: compliance of a string that is a spring", "[ball]") {
  const Model truth = test::swinging_arm();
  IdentifyOptions options;
  options.choice.effects = {"string_extension"};
  const IdentifyResult result =
      identify(nominal_arm(), {record_swing(truth, {.seed = 13, .pace = 1.3, .compliance = 0.02})},
               {}, options);
  const ParameterEstimate& c = parameter(result, "string.string_extension.compliance");
  CAPTURE(c.value, c.std, parameter(result, "string.length").value);
  CHECK(c.std < 0.001);
  CHECK_THAT(c.value, WithinRel(0.02, 0.1));
  CHECK_THAT(parameter(result, "string.length").value, WithinAbs(0.40, 1e-3));
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
  const ParameterEstimate& delay = parameter(result, "camera.camera_delay.delay");
  CAPTURE(delay.value, delay.std);
  CHECK(delay.std < 1e-3);
  CHECK_THAT(delay.value, WithinAbs(0.15, kSigmas * delay.std));
  check_string(result, *truth.ball->string);
  CHECK_THAT(result.errors.front().train, WithinRel(kNoise, 0.05));
}

namespace {

struct Table {
  double restitution = 0.9, height = 0.0;
  unsigned seed = 1;
};
/// Balls of radius 20 mm dropped over a smooth table, parabola by parabola: at each bounce the
/// velocity down becomes e times as much up. 100 Hz; 1.2 s each, before bounces at e = 0.75 end.
Recording record_bounces(const Table& table) {
  constexpr double kStep = 1e-2, kGravity = 9.81, kRadius = 0.02;
  constexpr long kDrops = 12, kRows = 120, kPause = 40;
  Rng rng(table.seed);
  Recording r;
  r.source = "bounces";
  r.time.resize(kDrops * (kRows + kPause));
  r.q.resize(r.rows(), 0);
  r.tau.resize(r.rows(), 0);
  r.ball = RowMatX<double>::Constant(r.rows(), 3, kNaN);
  for (long k = 0; k < r.rows(); ++k) r.time[k] = static_cast<double>(k) * kStep;
  for (long drop = 0; drop < kDrops; ++drop) {
    const double vx = rng.uniform(-1.0, 1.0), vy = rng.uniform(-1.0, 1.0);
    double begin = 0.0, z = rng.uniform(0.2, 0.5), v = rng.uniform(-0.5, 0.5);  // of a parabola
    for (long k = 0; k < kRows; ++k) {
      const double t = static_cast<double>(k) * kStep;
      for (;;) {  // to the plane in (v + √(v² + 2 g z))/g
        const double fast = std::sqrt(v * v + 2.0 * kGravity * z), takes = (v + fast) / kGravity;
        if (begin + takes > t) break;
        begin += takes;
        z = 0.0;
        v = table.restitution * fast;
      }
      const double s = t - begin;
      const double height = table.height + kRadius + z + v * s - 0.5 * kGravity * s * s;
      r.ball.row(drop * (kRows + kPause) + k) << vx * t + kNoise * rng.normal(),
          vy * t + kNoise * rng.normal(), height + kNoise * rng.normal();
    }
  }
  return r;
}

}  // namespace

TEST_CASE("identify a ball: restitution and height of a table that it bounces off", "[ball]") {
  const Table table = GENERATE(Table{0.9, 0.0, 1}, Table{0.75, 0.0, 2}, Table{0.9, 0.76, 3});
  IdentifyOptions options;
  options.choice.effects = {"bounce"};
  const IdentifyResult result = identify(test::flying_ball(), {record_bounces(table)}, {}, options);
  const ParameterEstimate &e = parameter(result, "ball.bounce.restitution"),
                          &height = parameter(result, "ball.bounce.height"),
                          &friction = parameter(result, "ball.bounce.friction");
  CAPTURE(table.restitution, table.height, e.value, e.std, height.value, height.std, friction.value,
          result.summary.termination, result.ball->sigma, result.ball->rows());
  CHECK(e.std < 2e-3);
  CHECK_THAT(e.value, WithinAbs(table.restitution, kSigmas * e.std));
  CHECK_THAT(height.value, WithinAbs(table.height, kSigmas * height.std));
  CHECK(friction.value < 2e-3);
  CHECK_THAT(result.errors.front().train, WithinRel(kNoise, 0.05));
}

TEST_CASE("identify a ball: lift asks for a recorded spin", "[ball]") {
  IdentifyOptions options;
  options.choice.effects = {"quadratic_drag", "magnus"};
  const Recording spinning = record_flights({.flights = 10, .seed = 4});
  Recording blind = record_flights({.flights = 10, .seed = 5});
  blind.spin.resize(0, 0);
  const auto refused = ContainsSubstring("flights-5: magnus needs the ball's spin");
  CHECK_THROWS_AS(identify(test::flying_ball(), {blind}, {}, options), DataError);
  CHECK_THROWS_WITH(identify(test::flying_ball(), {blind}, {}, options), refused);
  CHECK_THROWS_WITH(identify(test::flying_ball(), {spinning}, {blind}, options), refused);
}
