#include "report/sentence.hpp"


#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include "report/diagnose_words.hpp"

namespace diffnea::sentence_test {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::StartsWith;
using report::rival_words;
using report::sentence;

Cause cause(const char* effect, const char* where, std::vector<Rival> rivals) {
  Cause out;
  out.effect = effect;
  out.where = where;
  out.rivals = std::move(rivals);
  return out;
}

TEST_CASE("sentence: what fits and is refuted by parts of the same recording is not called nothing",
          "[report]") {
  Finding finding;
  finding.verdict = Verdict::kNone;
  finding.held_out = "time blocks";
  CHECK_THAT(sentence(finding), ContainsSubstring("Nothing is left to explain"));
  finding.refused = {{"cogging", "elbow", "does not help on held-out data", 40.0}};
  CHECK_THAT(sentence(finding),
             ContainsSubstring("cogging at elbow would explain") && ContainsSubstring("--test"));
  finding.held_out = "test recording";  // which has told
  CHECK_THAT(sentence(finding), ContainsSubstring("Nothing is left to explain"));
}

TEST_CASE("sentence: nothing is not said to be left where one joint's error is far above its noise",
          "[report]") {
  Finding finding;
  finding.verdict = Verdict::kNone;
  finding.gain.before = 0.84;  // mean of all joints, of what no earlier row tells
  finding.joints = {{"pan", "N*m", 20.0, 0.2, 0.2, 0.21}, {"lift", "N*m", 15.0, 1.35, 1.35, 0.21}};
  CHECK_THAT(
      sentence(finding),
      ContainsSubstring("though on held-out data the error of lift is 6.429 times its noise") &&
          !ContainsSubstring("Nothing is left"));
  finding.joints[1].extended = 0.4;
  CHECK_THAT(sentence(finding), ContainsSubstring("Nothing is left to explain"));
}

TEST_CASE("sentence: drives that differ from the description are said before what else is lacked",
          "[report]") {
  Finding finding;
  finding.verdict = Verdict::kNone;
  finding.tried = Tried::kSome;
  finding.joints = {{"pan", "rad", 0.3, 5e-4, 5e-4, 4e-4, 0.03},
                    {"lift", "rad", 0.3, 6e-4, 6e-4, 4e-4, 0.02}};
  finding.simulated.horizons.emplace_back().horizon = 12.0;
  finding.simulated.joints.resize(2);
  finding.simulated.base_follows = 12.0;
  CHECK_THAT(sentence(finding), StartsWith("Over 12 s your simulation is off by 0.5 to 0.6 mrad"));
  finding.drives = {{"pan.position_servo.dead_band", "rad", 0.0, 0.0175, 1e-4, 20.0},
                    {"lift.position_servo.dead_band", "rad", 0.0, 0.0150, 1e-4, 18.0},
                    {"lift.coulomb_friction.coulomb", "N*m", 0.0, 0.1, 1e-3, 9.0}};
  CHECK(sentence(finding) ==
        "Over 12 s your simulation is off by 20 to 30 mrad; with its drives fitted to the log, by "
        "0.5 to 0.6 mrad (root mean square, held out). The drives differ from the description: "
        "dead band at pan and lift and coulomb friction at lift. None of the effects that were "
        "tried improves the model beyond its noise.");
}

TEST_CASE("sentence: causes of most of an error come before the one that is not known",
          "[report]") {
  Finding finding;
  finding.verdict = Verdict::kUnknown;
  finding.causes = {cause("coulomb_friction", "elbow", {})};
  finding.gain.before = 3.0;
  finding.gain.noise_floor = 1.0;
  finding.gain.after = 2.0;
  CHECK_THAT(sentence(finding),
             StartsWith("The model lacks coulomb friction at elbow") &&
                 ContainsSubstring("; that is 62.5 % of the held-out error that can be removed. "
                                   "The cause of the rest is not in the catalogue"));
  finding.gain.after = 2.5;
  CHECK_THAT(sentence(finding), StartsWith("The cause is not in the catalogue") &&
                                    ContainsSubstring("the nearest effects are coulomb friction"));
}

TEST_CASE("sentence: where few effects were tried, it speaks of those", "[report]") {
  Finding finding;
  finding.verdict = Verdict::kNone;
  finding.tried = Tried::kSome;
  CHECK(sentence(finding) ==
        "None of the effects that were tried improves the model beyond its noise.");
  finding.verdict = Verdict::kUnknown;
  finding.tried = Tried::kAll;
  CHECK_THAT(sentence(finding), ContainsSubstring("not in the catalogue"));
  finding.tried = Tried::kSome;
  CHECK_THAT(sentence(finding), ContainsSubstring("none of the effects that were tried") &&
                                    !ContainsSubstring("catalogue"));
  finding.verdict = Verdict::kNotIdentifiable;
  CHECK_THAT(sentence(finding), ContainsSubstring("absorbed by the base"));
  finding.refused = {{"joint_elasticity", "all", "not tried: needs a faster log", 0.0}};
  finding.tried = Tried::kNothing;
  CHECK(sentence(finding) == "Nothing was tried: joint elasticity needs a faster log.");
}

TEST_CASE("refusals: one line for what joints were refused for alike, others with their evidence",
          "[report]") {
  const std::string untried = "not tried: no derivative", worse = "does not help";
  const std::vector<report::RefusedTogether> found =
      report::refused_together({{"actuator_lag", "hip", untried, 0.0},
                                {"cogging", "hip", worse, 12.0},
                                {"actuator_lag", "knee", untried, 0.0},
                                {"saturation", "hip", untried, 0.0},
                                {"actuator_lag", "ankle", untried, 0.0},
                                {"actuator_lag", "ankle", untried, 0.0},
                                {"saturation", "knee", untried, 0.0},
                                {"cogging", "knee", worse, 15.0}});
  REQUIRE(found.size() == 3);
  CHECK(found[0].what == "actuator lag at hip and 2 more, saturation at hip and knee");
  CHECK(found[0].reason == untried);
  CHECK(found[1].what == "cogging at hip");
  CHECK(found[2].what == "cogging at knee");
  CHECK(found[2].delta_bic == 15.0);
}

TEST_CASE("sentence: one effect at many joints is one word, and small causes are counted",
          "[report]") {
  Finding finding;
  finding.verdict = Verdict::kNamed;
  const auto friction = [](const char* where, double size, double share) {
    Cause out = cause("coulomb_friction", where, {});
    CauseParameter force;
    force.name = "coulomb";
    force.unit = "N*m";
    force.value = size;
    force.std = 0.01;
    force.low = size - 0.02;
    force.high = size + 0.02;
    out.parameters = {force};
    out.share = share;
    return out;
  };
  finding.causes = {friction("base", 0.5, 0.5), friction("elbow", 0.125, 0.3),
                    friction("wrist", 0.25, 0.15), cause("torque_gain", "elbow", {}),
                    cause("cogging", "elbow", {})};
  finding.causes[3].share = 0.04;
  finding.causes[4].share = 0.01;
  CHECK_THAT(sentence(finding),
             ContainsSubstring("The model lacks coulomb friction at base, elbow and wrist "
                               "(coulomb 0.125 to 0.5 N·m) and 2 small ones, together 5 %."));
  finding.causes[1].members = {{"sublinear_friction", "elbow", 3.0}};
  CHECK_THAT(sentence(finding),
             ContainsSubstring("[at 1 of them this recording cannot tell which kind of dry fric"));
  finding.causes[1].members = {{"viscous_friction", "elbow", 3.0}};
  CHECK_THAT(sentence(finding), ContainsSubstring("[at 1 of them this recording cannot tell it"));
  finding.causes[1] = friction("elbow", 0.125, 0.3);
  finding.causes[1].effect = "sublinear_friction";
  CHECK_THAT(sentence(finding),
             ContainsSubstring("dry friction at base, elbow and wrist (as coulomb friction at 2 and "
                               "sublinear friction at 1)"));
  finding.causes = {friction("base", 0.5, 0.9), friction("elbow", 0.125, 0.1)};
  CHECK_THAT(sentence(finding), ContainsSubstring("coulomb friction at base (coulomb 0.500 ± 0.02"));
}

TEST_CASE("rivals: how much worse, more general, or chosen elsewhere", "[report]") {
  Rival rival{"stribeck_friction", "elbow", 3.0};
  CHECK(rival_words(rival, "elbow") == "stribeck friction (worse by 3)");
  CHECK(rival_words(rival, "wrist") == "stribeck friction at elbow (worse by 3)");
  rival.more_general = true;
  CHECK(rival_words(rival, "elbow") == "stribeck friction (more general, worse by 3)");
  rival.delta_bic = -7.0;
  CHECK(rival_words(rival, "elbow") == "stribeck friction (more general, better by 7)");
  rival = {"stribeck_friction", "elbow", 1500.0};
  rival.stability = 0.25;
  CHECK(rival_words(rival, "elbow") == "stribeck friction (chosen on 25.0 % of the halves)");
}

TEST_CASE("sentence: the closest rival of all causes, and whose it is", "[report]") {
  Finding finding;
  finding.verdict = Verdict::kNamed;
  finding.causes = {cause("coulomb_friction", "elbow", {{"sublinear_friction", "elbow", 900.0}})};
  CHECK_THAT(
      sentence(finding),
      ContainsSubstring("; the next rival, sublinear friction at elbow, is worse by 900 in"));

  finding.causes.push_back(cause("actuator_lag", "wrist",
                                 {{"time_shift", "wrist", -3.0},  // more general: no rival
                                  {"actuator_delay", "wrist", 60.0}}));
  CHECK_THAT(
      sentence(finding),
      ContainsSubstring("; the next rival of actuator lag at wrist, actuator delay at wrist, "
                        "is worse by 60 in BIC"));

  finding.causes.back().rivals.pop_back();
  CHECK_THAT(sentence(finding), ContainsSubstring("of coulomb friction at elbow, sublinear"));

  finding.causes.front().rivals.clear();
  CHECK_THAT(sentence(finding), !ContainsSubstring("rival"));
}

TEST_CASE("sentence: what is left of a ball's path is not called the arm's", "[report]") {
  Finding finding;
  finding.verdict = Verdict::kUnknown;
  finding.series.emplace_back().joint = "elbow";
  finding.gain.before = finding.gain.after = 1.02;
  finding.ball.emplace();
  finding.ball->sigma = 0.001;
  finding.ball->extended_rms = 0.005;
  CHECK_THAT(sentence(finding), ContainsSubstring("an error of 5 times the camera's noise") &&
                                    !ContainsSubstring("units") && !ContainsSubstring("period"));
  finding.gain.before = finding.gain.after = 8.0;  // the arm's, which is worse
  CHECK_THAT(sentence(finding),
             ContainsSubstring("an error of 8 times the noise") && ContainsSubstring("units"));
}

}  // namespace
}  // namespace diffnea::sentence_test
