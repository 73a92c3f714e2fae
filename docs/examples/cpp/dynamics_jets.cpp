// ∂τ/∂q of a double pendulum three ways: by Jets through the same recursion, by the analytic
// derivatives, by central differences. Headers alone, as dynamics.cpp.
#include <iostream>

#include <diffnea/dynamics.hpp>

using namespace diffnea;

int main() {
  const auto body = inertia_from_com<double>(1.0, {0, 0, -0.5}, {});
  const auto below = Pose<double>::translation({0, 0, -0.5});
  Tree<double> tree;
  const int upper = add_link(tree, {.axis = {0, 1, 0}, .inertia = body});
  add_link(tree, {.parent = upper, .axis = {0, 1, 0}, .X_PJ = below, .inertia = body});
  const Eigen::Vector2d q(0.3, -0.5), qd(1.0, 2.0), qdd(0.1, -0.2);

  // A Jet is a number with derivatives: here by the two angles.
  using Jet = ceres::Jet<double, 2>;
  const Eigen::Matrix<Jet, 2, 1> q_jet(Jet(q[0], 0), Jet(q[1], 1));
  RneaWorkspace<double, Jet> jet_ws;
  const VecX<Jet>& tau = rnea(tree, q_jet, qd.cast<Jet>(), qdd.cast<Jet>(), jet_ws);
  Eigen::Matrix2d by_jets;
  for (int i = 0; i < 2; ++i) by_jets.row(i) = tau[i].v.transpose();

  RneaDerivatives analytic;
  rnea_derivatives(tree, q, qd, qdd, analytic);

  Eigen::Matrix2d by_differences;
  RneaWorkspace<double, double> ws;
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector2d step = 1e-6 * Eigen::Vector2d::Unit(k);
    by_differences.col(k) = rnea(tree, q + step, qd, qdd, ws);
    by_differences.col(k) -= rnea(tree, q - step, qd, qdd, ws);
    by_differences.col(k) /= 2e-6;
  }

  std::cout.precision(15);
  std::cout << by_jets << " N·m/rad\n";
  const double analytic_error = (by_jets - analytic.dtau_dq).cwiseAbs().maxCoeff();
  const double difference_error = (by_jets - by_differences).cwiseAbs().maxCoeff();
  return analytic_error < 1e-13 && difference_error < 1e-7 ? 0 : 3;
}
