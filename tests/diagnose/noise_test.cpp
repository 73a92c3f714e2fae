/// Noise of known autoregressions, and what its whitener makes of it.

#include "diagnose/noise.hpp"

#include <numeric>
#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

namespace noise_test {

using namespace diffnea;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr double kA1 = 0.6, kA2 = -0.3, kSigma = 0.2;
/// Standard errors that a draw may be off: one in 10^6 is, and the seeds are fixed.
constexpr double kSigmas = 5.0;

/// Second-order autoregression at each joint, stationary from the start.
VecX<double> autoregression(const Evidence& evidence, unsigned seed) {
  Rng rng(seed);
  VecX<double> out(evidence.rows());
  double e1 = 0.0, e2 = 0.0;
  for (int i = 0; i < 100; ++i) {
    const double e = kA1 * e1 + kA2 * e2 + kSigma * rng.normal();
    e2 = e1, e1 = e;
  }
  for (double& x : out) {
    x = kA1 * e1 + kA2 * e2 + kSigma * rng.normal();
    e2 = e1, e1 = x;
  }
  return out;
}

std::vector<bool> all(const Evidence& evidence) {
  return std::vector<bool>(static_cast<std::size_t>(evidence.rows()), true);
}

}  // namespace

TEST_CASE("estimate_noise: recovers an autoregression", "[diagnose]") {
  const test::SwingingEvidence evidence(160.0);
  const auto noise = estimate_noise(*evidence, autoregression(*evidence, 1), all(*evidence));
  REQUIRE(noise.size() == 2);
  const double n = static_cast<double>(evidence->times());
  REQUIRE(n > 3000.0);
  // √n (â − a) has the covariance σ² R⁻¹ (Ljung 1999, eq. 9.92), whose largest diagonal entry is
  // that of an infinite series: 1 + a₁² + a₂².
  const double coefficient = kSigmas * std::sqrt((1.0 + kA1 * kA1 + kA2 * kA2) / n);
  // Hamilton 1994, eq. 3.4.30.
  const double variance =
      kSigma * kSigma * (1.0 - kA2) / ((1.0 + kA2) * ((1.0 - kA2) * (1.0 - kA2) - kA1 * kA1));
  for (const JointNoise& joint : noise) {
    REQUIRE(joint.orders.size() == 9);
    const JointNoise::Prediction& best = joint.orders.back();
    REQUIRE(best.a.size() == 8);
    CHECK_THAT(best.a[0], WithinAbs(kA1, coefficient));
    CHECK_THAT(best.a[1], WithinAbs(kA2, coefficient));
    for (std::size_t k = 2; k < 8; ++k) CHECK_THAT(best.a[k], WithinAbs(0.0, coefficient));
    CHECK_THAT(best.sigma, WithinRel(kSigma, kSigmas / std::sqrt(2.0 * n)));
    // From one row before: the first autocorrelation, a₁/(1 − a₂).
    REQUIRE(joint.orders[1].a.size() == 1);
    CHECK_THAT(joint.orders[1].a[0], WithinAbs(kA1 / (1.0 - kA2), coefficient));
    CHECK(joint.orders[0].sigma == joint.rms);
    // A mean square has the relative variance 2 Σ ρ²/n, and Σ ρ² = 1.5 here.
    CHECK_THAT(joint.rms, WithinRel(std::sqrt(variance), kSigmas / std::sqrt(2.0 * n / 1.5)));
  }
}

TEST_CASE("estimate_noise: nothing is quieter than the noise that is assumed", "[diagnose]") {
  const test::SwingingEvidence evidence(80.0);
  const auto silent =
      estimate_noise(*evidence, VecX<double>::Zero(evidence->rows()), all(*evidence));
  const auto loud = estimate_noise(*evidence, autoregression(*evidence, 3), all(*evidence));
  for (std::size_t k = 0; k < silent.size(); ++k) {
    const double least = kLeastNoise * evidence->scale(static_cast<long>(k));
    CHECK_THAT(silent[k].rms, WithinRel(least, 1e-12));
    CHECK_THAT(silent[k].orders.back().sigma, WithinRel(least, 1e-12));  // white
    CHECK(silent[k].assumed == 1.0);
    CHECK_THAT(loud[k].assumed, WithinRel(std::pow(least / loud[k].rms, 2), 1e-12));
  }
  const Whitener quiet(*evidence, silent, {});
  CHECK_THAT(quiet.assumed_sum(), WithinRel(static_cast<double>(quiet.used_rows()), 1e-12));
}

TEST_CASE("estimate_noise: what repeats of the signals' noise counts as far as it is left",
          "[diagnose]") {
  const test::SwingingEvidence evidence(80.0);
  const VecX<double> silent = VecX<double>::Zero(evidence->rows());
  for (const double share : {0.3, 1.0, 10.0}) {  // left, over the signals' noise
    VecX<double> left(evidence->rows());
    for (long k = 0; k < 2; ++k)
      left.segment(k * evidence->times(), evidence->times())
          .setConstant(share * evidence->signal_noise(k));
    const auto noise = estimate_noise(*evidence, silent, all(*evidence), {},
                                      signals_noise(*evidence, left, all(*evidence)));
    for (std::size_t k = 0; k < noise.size(); ++k) {
      CAPTURE(share, k);
      const double least = kLeastNoise * evidence->scale(static_cast<long>(k));
      CHECK_THAT(noise[k].rms,
                 WithinRel(std::hypot(std::min(share, 1.0) *
                                          evidence->signal_noise(static_cast<long>(k)), least),
                           1e-12));
    }
  }
}

