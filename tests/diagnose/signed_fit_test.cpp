/// signed_fit() against all ways to hold parameters at zero.

#include "diagnose/signed_fit.hpp"

#include <Eigen/QR>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/core/random.hpp>

namespace signed_fit_test {

using namespace diffnea;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

/// signed_fit damps the normal equations by 1e-10, relative: gains change by that times the
/// condition number, some 1e2 for ten rows a column.
constexpr double kDamping = 1e-7;

struct Problem {
  MatX<double> G;
  VecX<double> r;
  std::vector<bool> nonnegative;
};

Problem draw(unsigned seed, long columns) {
  Rng rng(seed);
  Problem p;
  p.G.resize(10 * columns, columns);
  p.r.resize(10 * columns);
  for (double& x : p.G.reshaped()) x = rng.normal();
  for (double& x : p.r) x = rng.normal();
  for (long k = 0; k < columns; ++k) {
    p.nonnegative.push_back(rng.uniform() < 0.6);
    p.G.col(k) *= std::pow(10.0, rng.uniform(-3.0, 3.0));  // units differ
  }
  return p;
}

/// The best of all fits with some of the signed parameters at zero whose others have their sign.
SignedFit brute_force(const Problem& p) {
  SignedFit best;
  best.x = VecX<double>::Zero(p.G.cols());
  for (unsigned mask = 0; mask < 1u << p.G.cols(); ++mask) {
    std::vector<int> on;
    bool possible = true;
    for (int k = 0; k < p.G.cols(); ++k)
      if (mask & 1u << k)
        on.push_back(k);
      else
        possible = possible && p.nonnegative[static_cast<std::size_t>(k)];
    if (!possible || on.empty()) continue;
    const MatX<double> some = p.G(Eigen::all, on);
    const VecX<double> x = some.colPivHouseholderQr().solve(p.r);
    for (std::size_t i = 0; i < on.size(); ++i)
      possible = possible &&
                 !(p.nonnegative[static_cast<std::size_t>(on[i])] && x[static_cast<long>(i)] < 0.0);
    const double gain = p.r.squaredNorm() - (p.r - some * x).squaredNorm();
    if (!possible || gain <= best.gain) continue;
    best.gain = gain;
    best.x.setZero();
    best.x(on) = x;
  }
  return best;
}

}  // namespace

TEST_CASE("signed_fit: the best of all sign patterns", "[diagnose]") {
  const unsigned seed = GENERATE(range(0u, 60u));
  const long columns = 1 + static_cast<long>(seed % 6);
  CAPTURE(seed, columns);
  const Problem p = draw(seed, columns);
  const SignedFit found = signed_fit(p.G.transpose() * p.G, p.G.transpose() * p.r, p.nonnegative);
  const SignedFit best = brute_force(p);
  CHECK_THAT(found.gain, WithinRel(best.gain, kDamping) || WithinAbs(0.0, kDamping));
  for (long k = 0; k < columns; ++k) {
    const double unit = p.G.col(k).norm();
    CHECK_THAT(unit * found.x[k], WithinAbs(unit * best.x[k], 1e-6 * p.r.norm()));
    if (p.nonnegative[static_cast<std::size_t>(k)]) CHECK(found.x[k] >= 0.0);
  }
}

TEST_CASE("signed_fit: the same from any start that keeps the signs", "[diagnose]") {
  const unsigned seed = GENERATE(range(200u, 240u));
  CAPTURE(seed);
  const Problem p = draw(seed, 6);
  const MatX<double> K = p.G.transpose() * p.G;
  const VecX<double> b = p.G.transpose() * p.r;
  Rng rng(seed);
  VecX<double> start(6);
  for (long k = 0; k < 6; ++k) {
    start[k] = rng.normal() / p.G.col(k).norm();
    if (p.nonnegative[static_cast<std::size_t>(k)]) start[k] = std::max(start[k], 0.0);
  }
  const SignedFit far = signed_fit(K, b, p.nonnegative, start);
  const SignedFit zero = signed_fit(K, b, p.nonnegative);
  CHECK_THAT(far.gain, WithinRel(zero.gain, kDamping) || WithinAbs(0.0, kDamping));
  for (long k = 0; k < 6; ++k)
    CHECK_THAT(p.G.col(k).norm() * far.x[k],
               WithinAbs(p.G.col(k).norm() * zero.x[k], 1e-6 * p.r.norm()));
}

TEST_CASE("signed_fit: columns twice count once", "[diagnose]") {
  const unsigned seed = GENERATE(range(100u, 120u));
  CAPTURE(seed);
  Problem p = draw(seed, 3);
  const SignedFit once = signed_fit(p.G.transpose() * p.G, p.G.transpose() * p.r, p.nonnegative);
  p.G.conservativeResize(Eigen::NoChange, 4);
  p.G.col(3) = 2.0 * p.G.col(1);
  p.nonnegative.push_back(p.nonnegative[1]);
  const SignedFit twice = signed_fit(p.G.transpose() * p.G, p.G.transpose() * p.r, p.nonnegative);
  CHECK_THAT(twice.gain, WithinRel(once.gain, 1e-6) || WithinAbs(0.0, 1e-6));
}

TEST_CASE("signed_fit: nothing is gained against every sign", "[diagnose]") {
  const MatX<double> K = MatX<double>::Identity(3, 3);
  const SignedFit fit = signed_fit(K, VecX<double>::Constant(3, -1.0), {true, true, true});
  CHECK(fit.x.isZero(0.0));
  CHECK(fit.gain == 0.0);
}

}  // namespace signed_fit_test
