/// diagnose() of a ball: what is hidden is named, with its number; what is not, is not. The
/// recordings come from equations of their own (support/camera_ball.hpp).

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <support/camera_ball.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/diagnose/diagnose.hpp>

#include "support/kept_diagnosis.hpp"

namespace ball_diagnose_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;
using test::record_swing;
using test::SwingOptions;

namespace {

constexpr double kNoise = 1.5e-3;  // of the camera [m]
constexpr double kDrag = 0.25;     // [1/s]: 60 mm at the end of a window, if nothing made up for it

struct Pair {
  std::vector<Recording> train, test;
};
/// Two motions of the same world.
Pair recorded(SwingOptions o, const Model& truth = test::swinging_arm()) {
  SwingOptions other = o;
  other.seed += 50;
  other.pace = 1.09 * o.pace;
  return {{record_swing(truth, o)}, {record_swing(truth, other)}};
}

const Cause* find_cause(const Finding& finding, const std::string& effect) {
  const auto at =
      std::ranges::find(finding.causes, effect, [](const Cause& c) { return c.effect; });
  return at == finding.causes.end() ? nullptr : &*at;
}
std::string listed(const Finding& finding) {
  std::string out = finding.sentence + " |";
  for (const Cause& c : finding.causes) {
    out += " " + c.effect + "@" + c.where;
    for (const CauseParameter& p : c.parameters)
      out += " " + std::to_string(p.value) + " [" + std::to_string(p.low) + ", " +
             std::to_string(p.high) + "]";
    for (const Rival& m : c.members) out += " or " + m.effect;
  }
  return out;
}

}  // namespace

TEST_CASE("diagnose a ball: drag is named, the truth in its interval", "[ball][diagnose]") {
  const Pair data = recorded({.seed = 1, .drag = kDrag});
  const Finding finding = diagnose(test::swinging_arm(), data.train, data.test);
  CAPTURE(listed(finding));
  const Cause* drag = find_cause(finding, "linear_drag");
  REQUIRE(drag != nullptr);
  CHECK(finding.causes.size() == 1);
  CHECK(drag->where == "ball");
  CHECK((finding.verdict == Verdict::kNamed || finding.verdict == Verdict::kClass));
  REQUIRE(drag->parameters.size() == 1);
  const CauseParameter& p = drag->parameters.front();
  // 95 %, of this seed: not a matter of luck twice.
  CHECK(p.low <= kDrag);
  CHECK(p.high >= kDrag);
  CHECK(p.high - p.low < 0.5 * kDrag);
  CHECK(finding.held_out == "test recording");
  CHECK(finding.base == "refit");
  CHECK(finding.gain.after < 1.1);
  CHECK(finding.gain.before > finding.gain.after);
  CHECK(drag->gain.low > 0.0);
  REQUIRE(finding.ball.has_value());
  CHECK(finding.ball->extended_rms < finding.ball->base_rms);
  REQUIRE(finding.model.effects.size() == 1);
  CHECK(finding.model.effects.front().effect == "linear_drag");
  CHECK_FALSE(finding.interrupted);
}

TEST_CASE("diagnose a ball: nothing is named where nothing is hidden", "[ball][diagnose]") {
  const Pair data = recorded({.seed = 2});
  const Finding finding = diagnose(test::swinging_arm(), data.train, data.test);
  CAPTURE(listed(finding));
  CHECK(finding.verdict == Verdict::kNone);
  CHECK(finding.causes.empty());
  CHECK(finding.witness.empty());
  CHECK(finding.model.effects.empty());
  CHECK_THAT(finding.gain.after, WithinAbs(1.0, 0.05));
  CHECK_FALSE(finding.candidates.empty());
}

TEST_CASE("diagnose a ball: a string tied elsewhere is one where the base is fixed",
          "[ball][diagnose]") {
  const Pair data = recorded({.seed = 3});
  Model accused = test::swinging_arm();
  accused.ball->string->p_LS.y -= 0.012;
  DiagnoseOptions options;
  options.base = Base::kFixed;
  const Finding finding = diagnose(accused, data.train, data.test, options);
  CAPTURE(listed(finding));
  const Cause* offset = find_cause(finding, "attachment_offset");
  REQUIRE(offset != nullptr);
  CHECK(finding.causes.size() == 1);
  REQUIRE(offset->parameters.size() == 3);
  CHECK_THAT(offset->parameters[0].value, WithinAbs(0.0, 1.5e-3));
  CHECK_THAT(offset->parameters[1].value, WithinAbs(0.012, 1.5e-3));
  CHECK_THAT(offset->parameters[2].value, WithinAbs(0.0, 1.5e-3));
  CHECK(finding.base == "fixed");
  // A base that is refitted takes it in.
  const Finding refitted = diagnose(accused, data.train, data.test);
  CAPTURE(listed(refitted));
  CHECK(refitted.verdict == Verdict::kNone);
  CHECK(refitted.base == "refit");
  // One that was identified is held, and the result says so.
  accused.ball->string->length_std = 1e-4;
  CHECK(diagnose(accused, data.train, data.test).base == "prior");
}

