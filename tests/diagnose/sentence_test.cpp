#include <cmath>
#include <tuple>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include "diagnose/chi_square.hpp"
#include "diagnose/sentence.hpp"

namespace diffnea {
namespace {

using Catch::Matchers::ContainsSubstring;

Cause cause(const char* effect, const char* where, std::vector<Rival> rivals) {
  Cause out;
  out.effect = effect;
  out.where = where;
  out.rivals = std::move(rivals);
  return out;
}

TEST_CASE("sentence: what fits and is refuted by parts of the same recording is not called nothing",
          "[diagnose]") {
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

TEST_CASE("sentence: where few effects were tried, it speaks of those", "[diagnose]") {
  Finding finding;
  finding.verdict = Verdict::kNone;
  CHECK(sentence(finding, Tried::kSome) ==
        "None of the effects that were tried improves the model beyond its noise.");
  finding.verdict = Verdict::kUnknown;
  CHECK_THAT(sentence(finding), ContainsSubstring("not in the catalogue"));
  CHECK_THAT(
      sentence(finding, Tried::kSome),
      ContainsSubstring("none of the effects that were tried") && !ContainsSubstring("catalogue"));
  finding.verdict = Verdict::kNotIdentifiable;
  CHECK_THAT(sentence(finding, Tried::kSome), ContainsSubstring("absorbed by the base"));
  finding.refused = {{"joint_elasticity", "all", "not tried: needs a motion that repeats", 0.0}};
  CHECK(sentence(finding, Tried::kNothing) ==
        "Nothing was tried: joint elasticity needs a motion that repeats.");
}

TEST_CASE("sentence: chances of noise are those of tables", "[diagnose]") {
  // Quantiles with five and three digits (Abramowitz, Stegun 1964, table 26.8).
  constexpr double kDigits = 1e-3;
  for (const auto& [freedom, x, chance] : {std::tuple{1, 3.84146, 0.05},
                                           {2, 5.99147, 0.05},
                                           {3, 7.81473, 0.05},
                                           {4, 13.2767, 0.01},
                                           {5, 20.515, 0.001},
                                           {10, 18.3070, 0.05}})
    CHECK(std::abs(chi_square_tail(x, freedom) - chance) < kDigits * chance);
  for (const int freedom : {1, 2, 7}) CHECK(chi_square_tail(0.0, freedom) == 1.0);
}

TEST_CASE("sentence: the closest rival of all causes, and whose it is", "[diagnose]") {
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

TEST_CASE("sentence: what is left of a ball's path is not called the arm's", "[diagnose]") {
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
}  // namespace diffnea
