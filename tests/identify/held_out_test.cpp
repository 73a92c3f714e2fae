/// What held-out recordings say, and where they say nothing: rates and bands, joints without a row,
/// numbers of recordings, copies. A cart with a pendulum, motion and torque in closed form.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <support/temporary_folder.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/report/identify_page.hpp>
#include <diffnea/report/identify_text.hpp>
#include <diffnea/runs/result.hpp>

#include "identify/passes.hpp"

namespace held_out_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;

namespace {

constexpr double kNoise = 0.05;  // of torques [N·m]

Model two_hinges() {
  Model model;
  model.name = "two";
  for (int k = 0; k < 2; ++k) {
    ModelLink link;
    link.name = "link" + std::to_string(k);
    link.joint = "hinge" + std::to_string(k);
    link.parent = k - 1;
    link.type = ModelJoint::kRevolute;
    link.axis = {0, 1, 0};
    link.X_PJ.p = {k == 0 ? 0.0 : 0.4, 0, 0};
    link.inertia = inertia_from_com<double>(1.0, {0.2, 0, 0}, {0.01, 0, 0, 0.02, 0, 0.02});
    model.links.push_back(link);
  }
  model.effects = {{"viscous_friction", "all", {{"viscous", 0.5, ""}}}};
  return model;
}

struct Motion {
  double seconds = 12.0, rate = 250.0, phase = 0.0, start = 0.0;
  double still_from = 1e9;  ///< joint 1 stands from there on [s]
  unsigned seed = 1;
  Model model = two_hinges();
  int run = 0;
};

/// Torques by inverse_dynamics of known derivatives, and noise.
Recording recorded(const Motion& m) {
  Rng rng(m.seed);
  Recording r;
  r.source = "motion-" + std::to_string(m.seed);
  r.joint_names = {"hinge0", "hinge1"};
  r.has_tau = {true, true};
  r.info.torque_sampling = TorqueSampling::kInstant;
  const long rows = std::lround(m.seconds * m.rate);
  r.time.resize(rows);
  r.q.resize(rows, 2);
  RowMatX<double> qd(rows, 2), qdd(rows, 2);
  for (long k = 0; k < rows; ++k) {
    const double t = static_cast<double>(k) / m.rate;
    r.time[k] = m.start + t;
    for (int j = 0; j < 2; ++j) {
      const double w[2] = {2.3 + 0.9 * j, 5.1 - 0.7 * j}, a[2] = {0.6, 0.25};
      r.q(k, j) = qd(k, j) = qdd(k, j) = 0.0;
      for (int i = 0; i < 2; ++i) {
        if (j == 1 && t > m.still_from) continue;
        r.q(k, j) += a[i] * std::sin(w[i] * t + m.phase);
        qd(k, j) += a[i] * w[i] * std::cos(w[i] * t + m.phase);
        qdd(k, j) -= a[i] * w[i] * w[i] * std::sin(w[i] * t + m.phase);
      }
    }
  }
  const VecX<double> time = r.time.array() - m.start;
  r.tau = inverse_dynamics(extend(m.model, {}, m.run), r.q, qd, qdd, m.run, &time);
  for (double& tau : r.tau.reshaped()) tau += kNoise * rng.normal();
  return r;
}

IdentifyOptions with(std::vector<std::string> effects) {
  IdentifyOptions options;
  options.choice.effects = std::move(effects);
  return options;
}

bool has_note(const IdentifyResult& result, const std::string& part) {
  return std::ranges::any_of(
      result.notes, [&](const std::string& n) { return n.find(part) != std::string::npos; });
}

}  // namespace

TEST_CASE("held out: a joint of which no row counts has no error, not an error of 0",
          "[identify]") {
  const Recording train = recorded({});
  SECTION("its torque is absent") {
    Recording test = recorded({.phase = 1.0, .seed = 2});
    test.has_tau[1] = false;
    test.tau.col(1).setConstant(std::numeric_limits<double>::quiet_NaN());
    const IdentifyResult result = identify(two_hinges(), {train}, {test}, with({}));
    CHECK(result.errors[0].test < 2.0 * kNoise);
    for (const double e : {result.errors[1].test, result.errors[1].nominal_test,
                           result.errors[1].test_all, result.errors[1].torque_rms})
      CHECK(std::isnan(e));
    CHECK(result.errors[1].train < 2.0 * kNoise);
    CHECK(has_note(result, "say nothing of hinge1:"));
  }
  SECTION("it holds still") {
    const IdentifyResult result =
        identify(two_hinges(), {train}, {recorded({.phase = 1.0, .still_from = -1.0, .seed = 2})},
                 with({"coulomb_friction"}));
    CHECK(std::isnan(result.errors[1].test));
    CHECK(result.errors[1].test_all > 0.0);  // at rest there are rows
    CHECK(has_note(result, "say nothing of hinge1:"));
  }
  SECTION("every stretch is too short") {
    IdentifyOptions options = with({});
    options.preprocess.min_segment = 3.0;
    const IdentifyResult result = identify(
        two_hinges(), {train}, {recorded({.seconds = 2.5, .phase = 1.0, .seed = 2})}, options);
    for (const JointError& e : result.errors) CHECK(std::isnan(e.test));
    CHECK(has_note(result, "say nothing of hinge0, hinge1:"));
  }
}