TEST_CASE("diagnose a ball: where a slow camera's noise is not known, it is what the causes leave",
          "[ball][diagnose]") {
  Pair data = recorded({.seed = 3});
  for (Recording* r : {&data.train.front(), &data.test.front()})
    for (long k = 0; k < r->rows(); ++k)
      if (std::fmod(r->time[k] + 1e-9, 0.05) > 1e-6)  // at 20 Hz blocks of rows are too few
        r->ball.row(k).setConstant(std::nan(""));
  Model accused = test::swinging_arm();
  accused.ball->string->p_LS.y -= 0.05;
  DiagnoseOptions options;
  options.base = Base::kFixed;
  const Finding finding = diagnose(accused, data.train, data.test, options);
  CAPTURE(listed(finding));
  REQUIRE(find_cause(finding, "attachment_offset") != nullptr);
  REQUIRE(finding.ball.has_value());
  // First states take some of it with them, and the base misses by far more.
  CHECK(finding.ball->sigma > 0.7 * kNoise);
  CHECK(finding.ball->sigma < 1.1 * kNoise);
  CHECK(finding.noise.back() == finding.ball->sigma);
  CHECK(finding.ball->base_rms > 5.0 * kNoise);
  CHECK_THAT(finding.gain.after, WithinAbs(1.0, 0.3));
  CHECK_THAT(finding.gain.before, WithinAbs(finding.ball->base_rms / finding.ball->sigma, 2.0));
}

TEST_CASE("diagnose a ball: without a second recording, stretches of time are held out",
          "[ball][diagnose]") {
  const Pair data = recorded({.seconds = 22, .seed = 4, .drag = kDrag});
  const Finding finding = diagnose(test::swinging_arm(), data.train, {});
  CAPTURE(listed(finding));
  CHECK(finding.held_out == "time blocks");
  CHECK(find_cause(finding, "linear_drag") != nullptr);
  const Recording few = record_swing(test::swinging_arm(), {.seconds = 6, .seed = 4});
  CHECK_THROWS_WITH(diagnose(test::swinging_arm(), {few}, {}),
                    ContainsSubstring("too few to hold some out") && ContainsSubstring("--test"));
}

TEST_CASE("diagnose a ball: only the effects that are asked for are candidates",
          "[ball][diagnose]") {
  const Pair data = recorded({.seed = 5, .drag = kDrag});
  DiagnoseOptions options;
  options.effects = {"string_mass", "camera_delay"};
  const Finding finding = diagnose(test::swinging_arm(), data.train, data.test, options);
  CAPTURE(listed(finding));
  CHECK(find_cause(finding, "linear_drag") == nullptr);
  for (const CandidateScore& c : finding.candidates)
    CHECK((c.effect == "string_mass" || c.effect == "camera_delay"));
  CHECK(finding.candidates.size() + finding.absorbed.size() == 2);
}

TEST_CASE("diagnose a ball: the caller may stop it", "[ball][diagnose]") {
  const Pair data = recorded({.seconds = 8, .seed = 6, .drag = kDrag});
  DiagnoseOptions options;
  int calls = 0;
  options.progress = [&](const FitProgress&) { return ++calls < 2; };
  const Finding finding = diagnose(test::swinging_arm(), data.train, data.test, options);
  CHECK(finding.interrupted);
  CHECK(calls >= 2);
  CHECK(calls < 6);
}

