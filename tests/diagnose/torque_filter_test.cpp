#include "diagnose/torque_filter.hpp"

#include <algorithm>
#include <cmath>
#include <diffnea/core/random.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>

namespace diffnea::torque_filter_test {

namespace {

constexpr double kStep = 0.004;  ///< between samples [s]
constexpr double kInertia = 0.2, kStiffness = 1.5, kDamping = 0.1;
constexpr double kDensity = 1e-4 * kStep;  ///< noise of 0.01 N·m a sample
constexpr double kEncoder = 2e-4;

JointEquation equation(long samples) {
  JointEquation out(samples);
  out.inertia.setConstant(kInertia);
  out.stiffness.setConstant(kStiffness);
  out.damping.setConstant(kDamping);
  out.density.setConstant(kDensity);
  out.variance.setConstant(kEncoder * kEncoder);
  return out;
}

/// Positions beside a path under a torque, by steps a hundred times as fine.
VecX<double> moved(const VecX<double>& torque, double q, double v, Rng* noise) {
  constexpr int kFine = 100;
  constexpr double kFineStep = kStep / kFine;
  VecX<double> out(torque.size());
  for (long k = 0; k < torque.size(); ++k) {
    out[k] = q + (noise ? kEncoder * noise->normal() : 0.0);
    const double next = torque[std::min(k + 1, torque.size() - 1)];
    for (int i = 0; i < kFine; ++i) {
      const double at = (i + 0.5) / kFine;
      double f = (1.0 - at) * torque[k] + at * next - kStiffness * q - kDamping * v;
      if (noise) f += std::sqrt(kDensity / kFineStep) * noise->normal();
      v += f / kInertia * kFineStep;
      q += v * kFineStep;
    }
  }
  return out;
}

VecX<double> push_and_rest(long samples) {
  VecX<double> out(samples);
  for (long k = 0; k < samples; ++k)
    out[k] = 0.4 * std::sin(6.0 * kStep * static_cast<double>(k)) *
             std::sin(1.1 * kStep * static_cast<double>(k));
  return out;
}

}  // namespace

TEST_CASE("torque filter: what a torque moves is that torque's rows", "[diagnose]") {
  const int every = GENERATE(1, 4);
  const VecX<double> push = push_and_rest(1000);
  const TorqueFilter filter(equation(push.size()), kStep, every);
  const VecX<double> shown = filter.shown(moved(push, 0.0, 0.0, nullptr)),
                     rows = filter(push).col(0);
  REQUIRE(rows.size() == 1000 / every);
  // The log holds the torque that a model needs: that which moved the joint, with the other sign.
  // Steps of the test and of the filter are of order one and two.
  CHECK((shown + rows).norm() < 5e-3 * rows.norm());
}

TEST_CASE("torque filter: torques in pieces give the rows of the whole", "[diagnose]") {
  const long samples = 103;
  const TorqueFilter filter(equation(samples), kStep, 4);
  RowMatX<double> torque(samples, 3);
  Rng rng(5);
  for (long k = 0; k < samples; ++k)
    for (long c = 0; c < 3; ++c) torque(k, c) = rng.normal();
  const MatX<double> whole = filter(torque);
  MatX<double> pieces(filter.rows(), 3);
  TorqueFilter::State state;
  for (long from = 0; from < samples; from += 10) {
    const long count = std::min(10L, samples - from);
    filter.push(torque.middleRows(from, count),
                from + count < samples ? torque.row(from + count).data() : nullptr, state, pieces);
  }
  CHECK(whole.rows() == 25);
  CHECK(whole == pieces);
}

TEST_CASE("torque filter: of its signals' noise rows are white and of variance 1, in runs of 0.4 s",
          "[diagnose]") {
  constexpr long kSamples = 100;
  constexpr int kRuns = 400, kEvery = 2;
  const TorqueFilter filter(equation(kSamples), kStep, kEvery);
  Rng rng(11);
  const VecX<double> none = VecX<double>::Zero(kSamples);
  const VecX<double> column = filter(push_and_rest(kSamples)).col(0);
  double squares = 0.0, products = 0.0, rows = 0.0, z = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    // First states of any size.
    const VecX<double> left =
        filter.shown(moved(none, 1e-2 * rng.normal(), 1e-2 * rng.normal(), &rng));
    for (long i = 2; i < left.size(); ++i) {
      squares += left[i] * left[i];
      products += left[i] * left[i - 1];
      rows += 1.0;
    }
    z += std::pow(column.dot(left), 2) / column.squaredNorm();
  }
  // Standard errors: √(2/rows) and √(1/rows), and √(2/runs) of the estimates' χ².
  CHECK(std::abs(squares / rows - 1.0) < 4.0 * std::sqrt(2.0 / rows) + 0.01);
  CHECK(std::abs(products / rows) < 4.0 / std::sqrt(rows) + 0.01);
  CHECK(std::abs(z / kRuns - 1.0) < 4.0 * std::sqrt(2.0 / kRuns));
}

}  // namespace diffnea::torque_filter_test
