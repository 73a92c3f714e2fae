#include "diffnea/model/lock.hpp"

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/rnea.hpp>

#include "support/random_arm.hpp"

using Catch::Matchers::ContainsSubstring;

namespace diffnea::lock_test {
namespace {

/// Sums of products of order 10 in another order.
constexpr double kRounding = 1e-10;

/// A chain of hinges and slides with oblique axes; joint names a, b, c, d.
Model random_model(unsigned seed) {
  Rng rng(seed);
  Model model;
  model.name = "chain";
  for (int i = 0; i < 4; ++i) {
    ModelLink link;
    link.name = std::string("link_") + "abcd"[i];
    link.joint = std::string(1, "abcd"[i]);
    link.parent = i - 1;
    link.type = i % 2 == 1 ? ModelJoint::kPrismatic : ModelJoint::kRevolute;
    link.axis = test::random_unit(rng);
    link.X_PJ = test::random_pose(rng);
    link.inertia = test::random_inertia(rng);
    model.links.push_back(link);
  }
  return model;
}

VecX<double> torques(const Model& model, const VecX<double>& q, const VecX<double>& qd,
                     const VecX<double>& qdd) {
  RneaWorkspace<double, double> ws;
  return rnea<double, double>(make_tree(model), q, qd, qdd, ws);
}

}  // namespace

TEST_CASE("lock: the other joints need the torques that they need with that joint held",
          "[model]") {
  const unsigned seed = GENERATE(Catch::Generators::range(0u, 10u));
  const int held = GENERATE(0, 1, 2, 3);
  CAPTURE(seed, held);
  const Model model = random_model(seed);
  Rng rng(100 + seed);
  VecX<double> q(4), qd(4), qdd(4);
  for (VecX<double>* v : {&q, &qd, &qdd})
    for (double& x : *v) x = rng.normal();
  qd[held] = qdd[held] = 0.0;

  Model locked = model;
  CHECK(lock_joint(locked, std::string(1, "abcd"[held]), q[held]).empty());
  std::vector<int> others;
  for (int j = 0; j < 4; ++j)
    if (j != held) others.push_back(j);
  const VecX<double> whole = torques(model, q, qd, qdd)(others),
                     of_three = torques(locked, q(others), qd(others), qdd(others));
  CHECK((whole - of_three).norm() < kRounding * (1.0 + whole.norm()));
}

TEST_CASE("lock: effects of the joint go, alone or in a pair; others stay", "[model]") {
  Model model = random_model(1);
  model.home = {0.1, 0.2, 0.3, 0.4};
  model.effects = {{"coulomb_friction", "b", {}},
                   {"coulomb_friction", "c", {}},
                   {"gravity_coupling", "a,b", {}},
                   {"payload", "b:run=1", {}}};
  CHECK(lock_joint(model, "b", 0.0) == std::vector<std::string>{"coulomb_friction at b",
                                                                "gravity_coupling at a,b",
                                                                "payload at b:run=1"});
  REQUIRE(model.effects.size() == 1);
  CHECK(model.effects[0].where == "c");
  CHECK(joint_names(model) == std::vector<std::string>{"a", "c", "d"});
  CHECK(model.home == std::vector<double>{0.1, 0.3, 0.4});
}

TEST_CASE("lock: at home, else at 0 within the limits", "[model]") {
  Model model = random_model(2);
  CHECK(resting_position(model, "a") == 0.0);
  model.links[0].limits = {.lower = 0.3, .upper = 1.0};
  CHECK(resting_position(model, "a") == 0.3);
  model.home = {0.5, 0.0, 0.0, 0.0};
  CHECK(resting_position(model, "a") == 0.5);
}

TEST_CASE("lock: another joint, and a position beyond the limits, are refused", "[model]") {
  Model model = random_model(3);
  model.links[2].limits = {.lower = -1.0, .upper = 1.0};
  CHECK_THROWS_WITH(lock_joint(model, "elbow", 0.0), ContainsSubstring("joints: a, b, c, d"));
  CHECK_THROWS_WITH(lock_joint(model, "c", 30.0),
                    ContainsSubstring("c was to be held at 30 rad, beyond its limits -1 to 1 rad"));
  CHECK_NOTHROW(lock_joint(model, "c", 1.05));  // a calibration's difference
}

}  // namespace diffnea::lock_test
