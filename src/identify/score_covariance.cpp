#include "identify/score_covariance.hpp"

#include <algorithm>
#include <cmath>

namespace diffnea {

MatX<double> score_covariance(const JointRows& kept, const MatX<double>& T, const VecX<double>& x,
                              double sigma, double all_rows) {
  const long rows = std::min<long>(static_cast<long>(kept.time.size()), 4000), p = kept.width - 1;
  if (rows < 2) return MatX<double>::Zero(p, p);
  const MatX<double> linear = kept.rows().topRows(rows) * T;
  const MatX<double> Y = linear.leftCols(p);
  const VecX<double> r = Y * x - linear.col(p);
  const MatX<double> scores = r.asDiagonal() * Y / (sigma * sigma);
  MatX<double> meat = scores.transpose() * scores;
  const long lags =
      std::min<long>(static_cast<long>(std::sqrt(static_cast<double>(rows))), rows - 1);
  for (long l = 1; l <= lags; ++l) {
    const double w = 1.0 - static_cast<double>(l) / static_cast<double>(lags + 1);
    const MatX<double> c = scores.topRows(rows - l).transpose() * scores.bottomRows(rows - l);
    meat += w * (c + c.transpose());
  }
  return meat * (all_rows / static_cast<double>(rows));
}

}  // namespace diffnea
