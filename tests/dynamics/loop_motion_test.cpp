/// Motions of closed loops by their leading joints: against differences along the motion, and
/// against forward dynamics under constraints.

#include "dynamics/loop_motion.hpp"

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

#include "support/linkage.hpp"
#include "support/matrix_near.hpp"

namespace loop_motion_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;
using test::linkage;
using test::MatrixNear;

namespace {

constexpr double kStep = 1e-3;  // [s]
/// Central differences of order two, h = 1e-3 s on motions of order 1 rad/s: 1e-6 of order-one
/// third derivatives, those of followers ten times as large.
constexpr double kDifferenceTol = 3e-5;
/// Two algorithms through matrices of condition 100.
constexpr double kIdentityTol = 1e-9;

VecX<double> still(const Model& model) {
  return VecX<double>::Zero(static_cast<long>(joint_names(model).size()));
}

struct Rows {
  RowMatX<double> q, qd, qdd;
};

/// Sines of the leading joints about the home posture.
Rows waves(const LoopMotion& loop, long rows) {
  Rows out;
  out.q = RowMatX<double>::Zero(rows, loop.num_joints());
  out.qd = out.qdd = out.q;
  for (std::size_t i = 0; i < loop.leads().size(); ++i) {
    const int j = loop.leads()[i];
    const double w = 2.0 + static_cast<double>(i), a = 0.2;
    for (long k = 0; k < rows; ++k) {
      const double phase = w * kStep * static_cast<double>(k);
      out.q(k, j) = loop.home()[j] + a * std::sin(phase);
      out.qd(k, j) = a * w * std::cos(phase);
      out.qdd(k, j) = -a * w * w * std::sin(phase);
    }
  }
  return out;
}

}  // namespace

TEST_CASE("loop motion: followers move as differences of their positions say", "[loops]") {
  const int bars = GENERATE(3, 4);
  const Model model = linkage(bars);
  const LoopMotion loop("test", model);
  CHECK(loop.leads() == (bars == 3 ? std::vector<int>{0} : std::vector<int>{0, 1}));
  Rows x = waves(loop, 1500);
  VecX<double> posture = loop.home();
  REQUIRE(loop.follow(x.q, x.qd, x.qdd, posture, 0.05) == x.q.rows());
  const long n = x.q.rows() - 2;
  const RowMatX<double> v = (x.q.bottomRows(n) - x.q.topRows(n)) / (2.0 * kStep),
                        a = (x.qd.bottomRows(n) - x.qd.topRows(n)) / (2.0 * kStep);
  CHECK_THAT(MatX<double>(x.qd.middleRows(1, n)), MatrixNear(MatX<double>(v), kDifferenceTol));
  CHECK_THAT(MatX<double>(x.qdd.middleRows(1, n)),
             MatrixNear(MatX<double>(a), 10 * kDifferenceTol));
  for (const long k : {0L, 700L, 1499L}) {
    const TreeRows<double> at =
        tree_rows(make_tree(model), loop.constraints(), VecX<double>(x.q.row(k)), still(model));
    for (const ConstraintRow<double>& row : at.rows) CHECK_THAT(row.g, WithinAbs(0.0, 1e-9));
  }
}

TEST_CASE("loop motion: torques of the drives move the loop as they were asked to", "[loops]") {
  const std::vector<int> driven =
      GENERATE(std::vector<int>{0}, std::vector<int>{2}, std::vector<int>{0, 2});
  const Model model = linkage(3, driven);
  const LoopMotion loop("test", model);
  REQUIRE(loop.leads().size() == 1);
  const Tree<double> tree = make_tree(model);
  VecX<double> q = loop.home(), qd = still(model), qdd = qd;
  qd[loop.leads()[0]] = 0.7;
  qdd[loop.leads()[0]] = -1.3;
  REQUIRE(loop.follow(q, qd, qdd) > 0.05);
  RneaWorkspace<double, double> ws;
  const VecX<double> tau = loop.at_drives(q, rnea<double, double>(tree, q, qd, qdd, ws));
  for (int j = 0; j < 3; ++j)
    if (model.links[static_cast<std::size_t>(j)].passive) CHECK(tau[j] == 0.0);
  ConstrainedTreeWorkspace<double, double> forward;
  const VecX<double> found = constrained_forward_dynamics<double, double>(tree, loop.constraints(),
                                                                          q, qd, tau, {}, forward);
  CHECK_THAT(found, MatrixNear(qdd, kIdentityTol));
}

