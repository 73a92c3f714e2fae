/// identify() of a ball: rows that cannot be true are flagged with their times, and not fitted.

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/identify.hpp>

#include "support/ball_fits.hpp"

namespace ball_identify_flags_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

bool flagged_near(const IdentifyResult& result, double time, double within = 0.006) {
  return std::ranges::any_of(result.ball->flagged, [&](const BallFlag& f) {
    return f.channel == "ball" && std::abs(f.time - time) < within;
  });
}

}  // namespace

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
  CHECK_THAT(find(result, "string.length").value,
             WithinAbs(find(without, "string.length").value, 1e-4));
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

}  // namespace ball_identify_flags_test