TEST_CASE("held out: where no row counts, all that is shown is of the data of the fit",
          "[identify]") {
  IdentifyOptions options = with({});
  Recording train = recorded({}), test = recorded({.phase = 1.0, .seed = 2});
  bool explains_little = false;
  const auto without = [](Recording& r, int joint) {
    r.has_tau[static_cast<std::size_t>(joint)] = false;
    r.tau.col(joint).setConstant(std::numeric_limits<double>::quiet_NaN());
  };
  SECTION("every stretch is too short") {
    options.preprocess.min_segment = 3.0;
    test = recorded({.seconds = 2.5, .phase = 1.0, .seed = 2});
  }
  SECTION("they are of a joint of which the fit knows nothing") {
    without(train, 1);
    without(test, 0);
  }
  SECTION("and the fit explains little") {
    options.preprocess.min_segment = 3.0;
    options.choice.fit = {"effects"};
    test = recorded({.seconds = 2.5, .phase = 1.0, .seed = 2});
    Rng rng(4);
    for (double& tau : train.tau.reshaped()) tau += 100.0 * rng.normal();
    explains_little = true;
  }
  const FitRun run{identify(two_hinges(), {train}, {test}, options), {}},
      alone{identify(two_hinges(), {train}, {}, options), {}};
  for (std::size_t j = 0; j < 2; ++j) {
    const JointError &e = run.fit.errors[j], &of_fit = alone.fit.errors[j];
    CAPTURE(e.joint);
    CHECK(std::isnan(e.test));
    CHECK(std::isnan(e.torque_rms) == std::isnan(of_fit.train));
    if (!std::isnan(of_fit.train)) CHECK(e.torque_rms == of_fit.torque_rms);
  }
  CHECK(identify_page(run).find("No held-out recording (--test) of which a row counts") !=
        std::string::npos);
  CHECK_THAT(identify_headline(run), ContainsSubstring("On the data it was fitted to, the torque"));
  CHECK(identify_headline(run) == identify_headline(alone));
  CHECK(has_note(run.fit, "the fit explains little") == explains_little);
}

TEST_CASE("held out: other rates are compared in the band of the fit", "[identify]") {
  IdentifyOptions options = with({});
  options.preprocess.filter_hz = 126.0;
  const Recording train = recorded({.rate = 1000.0});
  SECTION("a fifth of the rate") {
    const IdentifyResult result = identify(
        two_hinges(), {train}, {recorded({.rate = 200.0, .phase = 1.0, .seed = 2})}, options);
    const PreprocessPlan held_out =
        plan_like(result.plan, {recorded({.rate = 200.0, .phase = 1.0})});
    CHECK(std::abs(held_out.decimator.pass_hz - result.plan.decimator.pass_hz) < 1e-6);
    CHECK(std::abs(held_out.decimator.stop_hz - result.plan.decimator.stop_hz) < 1e-6);
    CHECK(held_out.filter_hz <= 50.0 + 1e-9);
    // White noise that a band of b of 2f Hz lets through: √(b/f), ± 10 % of some 400 rows.
    const double slower = result.errors[0].test / result.errors[0].train;
    CHECK(slower > 0.85 * std::sqrt(5.0));
    CHECK(slower < 1.15 * std::sqrt(5.0));
    CHECK_FALSE(has_note(result, "too slowly for the band"));
  }
  SECTION("a rate that the band does not fit in") {
    const IdentifyResult result = identify(
        two_hinges(), {train}, {recorded({.rate = 40.0, .phase = 1.0, .seed = 2})}, options);
    CHECK(has_note(result, "too slowly for the band"));
    CHECK(result.errors[0].test > 0.0);
  }
}

