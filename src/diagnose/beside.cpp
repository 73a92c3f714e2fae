#include "diagnose/beside.hpp"

#include <algorithm>

#include "diagnose/signed_fit.hpp"

namespace diffnea {

MatX<double> product(const Beside& a, const Beside& b) {
  MatX<double> out = -a.onto.transpose() * b.onto;
  for (std::size_t i = 0, j = 0; i < a.joints.size() && j < b.joints.size();) {
    if (a.joints[i] < b.joints[j])
      ++i;
    else if (a.joints[i] > b.joints[j])
      ++j;
    else
      out.noalias() += a.of(i++).transpose() * b.of(j++);
  }
  return out;
}

Beside combined(const Beside& a, const VecX<double>& weights) {
  return {a.joints, a.whitened * weights, a.onto * weights};
}

double left_beside(const MatX<double>& products, const VecX<double>& with, double square) {
  if (with.size() == 0) return std::max(square, 0.0);
  return std::max(square - with.dot(ridge_solve(products, with, 1e-10)), 0.0);
}

}  // namespace diffnea
