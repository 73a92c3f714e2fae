/// States on a loop's constraints: against the linkage's closed form and brute force.

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/dynamics/constraint_projection.hpp>
#include <diffnea/dynamics/constraints.hpp>
#include <diffnea/dynamics/tree_constraints.hpp>

#include "support/matrix_near.hpp"
#include "support/planar_loop.hpp"
#include "support/random_floating.hpp"

namespace constraint_projection_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;
using test::MatrixNear;
using test::PlanarLoop;

TEST_CASE("constraint projection: a four-bar's rocker follows Freudenstein's equation",
          "[constraints][loops]") {
  // Ground 0.9, crank 0.3, coupler 0.8, rocker 0.6 [m]; the tree's joints turn about y, so that
  // angles in the plane x, z run the other way.
  const PlanarLoop loop(1, 3);
  const double crank = GENERATE(-1.1, -0.4, 0.3, 0.9);
  VecX<double> start = loop.q;
  const int steps = 20;  // along the branch that the loop starts on
  for (int k = 1; k <= steps; ++k) {
    start[0] = loop.q[0] + (crank - loop.q[0]) * k / steps;
    start = project_positions(loop.tree, loop, start, {.held = {0}}).q;
  }
  const ProjectedPositions found = project_positions(loop.tree, loop, start, {.held = {0}});
  CHECK(found.converged);
  CHECK(found.residual <= 1e-12);
  CHECK(found.q[0] == start[0]);
  // (Freudenstein 1954): K1 cos ψ − K2 cos φ + K3 = cos(ψ − φ), ψ the rocker seen from its pin.
  const double a = 0.3, b = 0.8, c = 0.6, d = 0.9;
  const double phi = found.q[0], psi = phi + found.q[1] + found.q[2] + M_PI;
  CHECK_THAT(
      d / a * std::cos(psi) - d / c * std::cos(phi) + (a * a - b * b + c * c + d * d) / (2 * a * c),
      WithinAbs(std::cos(psi - phi), 1e-10));
}

TEST_CASE("constraint projection: velocities and accelerations are those of the closed motion",
          "[constraints][loops]") {
  const int bars = GENERATE(3, 4);
  const unsigned seed = GENERATE(range(0u, 5u));
  CAPTURE(bars, seed);
  const PlanarLoop loop(seed, bars);
  // The driven joints move at constant speed; the others are solved for, positions alone.
  const std::vector<int> driven = bars == 3 ? std::vector<int>{0} : std::vector<int>{0, 1};
  VecX<double> rate = VecX<double>::Zero(bars);
  rate[0] = 0.7;
  if (bars == 4) rate[1] = -0.4;
  const auto closed = [&](double t) {
    return project_positions(loop.tree, loop, loop.q + rate * t, {.held = driven}).q;
  };
  const VecX<double> v = project_velocities(loop.tree, loop, loop.q, rate, driven);
  const VecX<double> vd =
      project_accelerations(loop.tree, loop, loop.q, v, VecX<double>::Zero(bars), driven);
  // Central differences of positions closed to 1e-12: h = 1e-3 leaves O(h²) and 1e-6.
  const double h = 1e-3;
  CHECK_THAT((closed(h) - closed(-h)) / (2 * h), MatrixNear(v, 1e-4));
  CHECK_THAT((closed(h) - 2.0 * closed(0) + closed(-h)) / (h * h), MatrixNear(vd, 1e-3));
  for (const int k : driven) {
    CHECK(v[k] == rate[k]);
    CHECK(vd[k] == 0.0);
  }
}

TEST_CASE("constraint projection: a loop leaves the motions that it has", "[constraints][loops]") {
  const int bars = GENERATE(3, 4);
  const PlanarLoop loop(4, bars);
  const MatX<double> J = tree_rows(loop.tree, loop, loop.q, loop.qd).J;
  const MatX<double> N = constraint_null_space(J);
  CHECK(N.cols() == bars - 2);  // 1 of a four-bar, 2 of a five-bar
  CHECK_THAT(J * N, MatrixNear(MatX<double>::Zero(J.rows(), N.cols()), 1e-12));
  const auto none = [](const auto&, auto&) {};
  CHECK(project_velocities(loop.tree, none, loop.q, loop.qd) == loop.qd);
  CHECK_THAT(N.transpose() * N, MatrixNear(MatX<double>::Identity(N.cols(), N.cols()), 1e-12));
}

