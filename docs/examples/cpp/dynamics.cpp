// Torques of a double pendulum, from the headers alone: nothing of diffnea was compiled before, no
// library is linked.
//
//   g++ -std=c++20 -I include -I /usr/include/eigen3 dynamics.cpp
#include <iostream>

#include <diffnea/dynamics.hpp>

int main() {
  // Two joints that turn about y, each with a point of 1 kg 0.5 m below it.
  const auto body = diffnea::inertia_from_com<double>(1.0, {0, 0, -0.5}, {});
  const auto below = diffnea::Pose<double>::translation({0, 0, -0.5});
  diffnea::Tree<double> tree;
  const int upper = add_link(tree, {.axis = {0, 1, 0}, .inertia = body});
  add_link(tree, {.parent = upper, .axis = {0, 1, 0}, .X_PJ = below, .inertia = body});

  const Eigen::Vector2d q(0.3, -0.5), qd(1.0, 2.0), qdd(0.1, -0.2);
  diffnea::RneaWorkspace<double, double> ws;
  std::cout.precision(15);
  std::cout << rnea(tree, q, qd, qdd, ws).transpose() << " N·m\n";
}
