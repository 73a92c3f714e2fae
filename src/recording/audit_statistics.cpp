#include "recording/audit_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <limits>

#include "core/c_numbers.hpp"
#include "core/decompositions.hpp"

namespace diffnea::detail {

double find_quantum(const VecX<double>& x) {
  std::vector<double> steps;
  for (long i = 1; i < x.size(); ++i) {
    const double d = std::abs(x[i] - x[i - 1]);
    if (d > 0.0) steps.push_back(d);  // false for NaN
  }
  if (steps.size() < 20) return 0.0;
  // The finest step that occurs often (conversions of unit round single ones), or a part of it: a
  // channel may skip values.
  const double finest = quantile(steps, 0.01);
  for (const double part : {1.0, 2.0, 3.0, 4.0}) {
    const double guess = finest / part;
    double multiples = 0.0, few = 0.0, sum = 0.0, count = 0.0;
    for (const double d : steps) {
      const double n = d / guess;
      if (n > 10.0) continue;  // in large steps the error of the guess adds up
      few += 1.0;
      if (std::abs(n - std::nearbyint(n)) > 0.1 || n < 0.5) continue;
      multiples += 1.0;
      sum += d;
      count += std::nearbyint(n);
    }
    if (few >= 20.0 && multiples > 0.9 * few) return sum / count;
  }
  return 0.0;
}

std::string format(const char* text, ...) {
  char out[512];
  va_list arguments;
  va_start(arguments, text);
  const detail::CNumbers point;
  std::vsnprintf(out, sizeof out, text, arguments);
  va_end(arguments);
  return out;
}

BlockFit fit_in_blocks(const MatX<double>& x, const VecX<double>& y,
                       const std::vector<int>& block) {
  const long n = x.cols();
  // Columns of very different units: the Gram matrix is that of columns of length one.
  const VecX<double> size =
      x.colwise().norm().transpose().cwiseMax(std::numeric_limits<double>::min());
  const MatX<double> unit = x * size.cwiseInverse().asDiagonal();
  const Eigen::CompleteOrthogonalDecomposition<MatX<double>> gram(
      MatX<double>(unit.transpose() * unit));
  BlockFit out;
  const VecX<double> b = gram.solve(VecX<double>(unit.transpose() * y));
  out.residual = y - unit * b;
  const MatX<double> inverse = pseudo_inverse(gram);
  MatX<double> meat = MatX<double>::Zero(n, n);
  VecX<double> score = VecX<double>::Zero(n);
  double num_blocks = 0.0;
  for (long i = 0; i < x.rows(); ++i) {
    score += unit.row(i).transpose() * out.residual[i];
    if (i + 1 < x.rows() && block[i + 1] == block[i]) continue;
    meat += score * score.transpose();
    score.setZero();
    num_blocks += 1.0;
  }
  // Few blocks: as with few samples.
  meat *= num_blocks / std::max(1.0, num_blocks - static_cast<double>(std::min(n, 2L)));
  out.coefficients = b.cwiseQuotient(size);
  out.std = (inverse * meat * inverse).diagonal().cwiseMax(0.0).cwiseSqrt().cwiseQuotient(size);
  const double total = (y.array() - y.mean()).square().sum();
  out.explained = total > 0.0 ? 1.0 - out.residual.squaredNorm() / total : 0.0;
  return out;
}

double jackknife_z(const MatX<double>& x, const VecX<double>& y, const std::vector<int>& block,
                   long column) {
  const VecX<double> size =
      x.colwise().norm().transpose().cwiseMax(std::numeric_limits<double>::min());
  const MatX<double> unit = x * size.cwiseInverse().asDiagonal();
  const MatX<double> gram = unit.transpose() * unit;
  const VecX<double> right = unit.transpose() * y;
  std::vector<double> left_out;
  for (long first = 0, i = 0; i < unit.rows(); ++i) {
    if (i + 1 < unit.rows() && block[i + 1] == block[i]) continue;
    const auto rows = unit.middleRows(first, i + 1 - first);
    const Eigen::CompleteOrthogonalDecomposition<MatX<double>> others(
        MatX<double>(gram - rows.transpose() * rows));
    left_out.push_back(others.solve(
        VecX<double>(right - rows.transpose() * y.segment(first, i + 1 - first)))[column]);
    first = i + 1;
  }
  const double n = static_cast<double>(left_out.size());
  if (n < 3.0) return 0.0;
  const Eigen::Map<const VecX<double>> b(left_out.data(), static_cast<long>(left_out.size()));
  const double std = std::sqrt((n - 1.0) / n * (b.array() - b.mean()).square().sum());
  if (!(std > 0.0)) return 0.0;
  const double t = b.mean() / std, dofs = n - 1.0;
  return std::copysign(
      (8.0 * dofs + 1.0) / (8.0 * dofs + 3.0) * std::sqrt(dofs * std::log1p(t * t / dofs)), t);
}

}  // namespace diffnea::detail