TEST_CASE("estimate_noise: rows that are not used do not count", "[diagnose]") {
  const test::SwingingEvidence evidence(80.0);
  VecX<double> residual = autoregression(*evidence, 2);
  std::vector<bool> used = all(*evidence);
  const long m = evidence->times();
  for (long i = m / 3; i < m / 2; ++i) used[static_cast<std::size_t>(i)] = false;
  const auto clean = estimate_noise(*evidence, residual, used);
  residual.segment(m / 3, m / 2 - m / 3).setConstant(1e6);
  const auto spoilt = estimate_noise(*evidence, residual, used);
  CHECK(spoilt[0].orders.back().a == clean[0].orders.back().a);
  CHECK(spoilt[0].rms == clean[0].rms);
}

TEST_CASE("estimate_noise: a constant is no noise, lost freedom makes more of it", "[diagnose]") {
  const test::SwingingEvidence evidence(80.0);
  const VecX<double> residual = autoregression(*evidence, 3);
  const auto plain = estimate_noise(*evidence, residual, all(*evidence));
  const auto shifted = estimate_noise(*evidence, (residual.array() + 5.0).matrix(), all(*evidence));
  const double half = 0.5 * static_cast<double>(evidence->times());
  const auto fitted = estimate_noise(*evidence, residual, all(*evidence), {half, half});
  // Rounding of 5² against 0.05, times rows.
  CHECK_THAT(shifted[0].rms, WithinRel(plain[0].rms, 1e-9));
  const auto seen = [](const JointNoise& n) { return n.rms * std::sqrt(1.0 - n.assumed); };
  CHECK_THAT(seen(fitted[0]), WithinRel(std::sqrt(2.0) * seen(plain[0]), 1e-9));
}

TEST_CASE("Whitener: makes independent rows of variance 1", "[diagnose]") {
  const test::SwingingEvidence evidence(160.0);
  const VecX<double> residual = autoregression(*evidence, 4);
  const Whitener whitener(*evidence, estimate_noise(*evidence, residual, all(*evidence)), {});
  const MatX<double> white = whitener(residual);
  const long m = evidence->times();
  for (long joint = 0; joint < 2; ++joint) {
    CAPTURE(joint);
    std::vector<double> kept;
    for (long i = 0; i < m; ++i) {
      const long row = joint * m + i;
      if (whitener.kept()[static_cast<std::size_t>(row)])
        kept.push_back(white(row, 0));
      else
        REQUIRE(white(row, 0) == 0.0);
    }
    const double n = static_cast<double>(kept.size());
    REQUIRE(n > 0.8 * static_cast<double>(m));  // rests at the turns alone
    for (std::size_t lag = 0; lag <= 8; ++lag) {
      CAPTURE(lag);
      double sum = 0.0;
      for (std::size_t i = lag; i < kept.size(); ++i) sum += kept[i] * kept[i - lag];
      // A variance has the standard error √(2/n), a covariance 1/√n.
      CHECK_THAT(sum / n, WithinAbs(lag == 0 ? 1.0 : 0.0, kSigmas * std::sqrt(2.0 / n)));
    }
  }
}

TEST_CASE("Whitener: a stretch begins with what fewer rows predict", "[diagnose]") {
  const test::SwingingEvidence evidence(40.0);
  std::vector<bool> used = all(*evidence);
  const long m = evidence->times(), gap = m / 2;
  used[static_cast<std::size_t>(gap)] = false;
  JointNoise noise;
  noise.orders = {{{}, 2.0}, {{0.5}, 1.0}, {{0.4, 0.2}, 0.5}};
  const Whitener whitener(*evidence, std::vector<JointNoise>(2, noise), used);
  CHECK_FALSE(whitener.kept()[static_cast<std::size_t>(gap)]);
  VecX<double> rows(evidence->rows());
  for (long i = 0; i < rows.size(); ++i) rows[i] = std::sin(0.1 * static_cast<double>(i));
  const MatX<double> white = whitener(rows);
  long first = gap + 1;
  while (first < m - 3 && !(whitener.kept()[static_cast<std::size_t>(first)] &&
                            whitener.kept()[static_cast<std::size_t>(first + 1)] &&
                            whitener.kept()[static_cast<std::size_t>(first + 2)]))
    ++first;
  if (first == gap + 1) {
    CHECK_THAT(white(first, 0), WithinRel(rows[first] / 2.0, 1e-12));
    CHECK_THAT(white(first + 1, 0), WithinRel(rows[first + 1] - 0.5 * rows[first], 1e-12));
    CHECK_THAT(white(first + 2, 0),
               WithinRel((rows[first + 2] - 0.4 * rows[first + 1] - 0.2 * rows[first]) / 0.5,
                         1e-12));
  }
  REQUIRE(first == gap + 1);  // it moves there
  long kept = 0;
  for (const bool k : whitener.kept()) kept += k;
  CHECK(kept == whitener.used_rows());
  CHECK(kept > evidence->rows() / 2);
}

