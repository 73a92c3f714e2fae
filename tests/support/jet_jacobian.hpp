#pragma once
/// Jacobians of vector functions: by Jets of the library's width, in as many sweeps as it takes,
/// and by central differences.

#include <algorithm>

#include <diffnea/core/scalar.hpp>

namespace diffnea::test {

/// ∂f/∂x, f: VecX<JetD> → VecX<JetD>.
template <class Function>
MatX<double> jet_jacobian(const VecX<double>& x, const Function& f) {
  MatX<double> jacobian;
  VecX<JetD> jets = x.cast<JetD>();
  for (Eigen::Index first = 0; first < x.size(); first += kJetWidth) {
    const Eigen::Index width = std::min<Eigen::Index>(kJetWidth, x.size() - first);
    for (Eigen::Index k = 0; k < width; ++k) jets[first + k].v[k] = 1.0;
    const VecX<JetD> y = f(jets);
    jacobian.conservativeResize(y.size(), x.size());
    for (Eigen::Index r = 0; r < y.size(); ++r)
      for (Eigen::Index k = 0; k < width; ++k) jacobian(r, first + k) = y[r].v[k];
    for (Eigen::Index k = 0; k < width; ++k) jets[first + k].v.setZero();
  }
  return jacobian;
}

/// ∂f/∂x by central differences of step h, f: VecX<double> → VecX<double>.
template <class Function>
MatX<double> central_jacobian(const VecX<double>& x, double h, const Function& f) {
  MatX<double> jacobian;
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    VecX<double> above = x, below = x;
    above[k] += h;
    below[k] -= h;
    const VecX<double> plus = f(above);
    const VecX<double> minus = f(below);
    jacobian.conservativeResize(plus.size(), x.size());
    jacobian.col(k) = (plus - minus) / (2.0 * h);
  }
  return jacobian;
}

}  // namespace diffnea::test