TEST_CASE("loop motion: mobility is the acceleration by a torque of one", "[loops]") {
  const Model model = linkage(GENERATE(3, 4));
  const LoopMotion loop("test", model);
  const Tree<double> tree = make_tree(model);
  MassMatrixWorkspace<double, double> mass;
  RneaWorkspace<double, double> ws;
  const VecX<double> q = loop.home(), rest = still(model);
  const MatX<double> M = mass_matrix<double, double>(tree, q, mass);
  const VecX<double> weight = rnea<double, double>(tree, q, rest, rest, ws),
                     found = loop.mobility(q, M);
  ConstrainedTreeWorkspace<double, double> forward;
  for (long j = 0; j < q.size(); ++j) {
    VecX<double> tau = weight;
    tau[j] += 1.0;
    const VecX<double> qdd = constrained_forward_dynamics<double, double>(
        tree, loop.constraints(), q, rest, tau, {}, forward);
    CHECK_THAT(found[j], WithinAbs(qdd[j], kIdentityTol * (1.0 + std::abs(qdd[j]))));
  }
}

TEST_CASE("loop motion: a drift is taken back, and a way ends where the loop opens", "[loops]") {
  const LoopMotion loop("test", linkage(3));
  VecX<double> q = loop.home(), qd = VecX<double>::Constant(3, 0.5);
  q[1] += 1e-3;
  REQUIRE(loop.hold(q, qd));
  CHECK((q - loop.home()).norm() < 3e-3);
  const VecX<double> v = qd;
  REQUIRE(loop.hold(q, qd));
  CHECK_THAT(qd, MatrixNear(v, 1e-12));
  // A five-bar whose two driven bars point away from each other cannot be closed.
  const LoopMotion two("test", linkage(4));
  VecX<double> at = two.home(), to = two.positions_of_leads(at);
  to[0] = 3.1;  // the first bar points away from the pin
  to[1] = 0.0;  // and the second goes on
  CHECK_FALSE(two.move(to, at));
  const TreeRows<double> rows =
      tree_rows(make_tree(linkage(4)), two.constraints(), at, VecX<double>(VecX<double>::Zero(4)));
  for (const ConstraintRow<double>& row : rows.rows) CHECK(std::abs(row.g) < 1e-9);
}

TEST_CASE("loop motion: a stretched linkage is closed from elsewhere, within its limits",
          "[loops]") {
  Model model = linkage(3);
  model.home.clear();  // all bars in line: no step of theirs leads to the pin
  for (ModelLink& link : model.links) {
    link.limits.lower = -2.5;
    link.limits.upper = 2.5;
  }
  const LoopMotion loop("test", model);
  CHECK(loop.home().cwiseAbs().maxCoeff() <= 2.5);
  CHECK(loop.home() == LoopMotion("test", model).home());
}

TEST_CASE("loop motion: a weld is closed where frames agree, not half a turn apart", "[loops]") {
  Model model = linkage(4, {0});
  model.links[3].X_PJ.p.x = 0.7;
  // The last bar is held as a body of the ground is, turned by 40 degrees; half a turn more would
  // satisfy the weld's rows as well.
  ConstraintSpec& weld = model.constraints[0];
  weld.kind = ConstraintKind::kWeld;
  weld.first.X_LF = {rotation_about<double>({0, 1, 0}, 0.7), {0.9, 0, 0}};
  weld.second.X_LF = Pose<double>::identity();
  for (const double last : {0.9, 0.9 - 2.5, 0.9 + 2.5}) {
    model.home = {-1.1, 0.8, 0.9, last};
    const LoopMotion loop("test", model);
    CHECK_THAT(std::cos(loop.home().sum() - 0.7), WithinAbs(1.0, 1e-9));
  }
}

TEST_CASE("loop motion: what cannot be followed is refused by name", "[loops]") {
  Model far = linkage(3);
  far.constraints[0].first.X_LF.p.x = 3.0;
  CHECK_THROWS_WITH(LoopMotion("simulate", far),
                    ContainsSubstring("simulate: no posture near where the joints of 'linkage'") &&
                        ContainsSubstring("'pin' is apart by"));
  CHECK_THROWS_WITH(
      LoopMotion("simulate", linkage(4, {1})),
      ContainsSubstring("leave 2 of 4 motions") && ContainsSubstring("hold 1 of them (j2)"));
  CHECK_THROWS_WITH(LoopMotion("simulate", linkage(3, {})), ContainsSubstring("hold 0 of them"));
  Model welded = linkage(3);
  welded.constraints[0].kind = ConstraintKind::kWeld;
  CHECK_THROWS_AS(LoopMotion("simulate", welded), ModelError);
  Model wheel = linkage(3);
  wheel.constraints[0].kind = ConstraintKind::kRolling;
  CHECK_THROWS_WITH(LoopMotion("simulate", wheel), ContainsSubstring("wheel 'pin'"));
  Model floating = linkage(3);
  ModelLink base;
  base.name = "base";
  base.type = ModelJoint::kFixed;
  floating.links.insert(floating.links.begin(), base);
  for (std::size_t i = 1; i < floating.links.size(); ++i)
    floating.links[i].parent = static_cast<int>(i) - 1;
  floating.constraints[0].second.link += 1;
  floating.free_base = true;
  CHECK_THROWS_WITH(LoopMotion("simulate", floating), ContainsSubstring("--fix-base"));
}

}  // namespace loop_motion_test
