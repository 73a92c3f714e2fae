// Torques of a double pendulum and their derivatives, from the headers alone: nothing of diffnea is
// compiled before, no library is linked.
//
//   g++ -std=c++20 -I include -I /usr/include/eigen3 dynamics.cpp
#include <cstdio>

#include <diffnea/dynamics.hpp>

using namespace diffnea;

int main() {
  // Two point masses of 1 kg, each 0.5 m below its joint, which turns about y.
  const auto body = inertia_from_com<double>(1.0, {0, 0, -0.5}, {});
  Tree<double> tree;
  const int upper = add_link(tree, {.axis = {0, 1, 0}, .inertia = body});
  add_link(tree, {.parent = upper,
                  .axis = {0, 1, 0},
                  .X_PJ = Pose<double>::translation({0, 0, -0.5}),
                  .inertia = body});

  const Eigen::Vector2d q(0.3, -0.5), qd(1.0, 2.0), qdd(0.1, -0.2);
  RneaWorkspace<double, double> ws;
  const VecX<double>& tau = rnea(tree, q, qd, qdd, ws);
  std::printf("tau      %.12f %.12f N*m\n", tau[0], tau[1]);

  // The same function on Jets: the derivative of each torque by each angle.
  using Jet = ceres::Jet<double, 2>;
  const Eigen::Matrix<Jet, 2, 1> q_jet(Jet(q[0], 0), Jet(q[1], 1));
  RneaWorkspace<double, Jet> jet_ws;
  const VecX<Jet>& jets = rnea<double, Jet>(tree, q_jet, qd.cast<Jet>(), qdd.cast<Jet>(), jet_ws);
  for (int i = 0; i < 2; ++i)
    std::printf("dtau%d/dq %.12f %.12f N*m/rad\n", i + 1, jets[i].v[0], jets[i].v[1]);
}
