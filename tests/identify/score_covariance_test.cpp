/// The middle of the sandwich against its definition, pair of rows by pair of rows, and what it
/// makes of weighted rows against the textbook's variance of an M-estimator.

#include "identify/score_covariance.hpp"

#include <cmath>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/core/random.hpp>

#include "support/matrix_near.hpp"

namespace score_covariance_test {

using namespace diffnea;

namespace {

/// Sums of 1e3 products of order 1e2: rounding leaves 1e-10 of them.
constexpr double kRounding = 1e-9;

void add_row(JointRows& rows, int run, double time, const std::vector<double>& values) {
  rows.values.insert(rows.values.end(), values.begin(), values.end());
  rows.time.push_back(time);
  rows.run.push_back(run);
  rows.velocity.push_back(0.0);
  ++rows.factored[run];
}

}  // namespace

TEST_CASE("score covariance: Bartlett's sum over lags of time, run by run", "[identify]") {
  Rng rng(3);
  JointRows rows{.width = 3, .step = 0.02};
  for (int run = 0; run < 2; ++run)
    for (long k = 0; k < (run == 0 ? 300 : 60); ++k) {
      const bool rests = k % 50 < 7 || (k > 120 && k < 190);  // shorter and longer than the lags
      if (!rests)
        add_row(rows, run, 5.0 + 0.02 * static_cast<double>(k),
                {rng.normal(), rng.normal(), rng.normal()});
    }
  const VecX<double> x = VecX<double>::LinSpaced(2, -0.3, 0.8);
  const double sigma = 0.7;
  // Σ over all pairs of rows, each run times its weight; lags of √(rows that were factored).
  const auto sum_over_pairs = [&](double factored, const std::vector<double>& weight) {
    const long n = static_cast<long>(rows.time.size()),
               lags = static_cast<long>(std::sqrt(factored));
    MatX<double> out = MatX<double>::Zero(2, 2);
    for (long a = 0; a < n; ++a)
      for (long b = 0; b < n; ++b) {
        const long lag = std::abs(std::lround((rows.time[a] - rows.time[b]) / rows.step));
        if (rows.run[a] != rows.run[b] || lag > lags) continue;
        const VecX<double> ya = rows.rows().row(a).head(2), yb = rows.rows().row(b).head(2);
        const double ra = ya.dot(x) - rows.rows()(a, 2), rb = yb.dot(x) - rows.rows()(b, 2);
        out += weight[static_cast<std::size_t>(rows.run[a])] *
               (1.0 - static_cast<double>(lag) / static_cast<double>(lags + 1)) * ra * rb /
               std::pow(sigma, 4) * ya * yb.transpose();
      }
    return out;
  };
  const MatX<double> T = MatX<double>::Identity(3, 3);
  auto all = static_cast<double>(rows.time.size());
  CHECK_THAT(score_covariance(rows, T, x, sigma),
             test::MatrixNear(sum_over_pairs(all, {1.0, 1.0}), kRounding));

  // Where half of a run was not kept, what was kept counts twice.
  all += static_cast<double>(rows.factored[1]);
  rows.factored[1] *= 2;
  CHECK_THAT(score_covariance(rows, T, x, sigma),
             test::MatrixNear(sum_over_pairs(all, {1.0, 2.0}), kRounding));

  // A run of which nothing was kept counts like the others.
  rows.factored[2] = 500;
  const double share = (all + 500.0) / all;
  CHECK_THAT(score_covariance(rows, T, x, sigma),
             test::MatrixNear(sum_over_pairs(all + 500.0, {share, 2.0 * share}), kRounding));
}

TEST_CASE("score covariance: of weighted rows it gives the variance of an M-estimator",
          "[identify]") {
  // Huber's mean of unit normals at k = 1.345 has 1/0.95 of the variance of their mean, 1/n.
  constexpr double kHuber = 1.345;
  constexpr long kRows = 100'000;
  Rng rng(5);
  JointRows rows{.width = 2, .step = 1.0};
  double information = 0.0;  // Σ w y²
  for (long k = 0; k < kRows; ++k) {
    const double r = rng.normal();
    add_row(rows, 0, 1e4 * static_cast<double>(k), {1.0, r});  // apart: no lag
    information += std::min(1.0, kHuber / std::abs(r));
  }
  const auto huber = [](double u) {
    const double a = std::abs(u);
    return a <= kHuber ? Influence{} : Influence{kHuber / a, 0.0};
  };
  const MatX<double> T = MatX<double>::Identity(2, 2);
  const double meat = score_covariance(rows, T, VecX<double>::Zero(1), 1.0, huber)(0, 0);
  const double variance = kRows * meat / (information * information);
  CHECK(std::abs(variance - 1.0 / 0.95) < 0.02);  // 1e5 draws: ± 0.5 %
}

}  // namespace score_covariance_test
