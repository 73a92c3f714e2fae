#include "identify/score_covariance.hpp"

#include <algorithm>
#include <cmath>

namespace diffnea {
namespace {

/// Bartlett's weights 1 − |l|/(L + 1) are those of sums over windows of L + 1 rows:
/// Σ_|l|≤L (1 − |l|/(L+1)) Σ_k s_k s_{k+l}ᵀ = Σ_m w_m w_mᵀ/(L+1), w_m = s_{m−L} + … + s_m, one for
/// every m at which a window holds a row. Linear in the rows, whatever L.
class WindowSums {
 public:
  WindowSums(long lags, long columns)
      : lags_(lags), sum_(VecX<double>::Zero(columns)), block_(kBlock, columns) {
    out_ = MatX<double>::Zero(columns, columns);
  }

  /// @param at  (rows) on the grid of time, ascending, of one run  @param scores  (rows, columns)
  void add(const std::vector<long>& at, const Eigen::Ref<const RowMatX<double>>& scores) {
    std::size_t next = 0, oldest = 0;
    for (long m = at.front(); oldest < at.size(); ++m) {
      if (oldest == next) {  // the window is empty, and what rounding left in it goes
        sum_.setZero();
        m = at[next];
      }
      for (; next < at.size() && at[next] <= m; ++next)
        sum_ += scores.row(static_cast<long>(next)).transpose();
      for (; oldest < next && at[oldest] < m - lags_; ++oldest)
        sum_ -= scores.row(static_cast<long>(oldest)).transpose();
      if (oldest < next) push();
    }
    sum_.setZero();
  }

  MatX<double> total() {
    flush();
    return out_ / static_cast<double>(lags_ + 1);
  }

 private:
  static constexpr long kBlock = 256;

  void push() {
    block_.row(filled_++) = sum_.transpose();
    if (filled_ == kBlock) flush();
  }
  void flush() {
    out_.noalias() += block_.topRows(filled_).transpose() * block_.topRows(filled_);
    filled_ = 0;
  }

  long lags_, filled_ = 0;
  VecX<double> sum_;
  RowMatX<double> block_;
  MatX<double> out_;
};

}  // namespace

MatX<double> score_covariance(const JointRows& kept, const MatX<double>& T, const VecX<double>& x,
                              double sigma, const std::function<Influence(double)>& influence) {
  const long rows = static_cast<long>(kept.time.size()), p = kept.width - 1;
  MatX<double> meat = MatX<double>::Zero(p, p);
  if (rows < 2) return meat;
  double all = 0.0, seen = 0.0, weight = 0.0, slope = 0.0;
  for (const auto& [run, count] : kept.factored) all += static_cast<double>(count);
  const long lags = static_cast<long>(std::sqrt(all));
  for (long from = 0, to = 0; from < rows; from = to) {
    const int run = kept.run[from];
    while (to < rows && kept.run[to] == run) ++to;
    RowMatX<double> scores = kept.rows().middleRows(from, to - from) * T;
    const VecX<double> u = (scores.leftCols(p) * x - scores.col(p)) / sigma;
    std::vector<long> at;
    for (long k = from; k < to; ++k) {
      const Influence i = influence ? influence(u[k - from]) : Influence{};
      weight += i.weight;
      slope += i.slope;
      scores.row(k - from) *= i.weight * u[k - from] / sigma;
      at.push_back(std::lround((kept.time[k] - kept.time[from]) / kept.step));
    }
    WindowSums sums(lags, p);
    sums.add(at, scores.leftCols(p));
    const auto count = static_cast<double>(kept.factored.at(run));
    meat += sums.total() * (count / static_cast<double>(to - from));
    seen += count;
  }
  meat *= all / seen;  // recordings of which no row was kept count like the others
  // Far outliers have a slope below 0; where it is small on the whole, nothing is known.
  const double flatter = weight / std::max(slope, 0.05 * weight);
  return meat * (flatter * flatter);
}

}  // namespace diffnea
