/// Standard errors of a fit to simulated windows.

#include <algorithm>
#include <cmath>

#include <diffnea/core/parallel.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"
#include "core/statistics.hpp"
#include "identify/motion_fit.hpp"

namespace diffnea {

double MotionFitter::correlation(const std::vector<MotionWindow>& windows) const {
  const long n = problem_.sigma.size();
  Workers simulators = workers_at(now_.x, now_.shape, {});
  std::vector<double> sum(windows.size(), 0.0), rows(windows.size(), 0.0);
  parallel_for(windows.size(), simulators.size(), [&](std::size_t i, std::size_t t) {
    const MotionWindow& w = windows[i];
    const MotionStretch& stretch = problem_.stretches[w.stretch];
    const RowMatX<double> q = simulators[t]->positions(stretch, w);
    for (long j = 0; j < n; ++j) {
      std::vector<double> r;
      double squares = 0.0;
      for (long k = 0; k < w.rows; ++k) {
        const double e = (q(k, j) - stretch.q(w.first + k, j)) / problem_.sigma[j];
        if (!std::isfinite(e)) continue;
        r.push_back(e);
        squares += e * e;
      }
      sum[i] += squares * correlation_time(r);
      rows[i] += static_cast<double>(r.size());
    }
  });
  double all = 0.0, count = 0.0;
  for (std::size_t i = 0; i < windows.size(); ++i) {
    all += sum[i];
    count += rows[i];
  }
  return all / std::max(count, 1.0);
}

/// How far off the model is, in units of what independent noise would leave: that much less the
/// positions tell of its parameters.
double MotionFitter::blur(const std::vector<MotionWindow>& windows) const {
  return std::sqrt(std::max(correlation(windows), 1.0));
}

void MotionFitter::set_covariance(const std::vector<MotionWindow>& windows) {
  // Blocks of time that are left out in turn, at least: their spread is known to a sixth then.
  constexpr std::size_t kBlocks = 20;
  const int f = static_cast<int>(free_.size());
  const long columns =
      static_cast<long>(problem_.layout.linear.size() + problem_.layout.shape.size());
  const std::size_t each =
      (kBlocks + windows.size() - 1) / std::max<std::size_t>(windows.size(), 1);
  const int states = 2 * static_cast<int>(problem_.sigma.size());
  // Rows of each window, in blocks and as a whole.
  std::vector<std::vector<TriangularFactor>> blocks(
      windows.size(), std::vector<TriangularFactor>(each, TriangularFactor(states + f)));
  std::vector<ReducedWindow> wholes(windows.size());
  const auto reduced = [&](std::size_t window, bool finite, std::size_t without) {
    TriangularFactor rows(states + f);
    for (std::size_t b = 0; b < each; ++b)
      if (b != without) rows.add(blocks[window][b]);
    return eliminate(rows, states, finite);
  };
  Workers simulators = workers();
  parallel_for(windows.size(), simulators.size(), [&](std::size_t i, std::size_t t) {
    const bool finite = simulators[t]->linearise(problem_.stretches[windows[i].stretch], windows[i],
                                                 problem_.sigma, blocks[i]);
    wholes[i] = reduced(i, finite, each);
  });
  // (H + Λ) = RᵀR: directions that only the prior holds are beyond what H itself resolves.
  TriangularFactor all(f);
  for (const ReducedWindow& w : wholes)
    if (w.finite) all.add(w.rows);
  RowMatX<double> prior = RowMatX<double>::Zero(f, f + 1);
  blur_ = blur(windows);
  for (int k = 0; k < f; ++k) prior(k, k) = weak(free_[static_cast<std::size_t>(k)]);
  all.add(prior);
  const MatX<double> R = all.R(), one = MatX<double>::Identity(f, f);
  const auto over_R = [&](const MatX<double>& of) -> MatX<double> {
    return R.triangularView<Eigen::Upper>().solve(of);
  };
  const MatX<double> inverse = over_R(one);
  // Jackknife: one Gauss–Newton step from here to where the fit to the other blocks would be.
  VecX<double> spread = VecX<double>::Zero(f);
  double count = 0.0;
  for (std::size_t i = 0; i < windows.size(); ++i) {
    if (!wholes[i].finite) continue;
    const MatX<double> A = wholes[i].rows.leftCols(f) * inverse;
    for (std::size_t b = 0; b < each; ++b) {
      const ReducedWindow rest = reduced(i, true, b);
      const MatX<double> B = rest.rows.leftCols(f) * inverse;
      const VecX<double> gradient =
          B.transpose() * rest.rows.col(f) - A.transpose() * wholes[i].rows.col(f);
      const MatX<double> H = one - A.transpose() * A + B.transpose() * B;
      spread += over_R(H.ldlt().solve(gradient)).cwiseAbs2();
      count += 1.0;
    }
  }
  // The variance of Student's t where blocks are few.
  if (count > 3.0) spread *= (count - 1.0) / count * (count - 1.0) / (count - 3.0);
  MatX<double> of_free = inverse * inverse.transpose();
  // No parameter is known better than independent noise lets it be.
  const VecX<double> wider = spread.cwiseQuotient(of_free.diagonal()).cwiseMax(1.0).cwiseSqrt();
  of_free = wider.asDiagonal() * of_free * wider.asDiagonal();
  now_.covariance = MatX<double>::Zero(columns, columns);
  now_.covariance(free_, free_) = of_free;
  const long p = static_cast<long>(problem_.layout.linear.size());
  for (long c = p; c < columns; ++c)
    if (problem_.layout.shape[static_cast<std::size_t>(c - p)].logarithmic) {
      now_.covariance.row(c) *= now_.shape[c - p];
      now_.covariance.col(c) *= now_.shape[c - p];
    }
}

}  // namespace diffnea