TEST_CASE("diagnose a ball: what was found until it was stopped is listed with its first scores",
          "[ball][diagnose]") {
  const Pair data = recorded({.seconds = 8, .seed = 6, .drag = kDrag});
  DiagnoseOptions options;
  options.effects = {"linear_drag", "string_mass"};
  int calls = 0, last = 0;  // all of them: never stopped
  options.progress = [&](const FitProgress&) { return ++calls != last; };
  const Finding whole = diagnose(test::swinging_arm(), data.train, data.test, options);
  REQUIRE(find_cause(whole, "linear_drag") != nullptr);
  const int all = calls;
  int with_drag = 0;
  for (const int quarter : {1, 2, 3, 4}) {
    calls = 0;
    last = std::max(1, quarter * all / 4 - 1);
    const Finding finding = diagnose(test::swinging_arm(), data.train, data.test, options);
    CAPTURE(all, last, listed(finding));
    CHECK(finding.interrupted);
    for (const Cause& c : finding.causes) {
      CHECK(c.delta_bic > options.accept_delta_bic);
      CHECK(c.visible_share > 0.0);
      CHECK(c.torque_share > 0.0);
      for (const CauseParameter& p : c.parameters) CHECK(p.std > 0.0);
    }
    if (const Cause* drag = find_cause(finding, "linear_drag")) {
      ++with_drag;
      CHECK_THAT(drag->parameters.front().value, WithinAbs(kDrag, 0.5 * kDrag));
    }
  }
  CHECK(with_drag >= 1);
}

TEST_CASE("diagnose a ball: a force that no effect is like is unknown, with a witness",
          "[ball][diagnose]") {
  const double omega = GENERATE(5.0, 8.0);  // the pendulum's own is 4.95/s
  SwingOptions o{.seed = 7};
  o.extra = [omega](double t, const Vec3<double>&, const Vec3<double>&) {
    return Vec3<double>{0.3 * std::sin(omega * t), 0, 0};
  };
  const Pair data = recorded(o);
  const Finding finding = diagnose(test::swinging_arm(), data.train, data.test);
  CAPTURE(listed(finding), finding.gain.before, finding.gain.after, finding.gain.explained_share);
  CHECK(finding.verdict == Verdict::kUnknown);
  CHECK(finding.gain.after > 1.1);
  REQUIRE_FALSE(finding.witness.empty());
  const Witness& w = finding.witness.front();
  CHECK(w.where == "ball");
  REQUIRE(w.variables.size() == 1);
  double hz = 0.0;
  REQUIRE(std::sscanf(w.variables.front().c_str(), "time, %lf Hz", &hz) == 1);
  CHECK_THAT(hz, WithinAbs(omega / (2.0 * M_PI), 0.04));  // 1/(2·16 s) apart
  CHECK(w.share > 0.5);
  CHECK(test::kept_page(finding).find(w.variables.front()) != std::string::npos);
}

TEST_CASE("diagnose a ball: causes of arm and ball in one finding", "[ball][diagnose]") {
  const Model model = test::swinging_arm();
  const SwingOptions one{.seed = 9, .drag = kDrag}, two{.seed = 59, .pace = 1.09, .drag = kDrag};
  Recording train = record_swing(model, one), held_out = record_swing(model, two);
  test::add_torque(model, one, train, 0.0, 0.5);
  test::add_torque(model, two, held_out, 0.0, 0.5);
  const Finding finding = diagnose(model, {train}, {held_out});
  CAPTURE(listed(finding));
  const Cause *friction = find_cause(finding, "coulomb_friction"),
              *drag = find_cause(finding, "linear_drag");
  REQUIRE(friction != nullptr);
  REQUIRE(drag != nullptr);
  CHECK(friction->where == "joint1");
  CHECK(drag->where == "ball");
  CHECK(drag->parameters.front().low <= kDrag);
  CHECK(drag->parameters.front().high >= kDrag);
  CHECK(finding.joints.size() == 4);
  CHECK(finding.joints.back().joint == "ball");
  CHECK_FALSE(finding.series.empty());
  CHECK(finding.ball.has_value());
  CHECK(finding.model.effects.size() >= 2);
  const std::string page = test::kept_page(finding);
  CHECK(page.find("coulomb friction at joint1") != std::string::npos);
  CHECK(page.find("linear drag on the ball") != std::string::npos);
}

TEST_CASE("diagnose a ball: a recording that cannot be used is refused", "[ball][diagnose]") {
  const Pair data = recorded({.seconds = 8, .seed = 8});
  const Model model = test::swinging_arm();
  Recording blind = data.test.front();
  blind.ball.resize(0, 0);
  CHECK_THROWS_WITH(diagnose(model, data.train, {blind}),
                    ContainsSubstring("held-out") && ContainsSubstring("ball_x"));
  DiagnoseOptions options;
  options.effects = {"linear_drag"};
  CHECK_THROWS_WITH(diagnose(model, {blind}, {}, options),
                    ContainsSubstring("neither torques") && ContainsSubstring("ball_x"));
  options.effects = {"linear_drga"};
  CHECK_THROWS_WITH(diagnose(model, data.train, data.test, options),
                    ContainsSubstring("linear_drga"));
}

