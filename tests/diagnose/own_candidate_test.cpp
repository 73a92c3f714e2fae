/// Effects that a caller brings along, beside those of the catalogue.

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/diagnose/diagnose.hpp>

#include "support/three_links.hpp"

namespace own_candidate_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

/// sin(q_yaw) q_shoulder at the elbow, which no effect of the catalogue is.
double hidden_torque(double yaw, double shoulder) { return std::sin(yaw) * shoulder; }

/// The robot would have needed that much more for the same motion, about the middle of each row.
Recording with_hidden_torque(Recording r, double size) {
  for (long k = 0; k + 1 < r.rows(); ++k)
    r.tau(k, 2) +=
        size * hidden_torque(0.5 * (r.q(k, 0) + r.q(k + 1, 0)), 0.5 * (r.q(k, 1) + r.q(k + 1, 1)));
  return r;
}

OwnCandidate own_candidate() {
  OwnCandidate out{
      "crosswise", "elbow", {{.name = "size", .unit = "N*m/rad", .unit_prismatic = "N/m"}}, {}};
  out.columns = [](const JointSeries& x) {
    RowMatX<double> column(x.rows(), 1);
    for (long k = 0; k < x.rows(); ++k) column(k, 0) = hidden_torque(x.q(k, 0), x.q(k, 1));
    return column;
  };
  return out;
}

}  // namespace

TEST_CASE("diagnose: an own candidate is named where it acts, and not where it does not",
          "[diagnose]") {
  constexpr double kSize = 0.5;  // [N·m/rad]
  DiagnoseOptions options;
  options.candidates = {own_candidate()};
  SECTION("it acts") {
    const Finding finding =
        diagnose(arm().nominal, {with_hidden_torque(arm().recorded({kCoulomb}, 1), kSize)},
                 {with_hidden_torque(arm().recorded({kCoulomb}, 2), kSize)}, options);
    CAPTURE(finding.sentence);
    REQUIRE(finding.causes.size() == 2);
    const auto own = std::ranges::find(finding.causes, "crosswise", &Cause::effect);
    REQUIRE(own != finding.causes.end());
    CHECK(own->where == "elbow");
    REQUIRE(own->parameters.size() == 1);
    CHECK(own->parameters[0].name == "size");
    CHECK(own->parameters[0].unit == "N*m/rad");
    // The interval of one draw: 4 standard errors leave out 1 in 10 000.
    CHECK(std::abs(own->parameters[0].value - kSize) < 4.0 * own->parameters[0].std);
    CHECK(std::ranges::any_of(finding.causes,
                              [](const Cause& c) { return c.effect == "coulomb_friction"; }));
    REQUIRE(finding.model.effects.size() == 1);  // which holds the other one alone, and says so
    CHECK(std::ranges::any_of(finding.notes, [](const std::string& note) {
      return note.find("crosswise") != std::string::npos;
    }));
    CHECK_THAT(finding.simulated.reason, ContainsSubstring("crosswise"));
  }
  SECTION("it does not") {
    const Finding finding =
        diagnose(arm().nominal, {arm().recorded({}, 1)}, {arm().recorded({}, 2)}, options);
    CAPTURE(finding.sentence);
    CHECK(finding.verdict == Verdict::kNone);
    CHECK(std::ranges::any_of(finding.candidates, [](const CandidateScore& c) {
      return c.effect == "crosswise" && c.delta_bic < 10.0;
    }));
  }
}

TEST_CASE("diagnose: an own candidate that cannot be used is refused by name", "[diagnose]") {
  const Recording train = arm().recorded({}, 1);
  const auto refusal = [&](auto change) {
    DiagnoseOptions options;
    options.candidates = {own_candidate()};
    change(options.candidates.front());
    try {
      diagnose(arm().nominal, {train}, {}, options);
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const auto refused = [&](auto change, const char* part) {
    const std::string message = refusal(change);
    CHECK_THAT(message, ContainsSubstring("crosswise"));
    CHECK_THAT(message, ContainsSubstring(part));
  };
  refused(
      [](OwnCandidate& c) {
        c.columns = [](const JointSeries& x) { return RowMatX<double>(x.rows(), 2); };
      },
      "shape");
  refused(
      [](OwnCandidate& c) {
        c.columns = [](const JointSeries& x) {
          return RowMatX<double>::Constant(x.rows(), 1, std::numeric_limits<double>::quiet_NaN());
        };
      },
      "NaN");
  refused([](OwnCandidate& c) { c.parameters[0].linear = false; }, "linear");
  refused([](OwnCandidate& c) { c.parameters.clear(); }, "parameter");
  refused([](OwnCandidate& c) { c.columns = nullptr; }, "function");
  CHECK_THAT(refusal([](OwnCandidate& c) { c.where = "knee"; }), ContainsSubstring("elbow"));
  CHECK_THAT(refusal([](OwnCandidate& c) { c.name = "cogging"; }), ContainsSubstring("catalogue"));
}

}  // namespace own_candidate_test
