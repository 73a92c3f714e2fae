#include <cmath>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/compare.hpp>

namespace diffnea::compare_test {
namespace {

using Catch::Approx;
using Catch::Matchers::ContainsSubstring;

/// Two parameters that the data show as a + 2 b alone (variance s²), and c (variance 0.04).
IdentifyResult fit(double a, double b, double c, double s = 0.1) {
  IdentifyResult out;
  const double nan = std::nan("");
  out.parameters = {{"a", "kg", a, nan, 0, false, false, false},
                    {"b", "kg*m", b, nan, 0, false, false, false},
                    {"c", "N*m", c, 0.2, 0, true, false, false}};
  out.base_parameters = {{"a + 2 b", a + 2 * b, s, {0, 1}, {1, 2}}, {"c", c, 0.2, {2}, {1}}};
  out.errors.resize(1);
  out.errors[0].joint = "elbow";
  const double w = 1.0 / (s * s);
  out.model.posterior =
      Posterior{{"a", "b", "c"}, {a, b, c}, {w, 2 * w, 0, 2 * w, 4 * w, 0, 0, 0, 25}, {}};
  return out;
}

}  // namespace

TEST_CASE("compare: the standard error of a difference is that of both fits", "[identify]") {
  const Comparison c = compare(fit(1, 1, 0, 0.3), fit(1, 1.5, 0, 0.4));
  REQUIRE(c.base_parameters.size() == 2);
  CHECK(c.base_parameters[0].name == "a + 2 b");
  CHECK(c.base_parameters[0].std == Approx(0.5));
  CHECK(c.base_parameters[0].z == Approx(2.0));
  // Two tests: twice the two-sided tail of the normal distribution beyond 2.
  CHECK(c.base_parameters[0].p == Approx(2 * 0.04550026));
  CHECK_FALSE(c.changed);
}

TEST_CASE("compare: how an unseen direction was settled is no change", "[identify]") {
  const Comparison c = compare(fit(3, 0, 1), fit(1, 1, 1));  // a + 2 b is 3 in both
  CHECK_FALSE(c.changed);
  CHECK(c.base_parameters[0].p == Approx(1.0));
  CHECK(c.parameters.size() == 1);  // c alone is seen by itself
}

TEST_CASE("compare: a combination that the second fit does not see is not compared", "[identify]") {
  IdentifyResult second = fit(1, 1, 0);
  second.model.posterior->information = {100, 0, 0, 0, 0, 0, 0, 0, 25};  // a alone
  CHECK(compare(fit(1, 1, 0), second).not_comparable == 1);
}

TEST_CASE("compare: a held parameter moves the value of a combination, not its uncertainty",
          "[identify]") {
  // b is held, at another value than in the first fit; a has taken over what it leaves.
  IdentifyResult second = fit(2, 0.5, 0);
  second.parameters[1].fixed = true;
  second.model.posterior = Posterior{{"a", "c"}, {2, 0}, {100, 0, 0, 25}, {}};
  const Comparison c = compare(fit(1, 1, 0), second);
  CHECK(c.not_comparable == 0);
  CHECK_FALSE(c.changed);
  CHECK(c.base_parameters[0].std ==
        Approx(std::sqrt(c.base_parameters[0].name == "c" ? 0.08 : 0.02)));
}

TEST_CASE("compare: what each fit leaves, and how much wider the errors of one are", "[identify]") {
  IdentifyResult first = fit(1, 1, 0, 0.1), second = fit(1, 1, 0, 0.3);
  first.errors[0].train = 0.2;
  second.errors[0].train = 0.5;
  const Comparison c = compare(first, second);
  REQUIRE(c.left_over.size() == 1);
  CHECK(c.left_over[0].joint == "elbow");
  CHECK(c.left_over[0].before == 0.2);
  CHECK(c.left_over[0].after == 0.5);
  CHECK(c.std_ratio == Approx(std::sqrt(3.0)));  // of two: 1 of c, 3 of a + 2 b
  CHECK(compare(second, first).std_ratio == Approx(1.0 / std::sqrt(3.0)));
  second.errors[0].unit = "rad";  // fitted by the trajectory: no torque to compare
  CHECK(compare(first, second).left_over.empty());
}

TEST_CASE("compare: without a posterior equal expressions are compared", "[identify]") {
  IdentifyResult first = fit(1, 1, 0), second = fit(2, 1, 0);
  second.model.posterior.reset();
  const Comparison c = compare(first, second);
  CHECK(c.base_parameters[0].z == Approx(1.0 / std::sqrt(0.02)));
  CHECK(c.changed);
}

TEST_CASE("compare: parameters of one fit alone are named", "[identify]") {
  IdentifyResult second = fit(1, 1, 0);
  second.parameters[2].name = "d";
  second.model.posterior->names[2] = "d";
  const Comparison c = compare(fit(1, 1, 0), second);
  CHECK(c.only_before == std::vector<std::string>{"c"});
  CHECK(c.only_after == std::vector<std::string>{"d"});
  CHECK(c.not_comparable == 1);
}

TEST_CASE("compare: different robots are refused with both lists of joints", "[identify]") {
  IdentifyResult other = fit(1, 1, 0);
  other.errors[0].joint = "wrist";
  CHECK_THROWS_AS(compare(fit(1, 1, 0), other), DataError);
  CHECK_THROWS_WITH(compare(fit(1, 1, 0), other),
                    ContainsSubstring("elbow") && ContainsSubstring("wrist"));
}

}  // namespace diffnea::compare_test