TEST_CASE("diagnose a ball: effects of joints that are asked for need a torque",
          "[ball][diagnose]") {
  const Pair data = recorded({.seconds = 8, .seed = 10});
  DiagnoseOptions options;
  options.effects = {"coulomb_friction"};
  if (GENERATE(false, true)) options.effects.push_back("linear_drag");
  const Model model = test::swinging_arm();
  CHECK_THROWS_AS(diagnose(model, data.train, data.test, options), DataError);
  CHECK_THROWS_WITH(diagnose(model, data.train, data.test, options),
                    ContainsSubstring("'coulomb_friction'") &&
                        ContainsSubstring("no torque was recorded") && ContainsSubstring("tau_*"));
}

TEST_CASE("diagnose a ball: lift is tried where spins are recorded", "[ball][diagnose]") {
  const Recording train = test::record_flights({.flights = 16, .seed = 11});
  Recording held_out = test::record_flights({.flights = 16, .seed = 12});
  const auto tries_lift = [](const Finding& finding) {
    return std::ranges::any_of(finding.candidates,
                               [](const CandidateScore& c) { return c.effect == "magnus"; });
  };
  CHECK(tries_lift(diagnose(test::flying_ball(), {train}, {held_out})));
  held_out.spin.resize(0, 0);
  const Finding blind = diagnose(test::flying_ball(), {train}, {held_out});
  CHECK_FALSE(tries_lift(blind));
  CHECK(std::ranges::any_of(blind.notes, [](const std::string& n) {
    return n.find("held-out recordings hold no spin") != std::string::npos &&
           n.find("lift") != std::string::npos;
  }));
  DiagnoseOptions options;
  options.effects = {"magnus"};
  CHECK_THROWS_WITH(
      diagnose(test::flying_ball(), {held_out}, {}, options),
      ContainsSubstring("magnus needs the ball's spin") && ContainsSubstring("spin_x"));
}
TEST_CASE("diagnose a ball: a string that throws it back, beside pictures that are far off",
          "[ball][diagnose]") {
  constexpr double kRestitution = 0.35;
  const Model model = test::swinging_arm();
  const auto jumps = [&](double shake, double pace, unsigned seed) {  // slack three times or more
    return record_swing(model,
                        {.seed = seed, .shake = shake, .pace = pace, .restitution = kRestitution});
  };
  std::vector<Recording> train{jumps(1.5, 1.3, 21), jumps(1.0, 2.0, 23)};
  for (Recording& r : train)
    for (long k = 40; k < r.rows(); k += 130) r.ball(k, 2) += 0.5;
  DiagnoseOptions options;
  options.effects = {"string_rebound", "linear_drag"};
  const Finding finding = diagnose(model, train, {jumps(2.0, 1.6, 24)}, options);
  CAPTURE(listed(finding));
  const Cause* rebound = find_cause(finding, "string_rebound");
  REQUIRE(rebound != nullptr);
  CHECK(finding.verdict == Verdict::kNamed);
  REQUIRE(rebound->parameters.size() == 1);
  // The made impacts are of first order in their step: 0.2 ms beside swings at 10/s.
  CHECK_THAT(rebound->parameters[0].value, WithinAbs(kRestitution, 0.01));
  CHECK(finding.gain.after < 1.1);
}

TEST_CASE("diagnose a ball: where a calm swing cannot tell, a motion that can is proposed",
          "[ball][diagnose]") {
  SwingOptions o{.seed = 31, .shake = 0.3};
  o.extra = [](double, const Vec3<double>&, const Vec3<double>&) {
    return Vec3<double>{0, 0, -0.15};
  };
  const Pair data = recorded(o);
  DiagnoseOptions options;
  options.effects = {"gravity_scale", "string_bending", "string_mass", "linear_drag"};
  const Finding finding = diagnose(test::swinging_arm(), data.train, data.test, options);
  CAPTURE(listed(finding));
  CHECK(finding.verdict == Verdict::kClass);
  REQUIRE(finding.next_experiment.has_value());
  const NextExperiment& next = *finding.next_experiment;
  REQUIRE_FALSE(next.pairs.empty());
  CHECK(next.pairs.front().effect == finding.causes.front().effect);
  CHECK(next.expected_delta_bic >= 10.0);
  CHECK(next.pairs.front().delta_bic < 10.0);
  CHECK(next.motion.joint_names == data.train.front().joint_names);
  CHECK(next.motion.rows() > 0);
  CHECK(test::kept_page(finding).find(next.sentence) != std::string::npos);
}

}  // namespace ball_diagnose_test
