/// Designed motions of closed loops: they close, and what follows stays within its limits.

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/excite/design.hpp>

#include "dynamics/loop_motion.hpp"
#include "support/linkage.hpp"

namespace excite_loops_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using test::linkage;

namespace {

struct AllJoints {
  RowMatX<double> q, qd, qdd, torque;
};

/// The motion of all joints along a trajectory, and the torques of its drives.
AllJoints along(const Model& model, const Trajectory& t) {
  const LoopMotion loop("test", model);
  AllJoints x;
  x.q = RowMatX<double>::Zero(t.rows(), loop.num_joints());
  x.qd = x.qdd = x.torque = x.q;
  for (const int j : loop.leads()) {
    const auto at =
        std::ranges::find(t.joint_names, joint_names(model)[static_cast<std::size_t>(j)]);
    REQUIRE(at != t.joint_names.end());
    const long c = at - t.joint_names.begin();
    x.q.col(j) = t.q.col(c);
    x.qd.col(j) = t.qd.col(c);
    x.qdd.col(j) = t.qdd.col(c);
  }
  VecX<double> posture = loop.home();
  REQUIRE(loop.move(loop.positions_of_leads(VecX<double>(x.q.row(0))), posture));
  REQUIRE(loop.follow(x.q, x.qd, x.qdd, posture, 0.05) == t.rows());
  const Tree<double> tree = make_tree(model);
  RneaWorkspace<double, double> ws;
  for (long k = 0; k < t.rows(); ++k)
    x.torque.row(k) = loop.at_drives(
        VecX<double>(x.q.row(k)),
        rnea<double, double>(tree, VecX<double>(x.q.row(k)), VecX<double>(x.qd.row(k)),
                             VecX<double>(x.qdd.row(k)), ws));
  return x;
}

/// A short search: what is looked at are limits.
DesignOptions quick() {
  DesignOptions o;
  o.motion.duration = o.motion.period = 5.0;
  o.motion.seed = 3;
  o.starts = 5;
  o.iterations = 10;
  return o;
}

}  // namespace

TEST_CASE("excite: limits of what follows in a loop hold in every row", "[excite][loops]") {
  const int bars = GENERATE(3, 4);
  Model model = linkage(bars);
  DesignOptions o = quick();
  const AllJoints free = along(model, design_excitation(model, o).trajectory);
  // The last joint follows: two thirds of what it did.
  const long last = bars - 1;
  const double middle = 0.5 * (free.q.col(last).maxCoeff() + free.q.col(last).minCoeff()),
               half = 0.3 * (free.q.col(last).maxCoeff() - free.q.col(last).minCoeff()),
               speed = 0.6 * free.qd.col(last).cwiseAbs().maxCoeff(),
               effort = 0.9 * free.torque.col(0).cwiseAbs().maxCoeff();
  const std::string name = "j" + std::to_string(bars);
  o.limits.position[name] = {middle - half, middle + half};
  o.limits.velocity[name] = speed;
  o.limits.effort["j1"] = effort;
  const Excitation e = design_excitation(model, o);
  const AllJoints held = along(model, e.trajectory);
  CHECK(held.q.col(last).maxCoeff() <= middle + half + 1e-9);
  CHECK(held.q.col(last).minCoeff() >= middle - half - 1e-9);
  CHECK(held.qd.col(last).cwiseAbs().maxCoeff() <= speed);
  CHECK(held.torque.col(0).cwiseAbs().maxCoeff() <= effort);
  // It is used, too.
  CHECK(held.q.col(last).maxCoeff() - held.q.col(last).minCoeff() > 0.5 * half);
  // From rest.
  CHECK(held.qd.row(0).cwiseAbs().maxCoeff() < 1e-9);
}

TEST_CASE("excite: a random motion of a loop keeps it closed", "[excite][loops]") {
  const Model model = linkage(GENERATE(3, 4));
  const AllJoints x = along(model, random_fourier(model, {.duration = 5.0, .period = 5.0}));
  CHECK(x.q.col(0).maxCoeff() - x.q.col(0).minCoeff() > 0.1);
}

TEST_CASE("excite: more drives than motions are commanded what agrees", "[excite][loops]") {
  const Model model = linkage(3, {0, 2});
  const Excitation e = design_excitation(model, quick());
  REQUIRE(e.trajectory.joint_names == std::vector<std::string>{"j1", "j3"});
  const LoopMotion loop("test", model);
  REQUIRE(loop.leads().size() == 1);
  const AllJoints x = along(model, e.trajectory);
  for (const int j : {0, 2})
    CHECK((x.q.col(j) - e.trajectory.q.col(j == 0 ? 0 : 1)).cwiseAbs().maxCoeff() < 1e-8);
  std::string notes;
  for (const std::string& note : e.notes) notes += note + "\n";
  CHECK_THAT(notes, ContainsSubstring("follows in its loop"));
}

TEST_CASE("excite: ranges that a loop does not reach are narrowed, or refused", "[excite][loops]") {
  const Model model = linkage(4);
  DesignOptions o = quick();
  o.limits.position["j1"] = {-3.0, 0.0};
  const Excitation e = design_excitation(model, o);
  std::string notes;
  for (const std::string& note : e.notes) notes += note + "\n";
  CHECK_THAT(notes, ContainsSubstring("j1: from -3 to 0 its loop does not close"));
  along(model, e.trajectory);
  Model tied = linkage(3);
  DesignOptions never = quick();
  never.limits.position["j3"] = {-3.0, -2.9};  // the other way of assembling it
  CHECK_THROWS_WITH(design_excitation(tied, never),
                    ContainsSubstring("j3 would be at") && ContainsSubstring("-3 to -2.9"));
}

}  // namespace excite_loops_test
