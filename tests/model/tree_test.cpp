/// Trees that are built in code, and the pose of a link on its joint.

#include <cmath>
#include <string>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_all.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/model/model.hpp>

#include "support/matrix_near.hpp"

namespace tree_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using test::MatrixNear;

namespace {

/// Some products of sines and cosines: rounding leaves 1e-16 each.
constexpr double kRoundingTol = 1e-14;

}  // namespace

TEST_CASE("add_link builds what make_tree makes of the same robot", "[model]") {
  const auto body = inertia_from_com<double>(2.0, {0.1, 0, -0.2}, {0.02, 0, 0, 0.03, 0, 0.01});
  const auto below = Pose<double>::translation({0, 0, -0.5});
  Model model;
  model.name = "arm";
  for (const char* name : {"upper", "lower", "rail"}) {
    ModelLink link;
    link.name = name;
    link.joint = std::string(name) + "_joint";
    link.parent = static_cast<int>(model.links.size()) - 1;
    link.type = link.name == "rail" ? ModelJoint::kPrismatic : ModelJoint::kRevolute;
    link.axis = {0, 1, 0};
    if (link.parent >= 0) link.X_PJ = below;
    link.inertia = body;
    model.links.push_back(link);
  }

  Tree<double> tree;
  const int upper = add_link(tree, {.axis = {0, 1, 0}, .inertia = body});
  const int lower =
      add_link(tree, {.parent = upper, .axis = {0, 1, 0}, .X_PJ = below, .inertia = body});
  add_link(tree, {.parent = lower,
                  .type = JointType::kPrismatic,
                  .axis = {0, 1, 0},
                  .X_PJ = below,
                  .inertia = body});

  const Tree<double> expected = make_tree(model);
  REQUIRE(tree.num_dofs() == expected.num_dofs());
  for (int i = 0; i < tree.num_dofs(); ++i) {
    const Link<double>&a = tree.links[i], &b = expected.links[i];
    CHECK(a.parent == b.parent);
    CHECK(a.type == b.type);
    CHECK(to_eigen(a.axis) == to_eigen(b.axis));
    CHECK(to_eigen(a.X_PJ.p) == to_eigen(b.X_PJ.p));
    CHECK(to_eigen(a.X_PJ.R) == to_eigen(b.X_PJ.R));
    CHECK(a.inertia.theta() == b.inertia.theta());
  }
}

TEST_CASE("add_link refuses a parent that is not there, and an axis of another length", "[model]") {
  Tree<double> tree;
  CHECK_THROWS_AS(add_link(tree, {.parent = 0}), ModelError);
  CHECK_THROWS_AS(add_link(tree, {.parent = -2}), ModelError);
  CHECK_THROWS_WITH(add_link(tree, {.axis = {0, 2, 0}}), ContainsSubstring("expected 1"));
  CHECK(tree.num_dofs() == 0);
  CHECK(add_link(tree, {}) == 0);
  CHECK(add_link(tree, {.parent = 0}) == 1);
}

TEST_CASE("the pose of a link is its joint's exponential", "[model]") {
  Rng rng(GENERATE(range(0u, 10u)));
  const auto number = [&] { return rng.uniform(-1.0, 1.0); };
  const double c = std::sqrt(0.5);
  for (const JointType type : {JointType::kRevolute, JointType::kPrismatic})
    for (const Vec3<double>& axis :
         {Vec3<double>{1, 0, 0}, Vec3<double>{0, 1, 0}, Vec3<double>{0, 0, 1},
          Vec3<double>{0, 0, -1}, Vec3<double>{c, 0, -c}}) {
      Link<double> link;
      link.type = type;
      link.axis = axis;
      link.X_PJ =
          exp(Twist<double>{{number(), number(), number()}, {number(), number(), number()}});
      const double q = 3.0 * number();
      const Pose<double> X = joint_pose(link, q), expected = link.X_PJ * exp(joint_twist(link) * q);
      CHECK_THAT(to_eigen(X.R), MatrixNear(to_eigen(expected.R), kRoundingTol));
      CHECK_THAT(to_eigen(X.p), MatrixNear(to_eigen(expected.p), kRoundingTol));
    }
}

}  // namespace tree_test