TEST_CASE("held out: a set that cannot be read is refused before the work", "[identify]") {
  IdentifyOptions options = with({});
  int called = 0;
  options.progress = [&](const FitProgress& p) {
    called += p.stage == "reading" || p.stage == "simulating" ? 1 : 0;
    return true;
  };
  Recording brief = recorded({.seconds = 0.05, .phase = 1.0, .seed = 2});
  CHECK_THROWS_AS(identify(two_hinges(), {recorded({})}, {brief}, options), DataError);
  CHECK(called == 0);
}

TEST_CASE("held out: recordings are numbered after those of the fit, and have their time",
          "[identify]") {
  Model robot = two_hinges();
  robot.effects.push_back(
      {"warm_up", "hinge0", {{"viscous", 2.0, ""}, {"time_constant", 5.0, ""}}});
  const Motion first{.start = 100.0, .model = robot};
  Motion second{.phase = 1.0, .start = 300.0, .seed = 2, .model = robot};
  Recording train = recorded(first), test = recorded(second);
  train.tau.col(1).array() += 3.0;  // of this session alone [N·m]
  IdentifyOptions options = with({"session_offset"});
  options.choice.fix = {"*warm_up*"};
  const IdentifyResult result = identify(robot, {train}, {test}, options);
  for (const JointError& e : result.errors) {
    CAPTURE(e.joint, e.test_raw, e.test);
    CHECK(e.test < 2.0 * kNoise);
    CHECK(e.test_raw < 1.5 * kNoise);  // of every row: the torque's noise and q̈'s
  }
  options.loss = Loss::kMotion;
  options.choice.effects = {"session_offset"};
  robot.effects.pop_back();
  Recording other = recorded({.phase = 1.0, .seed = 2});
  train = recorded({});
  train.tau.col(1).array() += 3.0;
  options.choice.fix = {};
  options.motion.horizon = 0.5;
  const IdentifyResult simulated = identify(robot, {train}, {other}, options);
  CHECK(simulated.errors[1].test < 5.0 * simulated.errors[1].train);
}

TEST_CASE("held out: a fit that is worse on data of the fit alone is no warning", "[identify]") {
  Recording quiet = recorded({.seconds = 20.0, .phase = 1.0, .seed = 2});
  Recording loud = recorded({.seconds = 20.0});
  Rng rng(4);
  for (double& tau : loud.tau.reshaped()) tau += 10.0 * rng.normal();
  // What the fit leaves of the loud one is more than all of the quiet one's torque.
  IdentifyOptions options = with({});
  options.choice.fit = {"effects"};
  const IdentifyResult result = identify(two_hinges(), {loud}, {quiet}, options);
  REQUIRE(result.errors[1].train > 0.8 * result.errors[1].torque_rms);
  CHECK_FALSE(has_note(result, "the fit explains little"));
}

TEST_CASE("recordings: fingerprints are of the motion, of every run, streamed or not",
          "[identify]") {
  const test::TemporaryFolder folder;
  const Model model = two_hinges();
  Recording one = recorded({}), two = recorded({.phase = 1.0, .seed = 2});
  one.run = 0;
  two.run = 1;
  write_recordings({one, two}, folder.path() / "both.csv");
  const auto streamed = recordings_in_files(model, {folder.path() / "both.csv"}, {}, 0);
  const auto kept = recordings_in_files(model, {folder.path() / "both.csv"}, {});
  REQUIRE(fingerprints(*streamed).size() == 2);
  CHECK(fingerprints(*streamed) == fingerprints(*kept));
  CHECK(fingerprints(*streamed)[0] != fingerprints(*streamed)[1]);
  // Torques that something was taken out of are of the same recording.
  Recording without = kept->sample()[1];
  without.tau.array() -= 0.4;
  const auto corrected = recordings_in_memory(model, {without});
  CHECK(fingerprints(*corrected)[0] == fingerprints(*kept)[1]);
  CHECK(corrected->describe_runs()[0].rows != kept->describe_runs()[1].rows);
  // A copy of the second run is found, too, under whatever name.
  const auto copy = recordings_in_memory(model, {kept->sample()[1]});
  CHECK_THROWS_WITH(identify(model, *streamed, copy.get(), with({})),
                    ContainsSubstring("same rows"));
  // What identify leaves in the model names both.
  const IdentifyResult result = identify(model, *streamed, nullptr, with({}));
  REQUIRE(result.model.posterior.has_value());
  CHECK(result.model.posterior->recordings == fingerprints(*kept));
}

}  // namespace held_out_test
