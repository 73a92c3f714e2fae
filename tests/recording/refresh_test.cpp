#include "diffnea/recording/refresh.hpp"

#include <cmath>

#include <catch2/catch_test_macros.hpp>

#include "recording/between.hpp"
#include "recording/fresh_positions.hpp"

namespace diffnea::refresh_test {

namespace {

double motion(double t) { return std::sin(9.0 * t); }

/// It on a grid, of which the sensor has a new value every so many rows.
Recording slow(int every, double step) {
  Recording r;
  r.joint_names = {"one"};
  r.has_tau = {true};
  constexpr long kRows = 400;
  r.time = VecX<double>::LinSpaced(kRows, 0.0, 0.399);
  r.q = r.tau = RowMatX<double>::Zero(kRows, 1);
  for (long k = 0; k < kRows; ++k) {
    const double t = 0.001 * static_cast<double>(k - k % every);
    r.q(k, 0) = step > 0.0 ? std::round(motion(t) / step) * step : motion(t);
    r.tau(k, 0) = r.q(k, 0);
  }
  return r;
}

}  // namespace

TEST_CASE("refresh: a sensor that is slower than the log is told from a coarse one",
          "[recording]") {
  CHECK(refresh_rows({slow(4, 1e-4)}) == std::vector<int>{4});
  CHECK(refresh_rows({slow(4, 1e-4)}, &Recording::tau) == std::vector<int>{4});
  CHECK(refresh_rows({slow(1, 1e-4)}) == std::vector<int>{1});
  // Values stay for several rows, and then move by one step of the grid.
  CHECK(refresh_rows({slow(1, 5e-2)}) == std::vector<int>{1});
}

TEST_CASE("refresh: the step of an encoder, by a log of few digits and fast motion",
          "[recording]") {
  const double step = 2.0 * 3.14159265358979 / 4096.0;
  VecX<double> q(600), changes(599);
  for (long k = 0; k < q.size(); ++k) {
    const double ticks = std::round(1.2 * std::sin(0.02 * static_cast<double>(k)) / step);
    q[k] = std::round(1e5 * ticks * step) * 1e-5;
    if (k > 0) changes[k - 1] = q[k] - q[k - 1];
  }
  const double found = quantisation_step({q.begin(), q.end()}, {changes.begin(), changes.end()});
  CHECK(std::abs(found - step) < 1e-3 * step);
}

TEST_CASE("refresh: polynomials between new values follow a motion that lines cut off",
          "[recording]") {
  const Recording r = slow(8, 0.0);
  VecX<double> lines = r.q.col(0), curve = lines, truth(lines.size());
  for (long k = 0; k < truth.size(); ++k) truth[k] = motion(0.001 * static_cast<double>(k));
  fill_stale(lines, 8);
  detail::curve_stale(curve, 8);
  const auto error = [&](const VecX<double>& q) {
    return (q - truth).segment(40, 300).cwiseAbs().maxCoeff();
  };
  CHECK(error(curve) < 1e-2 * error(lines));
}

TEST_CASE("refresh: rows at uneven times lose their repeats, in blocks as in one", "[recording]") {
  constexpr int kEvery = 4;
  Recording r = slow(kEvery, 0.0);
  for (long k = 0; k < r.rows(); ++k)
    r.time[k] = 0.001 * (static_cast<double>(k) + 0.2 * std::sin(static_cast<double>(k * k)));
  for (long k = 0; k < r.rows(); ++k) r.q(k, 0) = motion(r.time[k - k % kEvery]);
  detail::FreshPositions fresh({kEvery}, true);
  const RowMatX<double> whole = detail::FreshPositions({kEvery}, true).whole(r).q;
  double error = 0.0;
  for (long k = 40; k < 340; ++k)
    error = std::max(error, std::abs(whole(k, 0) - motion(r.time[k])));
  CHECK(error < 1e-6);
  long at = 0;
  const auto same = [&](const Recording& part) {
    for (long k = 0; k < part.rows(); ++k, ++at) CHECK(part.q(k, 0) == whole(at, 0));
  };
  for (long from = 0; from < r.rows(); from += 57) {
    Recording block;
    const long rows = std::min(57L, r.rows() - from);
    block.joint_names = r.joint_names;
    block.time = r.time.segment(from, rows);
    block.q = r.q.middleRows(from, rows);
    block.tau = r.tau.middleRows(from, rows);
    same(fresh.push(block));
  }
  same(fresh.finish());
  CHECK(at == r.rows());
}

TEST_CASE("refresh: between two new values lies the line through them", "[recording]") {
  VecX<double> channel(8);
  channel << 1.0, 1.0, 3.0, 3.0, 7.0, 7.0, 9.0, 9.0;
  VecX<double> filled = channel;
  fill_stale(filled, 2);
  VecX<double> expected(8);
  expected << 1.0, 2.0, 3.0, 5.0, 7.0, 8.0, 9.0, 10.0;
  CHECK(filled == expected);
  fill_stale(channel, 1);
  CHECK(channel[1] == 1.0);
}

}  // namespace diffnea::refresh_test
