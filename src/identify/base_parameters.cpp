#include "identify/base_parameters.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/text.hpp>

#include "core/decompositions.hpp"
#include "identify/stacked_factors.hpp"

namespace diffnea {
namespace {

/// Combinations with a smaller share of the largest pivot are structurally invisible: columns that
/// are exactly dependent leave 1e-13 (observed), directions that the data do see at all some 1e-5.
constexpr double kStructuralTol = 1e-9;

}  // namespace

std::vector<BaseParameter> base_parameters(const FitLayout& layout, const MatX<double>& R,
                                           const VecX<double>& x, const VecX<double>& scale) {
  std::vector<int> columns;
  VecX<double> weight = scale;
  for (std::size_t k = 0; k < layout.linear.size(); ++k) {
    if (layout.linear[k].absorbed) weight[static_cast<long>(k)] *= 1e-4;
    if (!layout.linear[k].fixed || layout.linear[k].absorbed)
      columns.push_back(static_cast<int>(k));
  }
  MatX<double> Rs = R(Eigen::all, columns);
  for (long k = 0; k < Rs.cols(); ++k) Rs.col(k) *= weight[columns[static_cast<std::size_t>(k)]];
  Eigen::ColPivHouseholderQR<MatX<double>> qr(Rs);
  qr.setThreshold(kStructuralTol);
  const long rank = qr.rank(), p = Rs.cols();
  const MatX<double> upper = qr.matrixR().topRows(rank);
  const MatX<double> R1 = upper.leftCols(rank).template triangularView<Eigen::Upper>();
  MatX<double> beta(rank, p - rank);
  if (rank > 0 && p > rank) {
    const MatX<double> dependent = upper.rightCols(p - rank);
    beta = R1.template triangularView<Eigen::Upper>().solve(dependent);
  }
  std::vector<BaseParameter> out;
  const Eigen::VectorXi order = qr.colsPermutation().indices();
  for (long i = 0; i < rank; ++i) {
    const int lead = columns[static_cast<std::size_t>(order[i])];
    BaseParameter b;
    b.columns = {lead};
    b.coefficients = {1.0};
    b.expression = layout.linear[lead].name;
    b.value = x[lead];
    for (long k = 0; k < p - rank; ++k) {
      const int dependent = columns[static_cast<std::size_t>(order[rank + k])];
      const double c = beta(i, k) * weight[lead] / weight[dependent];
      // A share below a millionth of the scales is rounding.
      if (std::abs(c) * scale[dependent] < 1e-6 * scale[lead]) continue;
      b.columns.push_back(dependent);
      b.coefficients.push_back(c);
      b.expression += (c < 0 ? " - " : " + ") + detail::number_text(std::abs(c)) + " " +
                      layout.linear[dependent].name;
      b.value += c * x[dependent];
    }
    out.push_back(b);
  }
  std::ranges::sort(out, {}, [](const BaseParameter& b) { return b.columns.front(); });
  return out;
}

std::vector<int> absorbed_by_links(const FitLayout& layout,
                                   const std::vector<JointFactor>& factors) {
  const long p = static_cast<long>(layout.linear.size());
  VecX<double> sigma = VecX<double>::Ones(static_cast<long>(factors.size()));
  for (std::size_t j = 0; j < factors.size(); ++j)
    sigma[static_cast<long>(j)] = std::max(factors[j].rmse(VecX<double>::Zero(p)), 1e-12);
  const MatX<double> R = stacked(factors, sigma, p).R;
  std::vector<int> links, out;
  for (const int c : free_columns(layout))
    if (layout.linear[c].dof >= 0) links.push_back(c);
  if (links.empty()) return out;
  MatX<double> L = R(Eigen::all, links);
  for (long k = 0; k < L.cols(); ++k) L.col(k) /= std::max(L.col(k).norm(), 1e-300);
  Eigen::ColPivHouseholderQR<MatX<double>> qr(L);
  qr.setThreshold(kStructuralTol);
  for (const int c : free_columns(layout)) {
    if (layout.linear[c].dof >= 0 || layout.linear[c].theta >= 0) continue;
    const VecX<double> g = R.col(c);
    // Of a dependent column rounding leaves 1e-12 (observed); of any other, noise alone leaves
    // 1e-5.
    if (g.norm() > 0.0 && (L * qr.solve(g) - g).norm() < 1e-7 * g.norm()) out.push_back(c);
  }
  return out;
}

}  // namespace diffnea