TEST_CASE("repeatable_noise: what a period repeats is no noise", "[diagnose]") {
  const test::SwingingEvidence evidence(80.0, /*repeats=*/true);
  const long period = std::lround(test::kSwingPeriod / evidence->step());
  const long m = evidence->times();
  VecX<double> periodic(evidence->rows()), noise(evidence->rows());
  Rng rng(5);
  for (long i = 0; i < evidence->rows(); ++i) {
    const double phase = static_cast<double>((i % m) % period) / static_cast<double>(period);
    periodic[i] = 3.0 * std::sin(2.0 * M_PI * phase) + (phase < 0.3 ? 1.0 : -1.0);
    noise[i] = kSigma * rng.normal();
  }
  const VecX<double> both = repeatable_noise(*evidence, periodic + noise, test::kSwingPeriod);
  const VecX<double> alone = repeatable_noise(*evidence, noise, test::kSwingPeriod);
  REQUIRE(both.size() == evidence->rows());
  double squares = 0.0;
  long rows = 0;
  for (long i = 0; i < both.size(); ++i) {
    if (std::isnan(both[i])) continue;                // after the last whole period
    CHECK_THAT(both[i], WithinAbs(alone[i], 1e-12));  // rounding of numbers of order 1
    squares += both[i] * both[i];
    ++rows;
  }
  CHECK(rows >= evidence->rows() - 2 * (period - 1));
  // √(R/(R−1)) makes up for the mean that was taken: the variance is that of the noise.
  CHECK_THAT(squares / static_cast<double>(rows),
             WithinRel(kSigma * kSigma, kSigmas * std::sqrt(2.0 / static_cast<double>(rows))));
}

TEST_CASE("repeatable_noise: empty without a second period, or where it is no whole number of rows",
          "[diagnose]") {
  const test::SwingingEvidence evidence(20.0);
  const VecX<double> residual = VecX<double>::Ones(evidence->rows());
  CHECK(repeatable_noise(*evidence, residual, 0.0).size() == 0);
  CHECK(repeatable_noise(*evidence, residual, 20.0).size() == 0);
  CHECK(repeatable_noise(*evidence, residual, 4.5 * evidence->step()).size() == 0);
}

namespace {

/// The residual beside smooth functions where a spring is missing at both joints, of the first
/// `rows` of each joint, beside all of the base's columns or beside none.
Smoothed beside_spring(const Evidence& evidence, long rows, bool beside_base = true) {
  std::vector<bool> used(static_cast<std::size_t>(evidence.rows()), false);
  const long m = evidence.times();
  VecX<double> residual(evidence.rows());
  Rng rng(6);
  for (long k = 0; k < 2; ++k)
    for (long i = 0; i < m; ++i) {
      used[static_cast<std::size_t>(k * m + i)] = i < rows;
      residual[k * m + i] = 5.0 * evidence.q(k)(i, evidence.joints()[static_cast<std::size_t>(k)]) +
                            kSigma * rng.normal();
    }
  std::vector<int> free(beside_base ? static_cast<std::size_t>(evidence.base().cols()) : 0);
  std::iota(free.begin(), free.end(), 0);
  return beside_smooth_functions(evidence, free, VecX<double>::Zero(evidence.base().cols()),
                                 residual, used, /*lost=*/2.0);
}

}  // namespace

TEST_CASE("beside_smooth_functions: a spring that is missing is no noise, of few rows neither",
          "[diagnose]") {
  const test::SwingingEvidence evidence(60.0);
  const long rows = GENERATE(1200L, 150L, 80L);
  const bool beside_base = GENERATE(true, false);
  REQUIRE(rows < evidence->times());
  const Smoothed s = beside_spring(*evidence, rows, beside_base);
  CHECK(s.blind.empty());
  for (long k = 0; k < 2; ++k) {
    CAPTURE(rows, k, s.lost[static_cast<std::size_t>(k)]);
    const double squares = s.left.segment(k * evidence->times(), rows).squaredNorm();
    const double freedom = static_cast<double>(rows) - s.lost[static_cast<std::size_t>(k)];
    CHECK_THAT(squares / freedom, WithinRel(kSigma * kSigma, kSigmas * std::sqrt(2.0 / freedom)));
  }
}

TEST_CASE("beside_smooth_functions: too few rows to tell are told of", "[diagnose]") {
  const test::SwingingEvidence evidence(60.0);
  const Smoothed s = beside_spring(*evidence, 40);
  CHECK(s.blind == std::vector<long>{0, 1});
  CHECK(s.lost == std::vector<double>{2.0, 2.0});
  CHECK(s.left.head(40).norm() > 10.0 * kSigma * std::sqrt(40.0));
}

}  // namespace noise_test
