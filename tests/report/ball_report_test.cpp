/// A ball on both pages: self-contained, small, and whole where numbers are missing.

#include <algorithm>
#include <fstream>
#include <limits>
#include <report/diagnose_words.hpp>
#include <support/swung_ball.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/report/diagnose_page.hpp>
#include <diffnea/report/diagnose_text.hpp>
#include <diffnea/report/identify_page.hpp>
#include <diffnea/report/identify_text.hpp>

#include "support/page.hpp"

namespace diffnea::ball_report_test {
namespace {

using test::check_page;
using test::count;

using Catch::Matchers::ContainsSubstring;
using namespace report;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

FitRun ball_fit_run() {
  FitRun run;
  run.fit.model.name = "catcher";
  run.fit.errors = {{"elbow", "N*m", 2.0, 0.1, 0.5, 0.2, 1.0, 0.25, 0.3},
                    {"ball", "m", 0.2, 0.001, 0.006, 0.0011, 0.0062, kNaN, kNaN}};
  run.fit.ball = test::swung_ball();
  run.fit.summary = {true, false, "converged", 7, 1, 1000, 2000, 0.5, 0.25};
  return run;
}

DiagnoseRun ball_diagnose_run() {
  DiagnoseRun run;
  Finding& f = run.finding;
  f.model.name = "catcher";
  f.verdict = Verdict::kNamed;
  f.sentence = "The model lacks string mass.";
  Cause mass;
  mass.effect = "string_mass";
  mass.where = "string";
  mass.parameters = {{"mass_ratio", "1", 0.05, 0.004, 0.042, 0.058}};
  mass.gain = {5.0, 1.1, 1.0, 0.9, 0.8, 0.95};
  Cause late;
  late.effect = "camera_delay";
  late.where = "camera";
  late.parameters = {{"delay", "s", 0.012, 0.001, 0.010, 0.014}};
  late.gain = {5.0, 1.1, 1.0, 0.9, 0.8, 0.95};
  f.causes = {mass, late};
  f.gain = {6.0, 1.1, 1.0, 0.95, 0.9, 0.99};
  f.joints = {{"ball", "m", 0.2, 0.006, 0.0011, 0.001}};
  f.held_out = "test recording";
  f.ball = test::swung_ball();
  return run;
}

}  // namespace

TEST_CASE("ball report: the pages hold every picture, and stay small", "[report]") {
  for (const std::string& page :
       {identify_page(ball_fit_run()), diagnose_page(ball_diagnose_run())}) {
    check_page(page);
    for (const char* kind : {"space", "turns", "sphere"})
      CHECK(count(page, std::string("data-draw='") + kind + "'") == 1);
    const std::string chart = "data-draw='time' data-set='ball' data-joint='";
    CHECK(count(page, chart + "length' data-part='value'") == 1);
    for (const char* of : {"length", "x", "y", "z"})
      CHECK(count(page, chart + of + "' data-part='error'") == 1);
    CHECK_THAT(page, ContainsSubstring("Length of the string"));
    for (const char* key :
         {"\"taut\":[true", "\"anchor\":{\"x\":[", "\"sigma\":", "\"flagged\":[{"})
      CHECK_THAT(page, ContainsSubstring(key));
    CHECK_THAT(page, ContainsSubstring("7 rows or flights were flagged"));
    CHECK_THAT(page, ContainsSubstring("where &lt;the model&gt; has it"));
  }
  // An hour at 60 Hz.
  test::SwungBallOptions hour;
  hour.windows = 1800;
  hour.rows = 120;
  FitRun run = ball_fit_run();
  run.fit.ball = test::swung_ball(hour);
  CHECK(identify_page(run).size() < 1'000'000);
}

TEST_CASE("report: text of a page is escaped once", "[report]") {
  DiagnoseRun run = ball_diagnose_run();
  run.finding.next_experiment.emplace();
  run.finding.next_experiment->sentence = "a < b & c";
  run.finding.next_experiment->trajectory = "next&.csv";
  const std::string page = diagnose_page(run);
  CHECK_THAT(page, ContainsSubstring("a &lt; b &amp; c"));
  CHECK_THAT(page, ContainsSubstring("next&amp;.csv"));
  CHECK_THAT(page, !ContainsSubstring("&amp;amp;") && !ContainsSubstring("&amp;lt;"));
}

TEST_CASE("ball report: whole where numbers are missing", "[report]") {
  FitRun run = ball_fit_run();
  BallSeries& b = *run.fit.ball;
  SECTION("no model before") {
    for (auto& p : b.base) p = {kNaN, kNaN, kNaN};
    b.base_rms = kNaN;
    const std::string page = identify_page(run);
    CHECK(count(page, "data-one=''") == count(page, "data-set='ball'") + 3);
  }
  SECTION("nothing is known but time") {
    for (auto* points : {&b.measured, &b.base, &b.extended, &b.anchor})
      for (auto& p : *points) p = {kNaN, kNaN, kNaN};
    b.sigma = b.length = b.base_rms = b.extended_rms = kNaN;
  }
  SECTION("one row") {
    for (auto* points : {&b.measured, &b.base, &b.extended, &b.anchor}) points->resize(1);
    b.run.resize(1);
    b.window.resize(1);
    b.time.resize(1);
    b.taut.resize(1);
  }
  SECTION("no row") {
    b = {};
    CHECK_THAT(identify_page(run), ContainsSubstring("never seen for long enough"));
  }
  SECTION("no string, no flags") {
    b.has_string = false;
    b.flagged.clear();
    CHECK(count(identify_page(run), "Length of the string") == 0);
  }
  check_page(identify_page(run));
}

TEST_CASE("ball report: texts give the ball in millimetres and no share of a torque", "[report]") {
  const std::string fit = identify_text(ball_fit_run());
  CHECK_THAT(fit, ContainsSubstring("mm"));
  CHECK_THAT(fit, ContainsSubstring("the error of the ball's position falls from 6.2 to 1.1 mm."));
  CHECK_THAT(fit, ContainsSubstring("torque error falls from 50.0 % to 10.0 % of the torque"));
  CHECK_THAT(fit, ContainsSubstring("and 2 more"));
  const std::string line = fit.substr(fit.find("\n  ball"), 80);
  CHECK_THAT(line.substr(0, line.find('\n', 1)), !ContainsSubstring("%"));

  const std::string found = diagnose_text(ball_diagnose_run());
  CHECK_THAT(found, ContainsSubstring("error of the ball's position on held-out data"));
  CHECK_THAT(found, ContainsSubstring("5.00 ± 0.80"));
  CHECK_THAT(found, ContainsSubstring("12.0 ± 2.0"));
  CHECK_THAT(found, ContainsSubstring("% of the ball's"));
  CHECK_THAT(found, !ContainsSubstring("string mass at string"));
  CHECK_THAT(found, ContainsSubstring("camera saw it before"));
}

TEST_CASE("ball report: places of ball effects read as words", "[report]") {
  CHECK(report::at("string_mass", "string") == "string mass");
  CHECK(report::at("attachment_offset", "string") == "attachment offset of the string");
  CHECK(report::at("quadratic_drag", "ball") == "quadratic drag on the ball");
  CHECK(report::at("magnus", "ball") == "Magnus lift of the ball");
  CHECK(report::at("camera_delay", "camera") == "camera delay");
  CHECK(report::at("coulomb_friction", "elbow") == "coulomb friction at elbow");
}

/// For the eye: DIFFNEA_PAGES=folder writes the pages there.
TEST_CASE("ball report: pages to look at", "[report][.look]") {
  const char* folder = std::getenv("DIFFNEA_PAGES");
  REQUIRE(folder);
  std::ofstream(std::string(folder) + "/identify.html") << identify_page(ball_fit_run());
  std::ofstream(std::string(folder) + "/diagnose.html") << diagnose_page(ball_diagnose_run());
}

}  // namespace diffnea::ball_report_test
