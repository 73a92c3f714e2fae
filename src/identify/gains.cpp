#include "identify/gains.hpp"

#include <algorithm>

#include "core/decompositions.hpp"

namespace diffnea {

Gains::Gains(const FitLayout& layout) : layout_(&layout) {
  for (std::size_t c = 0; c < layout.linear.size(); ++c) {
    const FitParameter& p = layout.linear[c];
    if (p.effect >= 0 && layout.effects[p.effect].info().has(Trait::kGain))
      columns_.push_back(static_cast<int>(c));
  }
}

bool Gains::any_free() const {
  return std::ranges::any_of(columns_, [&](int c) { return !layout_->linear[c].fixed; });
}

double Gains::gain(int joint, const VecX<double>& x) const {
  double sum = 0.0;
  for (const int c : columns_) {
    const std::vector<int>& joints = layout_->effects[layout_->linear[c].effect].joints;
    if (std::ranges::find(joints, joint) != joints.end()) sum += x[c];
  }
  return sum;
}

/// Columns of what the links carry. (Steps of a fixed transform and of the base's tilt are too.)
bool Gains::transmitted(int column) const {
  if (column >= static_cast<int>(layout_->linear.size())) return false;
  const FitParameter& p = layout_->linear[column];
  return p.dof >= 0 ||
         (p.effect >= 0 && layout_->effects[p.effect].info().port == Port::kModelParameter);
}

VecX<double> Gains::effective(int joint, const VecX<double>& x) const {
  VecX<double> out = x;
  if (!any()) return out;
  const double scale = 1.0 + gain(joint, x);
  for (int c = 0; c < static_cast<int>(layout_->linear.size()); ++c)
    if (transmitted(c)) out[c] *= scale;
  for (const int c : columns_) out[c] = 0.0;
  return out;
}

MatX<double> Gains::linearisation(int joint, const std::vector<int>& columns,
                                  const VecX<double>& x) const {
  const long p = static_cast<long>(columns.size());
  MatX<double> T = MatX<double>::Identity(p + 1, p + 1);
  const double g = gain(joint, x);
  VecX<double> links =
      VecX<double>::Zero(p + 1);  // the combination of columns that the links' torque is
  for (long k = 0; k < p; ++k)
    if (transmitted(columns[k])) {
      links[k] = columns[k] < x.size() ? x[columns[k]] : 0.0;
      T(k, k) = 1.0 + g;
    }
  for (long k = 0; k < p; ++k)
    if (owns(columns[k])) T.col(k) = links;
  T.col(p) += g * links;
  return T;
}

std::vector<JointFactor> Gains::linearised(const std::vector<JointFactor>& factors,
                                           const VecX<double>& x) const {
  std::vector<JointFactor> out = factors;
  if (!any()) return out;
  for (std::size_t j = 0; j < out.size(); ++j)
    out[j].factor = out[j].factor.mapped(linearisation(static_cast<int>(j), out[j].columns, x));
  return out;
}

std::vector<int> Gains::undetermined(const std::vector<JointFactor>& linearised) const {
  std::vector<int> free, out;
  for (std::size_t c = 0; c < layout_->linear.size(); ++c)
    if (!layout_->linear[c].fixed) free.push_back(static_cast<int>(c));
  const long p = static_cast<long>(layout_->linear.size());
  // Joints side by side, each in units of its torque.
  long rows = 0;
  for (const JointFactor& f : linearised) rows += f.factor.columns();
  MatX<double> R = MatX<double>::Zero(rows, p);
  long at = 0;
  for (const JointFactor& f : linearised) {
    const double unit = std::max(f.rmse(VecX<double>::Zero(p)), 1e-12);
    const MatX<double> Rj = f.factor.R();
    for (std::size_t k = 0; k < f.columns.size(); ++k)
      if (f.columns[k] < p)
        R.col(f.columns[k]).segment(at, Rj.rows()) = Rj.col(static_cast<long>(k)) / unit;
    at += Rj.rows();
  }
  for (const int c : columns_) {
    if (layout_->linear[c].fixed) continue;
    std::vector<int> others = free;
    std::erase(others, c);
    MatX<double> A = R(Eigen::all, others);
    for (long k = 0; k < A.cols(); ++k) A.col(k) /= std::max(A.col(k).norm(), 1e-300);
    Eigen::ColPivHouseholderQR<MatX<double>> qr(A);
    qr.setThreshold(1e-9);  // as structural rank elsewhere (linear_fit.cpp)
    const VecX<double> g = R.col(c);
    // Rounding leaves 1e-12 of a dependent column; a known kilogram leaves its share of the torque.
    if ((A * qr.solve(g) - g).norm() <= 1e-7 * g.norm()) out.push_back(c);
  }
  return out;
}

}  // namespace diffnea