TEST_CASE("constraint projection: a loop that cannot close says by how much",
          "[constraints][loops]") {
  PlanarLoop loop(1, 3);
  loop.pin.p_AP = loop.pin.p_AP * 1.0 + (loop.tree.links[0].X_PJ.R * Vec3<double>{2.0, 0, 0});
  const ProjectedPositions found = project_positions(loop.tree, loop, loop.q);
  CHECK_FALSE(found.converged);
  // The pin is 2.9 m from the crank's pivot, the bars reach 1.7 m.
  CHECK(found.residual > 0.3);
  CHECK(found.residual < 1.3);
  CHECK_THROWS_WITH(project_positions(loop.tree, loop, loop.q, {.held = {3}}),
                    ContainsSubstring("coordinate 3 is held, expected 0 to 2"));
}

TEST_CASE("constraint projection: a weld and a hinge of a model close on a free base",
          "[constraints][loops]") {
  const ConstraintKind kind = GENERATE(ConstraintKind::kWeld, ConstraintKind::kHinge);
  const unsigned seed = GENERATE(range(0u, 3u));
  CAPTURE(seed);
  // A base with two arms of six joints: the tips meet where the seed has them, then are pulled off.
  Rng rng(seed);
  Model model;
  model.free_base = true;
  model.links.push_back({.name = "base", .inertia = test::random_inertia(rng)});
  for (const char* arm : {"left", "right"})
    for (int i = 0; i < 6; ++i) {
      const std::string name = arm + std::to_string(i);
      model.links.push_back({.name = name,
                             .joint = name,
                             .parent = i == 0 ? 0 : static_cast<int>(model.links.size()) - 1,
                             .type = ModelJoint::kRevolute,
                             .axis = test::random_unit(rng),
                             .X_PJ = test::random_pose(rng),
                             .inertia = test::random_inertia(rng)});
    }
  const Tree<double> tree = make_tree(model);
  const VecX<double> there = test::random_positions(rng, tree);
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(tree, there, kinematics);
  const Pose<double> X_LK = test::random_pose(rng);
  const Pose<double> X_WK = kinematics.links[12].X_WL * X_LK;
  model.constraints.push_back({.name = "tips",
                               .kind = kind,
                               .first = {6, inverse(kinematics.links[6].X_WL) * X_WK},
                               .second = {12, X_LK}});
  const TreeConstraints<double> constraints = tree_constraints(model);
  const VecX<double> off =
      integrate<double, double>(tree, there, test::random_vector(rng, tree.num_velocities(), 0.1));
  const ProjectedPositions closed = project_positions(tree, constraints, off);
  CHECK(closed.converged);
  forward_kinematics<double, double>(tree, closed.q, kinematics);
  const Pose<double> X_JK = inverse(kinematics.links[6].X_WL * model.constraints[0].first.X_LF) *
                            kinematics.links[12].X_WL * X_LK;
  CHECK_THAT(to_eigen(X_JK.p), MatrixNear(Eigen::Vector3d::Zero(), 1e-10));
  CHECK_THAT(X_JK.R.col[2].z, WithinAbs(1.0, 1e-12));
  if (kind == ConstraintKind::kWeld)
    CHECK_THAT(to_eigen(X_JK.R), MatrixNear(Eigen::Matrix3d::Identity(), 1e-10));
  const MatX<double> J =
      tree_rows(tree, constraints, closed.q, VecX<double>::Zero(tree.num_velocities())).J;
  CHECK(constraint_null_space(J).cols() == 18 - (kind == ConstraintKind::kWeld ? 6 : 5));
}

}  // namespace constraint_projection_test
