#include "identify/stacked_factors.hpp"

#include <algorithm>
#include <cmath>

namespace diffnea {

double JointFactor::sum_of_squares(const VecX<double>& x) const {
  return factor.sum_of_squares(x(columns));
}
MatX<double> JointFactor::without_scale(const VecX<double>& at) const {
  const long p = static_cast<long>(columns.size());
  MatX<double> T = MatX<double>::Identity(p + 1, p + 1);
  if (inertia.size() == 0) return T;
  const VecX<double> x = at(columns);
  const double m = inertia.dot(x);
  if (!(m > 0.0)) return T;
  T.topLeftCorner(p, p) -= x * (inertia.transpose() / m);
  T.col(p).head(p) = -x;
  T.row(p).head(p) = inertia.transpose() / m;  // of the ball's pull, where τ is that and not 0
  T(p, p) = 2.0;
  return T;
}
double JointFactor::rmse(const VecX<double>& x) const {
  return std::sqrt(sum_of_squares(x) / static_cast<double>(std::max<long>(factor.rows(), 1)));
}

std::vector<int> free_columns(const FitLayout& layout) {
  std::vector<int> out;
  for (std::size_t i = 0; i < layout.linear.size(); ++i)
    if (!layout.linear[i].fixed) out.push_back(static_cast<int>(i));
  return out;
}

double link_torque(const FitLayout& layout, const JointFactor& f, const VecX<double>& x) {
  const MatX<double> R = f.factor.R();
  VecX<double> links = VecX<double>::Zero(R.cols());
  for (std::size_t k = 0; k < f.columns.size(); ++k)
    if (f.columns[k] < static_cast<int>(layout.linear.size()) &&
        layout.linear[f.columns[k]].theta >= 0)  // payloads are links, too
      links[static_cast<long>(k)] = x[f.columns[k]];
  return (R * links).norm() / std::sqrt(static_cast<double>(std::max<long>(f.factor.rows(), 1)));
}

double torque_size(const FitLayout& layout, const JointFactor& f, const VecX<double>& x) {
  const double torque = f.rmse(VecX<double>::Zero(static_cast<long>(layout.linear.size())));
  return f.inertia.size() > 0 || !(torque > 0.0) ? std::max(torque, link_torque(layout, f, x))
                                                 : torque;
}

StackedFactors stacked(const std::vector<JointFactor>& factors, const VecX<double>& sigma,
                       long columns, const VecX<double>* at) {
  TriangularFactor whole(static_cast<int>(columns));
  for (std::size_t j = 0; j < factors.size(); ++j) {
    const JointFactor& f = factors[j];
    if (f.factor.rows() == 0) continue;
    const bool passive = at && f.inertia.size() > 0;
    const TriangularFactor mapped =
        passive ? f.factor.mapped(f.without_scale(*at)) : TriangularFactor();
    const TriangularFactor& factor = passive ? mapped : f.factor;
    const MatX<double> Rj = factor.R();
    RowMatX<double> rows = RowMatX<double>::Zero(Rj.rows(), columns + 1);
    for (std::size_t k = 0; k < f.columns.size(); ++k)
      rows.col(f.columns[k]) = Rj.col(static_cast<long>(k)) / sigma[j];
    rows.col(columns) = factor.d() / sigma[j];
    whole.add(rows);
  }
  return {whole.R(), whole.d()};
}

}  // namespace diffnea
