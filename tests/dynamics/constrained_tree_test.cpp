/// Constraints between links of a tree: against the same bodies in maximal coordinates, energy, and
/// differences.

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/dynamics/constrained_tree.hpp>
#include <diffnea/dynamics/constraint_projection.hpp>
#include <diffnea/dynamics/constraints.hpp>
#include <diffnea/model/model.hpp>

#include "support/jet_jacobian.hpp"
#include "support/matrix_near.hpp"
#include "support/planar_loop.hpp"
#include "support/random_floating.hpp"

namespace constrained_tree_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;
using test::MatrixNear;
using test::PlanarLoop;

namespace {

const Vec3<double> kZero{0, 0, 0};
constexpr Stabilisation kNone{};

/// Two algorithms, accelerations of order 100: rounding of the loop's solve leaves 1e-11
/// (observed).
constexpr double kIdentityTol = 1e-9;
/// Central difference, h = 1e-6 on accelerations of order 100: rounding leaves 1e-7.
constexpr double kCentralDifferenceTol = 1e-5;

template <class Constraints>
VecX<double> accelerations(const Tree<double>& tree, const Constraints& constraints,
                           const VecX<double>& q, const VecX<double>& v, const VecX<double>& tau,
                           const Stabilisation& stabilisation = kNone) {
  ConstrainedTreeWorkspace<double, double> ws;
  return constrained_forward_dynamics<double, double>(tree, constraints, q, v, tau, stabilisation,
                                                      ws);
}

double energy(const Tree<double>& tree, const VecX<double>& q, const VecX<double>& qd) {
  MassMatrixWorkspace<double, double> ws;
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(tree, q, kinematics);
  double sum = 0.5 * qd.dot(mass_matrix<double, double>(tree, q, ws) * qd);
  for (int i = 0; i < tree.num_links(); ++i) {
    const SpatialInertia<double>& b = tree.links[i].inertia;
    const Pose<double>& X = kinematics.links[i].X_WL;
    sum -= dot(tree.gravity, X.R * b.h + X.p * b.m);
  }
  return sum;
}

/// State [q; q̇] after `steps` of RK4 without torques.
/// @param farthest  gains the largest distance from the first positions
VecX<double> swing(const PlanarLoop& loop, double h, int steps, const Stabilisation& hold,
                   double* farthest = nullptr) {
  const Eigen::Index n = loop.q.size();
  VecX<double> z(2 * n);
  z << loop.q, loop.qd;
  const VecX<double> none = VecX<double>::Zero(n);
  const auto slope = [&](const VecX<double>& at) {
    VecX<double> out(2 * n);
    out << at.tail(n), accelerations(loop.tree, loop, at.head(n), at.tail(n), none, hold);
    return out;
  };
  for (int k = 0; k < steps; ++k) {
    const VecX<double> a = slope(z), b = slope(z + 0.5 * h * a), c = slope(z + 0.5 * h * b),
                       d = slope(z + h * c);
    z += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
    if (farthest) *farthest = std::max(*farthest, (z.head(n) - loop.q).norm());
  }
  return z;
}

double gap(const PlanarLoop& loop, const VecX<double>& q) {
  const TreeRows<double> at = tree_rows(loop.tree, loop, q, VecX<double>::Zero(q.size()));
  double sum = 0.0;
  for (const ConstraintRow<double>& row : at.rows) sum += row.g * row.g;
  return std::sqrt(sum);
}

/// A tree with a loop of each kind, through followers or a free base if asked.
struct RandomLoops {
  explicit RandomLoops(unsigned seed, bool floats) {
    Rng rng(seed + 40);
    test::RandomArmOptions options;
    options.num_dofs = 7;
    options.branching = floats;  // a branch on the world may be held whole
    tree = floats ? test::random_floating_tree(rng, options) : test::random_tree(rng, options);
    if (!floats)  // joint 3 follows joint 1
      tree.coordinates = {6, {{0}, {1}, {2}, {1, -0.7, 0.2}, {3}, {4}, {5}}};
    q = floats ? test::random_positions(rng, tree) : test::random_vector(rng, 6);
    v = test::random_vector(rng, tree.num_velocities());
    tau = test::random_vector(rng, tree.num_velocities(), 3.0);
    rod = {test::random_vec3(rng), test::random_vec3(rng), 0.7};
    ball = {test::random_vec3(rng), test::random_vec3(rng)};
    wheel = {test::random_vec3(rng), test::random_unit(rng), 0.3};
  }
  template <class Links, class Rows>
  void operator()(const Links& links, Rows& rows) const {
    append_rows(rod, "rod", {kWorld, 5}, links, rows);
    append_rows(ball, "ball", {2, 6}, links, rows);
    append_rows(wheel, "wheel", {4}, links, rows);
  }
  Tree<double> tree;
  VecX<double> q, v, tau;
  Rod<double> rod;
  BallJoint<double> ball;
  RollingWheel<double> wheel;
};

}  // namespace

TEST_CASE("constrained tree: four-bar and five-bar move as in maximal coordinates",
          "[constraints][loops]") {
  const int bars = GENERATE(3, 4);
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(bars, seed);
  const PlanarLoop loop(seed, bars);
  REQUIRE(loop.residual < 1e-11);
  ConstrainedTreeWorkspace<double, double> ws;
  const VecX<double> qdd = constrained_forward_dynamics<double, double>(
      loop.tree, loop, loop.q, loop.qd, loop.tau, kNone, ws);
  LinkKinematics<double> expected;
  forward_kinematics<double, double>(loop.tree, loop.q, loop.qd, qdd, expected);
  const ConstrainedAcceleration<double> found = test::in_maximal_coordinates(loop);
  for (int i = 0; i < bars; ++i)
    for (int k = 0; k < 6; ++k) {
      CAPTURE(i, k);
      Twist<double> a = found.Vd[i], b = expected.links[i].A;
      CHECK_THAT(detail::component(a, k), WithinAbs(detail::component(b, k), kIdentityTol));
    }
  // Without the pin the motion is another one.
  const auto open = [](const auto&, auto&) {};
  CHECK((accelerations(loop.tree, open, loop.q, loop.qd, loop.tau) - qdd).norm() > 1e-2);
}

TEST_CASE("constrained tree: rows are derivatives of g along the tree's motion",
          "[constraints][loops]") {
  const bool floats = GENERATE(false, true);
  const unsigned seed = GENERATE(range(0u, 5u));
  CAPTURE(floats, seed);
  const RandomLoops x(seed, floats);
  const TreeRows<double> at = tree_rows(x.tree, x, x.q, x.v);
  REQUIRE(at.J.rows() == 6);
  const double h = 1e-4;
  const auto moved = [&](double t, const VecX<double>& v) {
    return tree_rows(x.tree, x, integrate<double, double>(x.tree, x.q, v * t), v);
  };
  const TreeRows<double> minus = moved(-h, x.v), plus = moved(h, x.v);
  for (int r = 0; r < 6; ++r) {
    CAPTURE(r);
    const ConstraintRow<double>& row = at.rows[r];
    const double first = (plus.rows[r].g - minus.rows[r].g) / (2 * h);
    // A step of a free base at constant twist has no acceleration either. O(h²), as are all here.
    if (row.of_velocity) {
      CHECK_THAT(at.bias[r], WithinAbs(first, 1e-5));
      for (int c = 0; c < x.v.size(); ++c) {
        VecX<double> more = x.v;
        more[c] += 1.0;  // g is linear in v
        CHECK_THAT(at.J(r, c), WithinAbs(tree_rows(x.tree, x, x.q, more).rows[r].g - row.g, 1e-9));
      }
    } else {
      CHECK_THAT(at.J.row(r).dot(x.v), WithinAbs(row.gd, 1e-11));
      CHECK_THAT(row.gd, WithinAbs(first, 1e-5));
      CHECK_THAT(at.bias[r], WithinAbs((plus.rows[r].gd - minus.rows[r].gd) / (2 * h), 1e-5));
      for (int c = 0; c < x.v.size(); ++c) {
        const VecX<double> unit = VecX<double>::Unit(x.v.size(), c);
        const double slope = (moved(h, unit).rows[r].g - moved(-h, unit).rows[r].g) / (2 * h);
        CHECK_THAT(at.J(r, c), WithinAbs(slope, 1e-6));
      }
    }
  }
  // And accelerations satisfy them: J v̇ + γ = 0.
  ConstrainedTreeWorkspace<double, double> ws;
  const VecX<double> vd =
      constrained_forward_dynamics<double, double>(x.tree, x, x.q, x.v, x.tau, kNone, ws);
  CHECK_THAT(at.J * vd + at.bias, MatrixNear(VecX<double>::Zero(6), kIdentityTol));
  // With the constraints' torques applied, the open tree moves so too.
  const auto open = [](const auto&, auto&) {};
  CHECK_THAT(accelerations(x.tree, open, x.q, x.v, x.tau + ws.force), MatrixNear(vd, kIdentityTol));
}

TEST_CASE("constrained tree: energy of a swinging loop is kept, and drift is held",
          "[constraints][loops]") {
  const int bars = GENERATE(3, 4);
  CAPTURE(bars);
  const PlanarLoop loop(2, bars);
  const double before = energy(loop.tree, loop.q, loop.qd);
  // 2 s in steps of 0.5 ms, RK4.
  double farthest = 0.0;
  const VecX<double> z = swing(loop, 5e-4, 4000, kNone, &farthest);
  CHECK_THAT(energy(loop.tree, z.head(bars), z.tail(bars)), WithinAbs(before, 1e-6));
  CHECK(farthest > 0.5);                  // it did swing
  CHECK(gap(loop, z.head(bars)) < 1e-6);  // [m]

  // From a state that is 5 mm open: without stabilisation the gap stays or grows.
  PlanarLoop open = loop;
  open.q[0] += 0.02;
  REQUIRE(gap(loop, open.q) > 3e-3);
  open.qd = project_velocities(loop.tree, loop, open.q, loop.qd);
  CHECK(gap(loop, swing(open, 5e-4, 1000, kNone).head(bars)) > 2e-3);
  CHECK(gap(loop, swing(open, 5e-4, 1000, Stabilisation::within(0.02)).head(bars)) < 1e-6);
}

TEST_CASE("constrained tree: redundant constraints change nothing, contradictions are named",
          "[constraints][loops]") {
  const PlanarLoop loop(3, 3);
  const auto twice = [&](const auto& links, auto& rows) {
    loop(links, rows);
    append_rows(loop.pin, "pin again", {kWorld, 2}, links, rows);
  };
  const VecX<double> qdd = accelerations(loop.tree, loop, loop.q, loop.qd, loop.tau);
  CHECK_THAT(accelerations(loop.tree, twice, loop.q, loop.qd, loop.tau),
             MatrixNear(qdd, kIdentityTol));
  // A rod that ends in the same pin: it may only turn about it, and the loop moves as before.
  CHECK(constraint_null_space(tree_rows(loop.tree, twice, loop.q, loop.qd).J).cols() == 1);

  // Another point of the last bar on the ground as well leaves no motion, and it moves.
  const auto stuck = [&](const auto& links, auto& rows) {
    loop(links, rows);
    append_rows(BallJoint<double>{kZero, kZero}, "stuck", {kWorld, 2}, links, rows);
  };
  CHECK_THROWS_WITH(accelerations(loop.tree, stuck, loop.q, loop.qd, loop.tau),
                    ContainsSubstring("contradicts the others") && ContainsSubstring("'stuck'") &&
                        ContainsSubstring("'pin'"));
}

TEST_CASE("constrained tree: something that moves without inertia is an error, not NaN",
          "[constraints][loops]") {
  PlanarLoop loop(3, 3);
  loop.tree.links[2].inertia = {};
  CHECK_THROWS_WITH(accelerations(loop.tree, loop, loop.q, loop.qd, loop.tau),
                    ContainsSubstring("no inertia"));
}

TEST_CASE("constrained tree: Jets give the derivatives by state and parameters",
          "[constraints][loops]") {
  const int bars = GENERATE(3, 4);
  const unsigned seed = GENERATE(range(0u, 3u));
  CAPTURE(bars, seed);
  const PlanarLoop loop(seed, bars);
  VecX<double> z(3 * bars);
  z << loop.q, loop.qd, loop.tau;
  const auto of_state = [&](const auto& x) -> VecX<typename std::decay_t<decltype(x)>::Scalar> {
    using T = typename std::decay_t<decltype(x)>::Scalar;
    ConstrainedTreeWorkspace<double, T> ws;
    return constrained_forward_dynamics<double, T>(loop.tree, loop, x.head(bars),
                                                   x.segment(bars, bars), x.tail(bars), kNone, ws);
  };
  CHECK_THAT(test::jet_jacobian(z, of_state),
             MatrixNear(test::central_jacobian(z, 1e-6, of_state), kCentralDifferenceTol));

  // Masses, moments and inertias of all bars, lengths (where the next joint is), and the pin.
  VecX<double> pi(10 * bars + bars - 1 + 6);
  pi << inertial_parameters(loop.tree), [&] {
    VecX<double> more(bars - 1 + 6);
    for (int i = 1; i < bars; ++i) more[i - 1] = loop.tree.links[i].X_PJ.p.x;
    more.tail(6) << to_eigen(loop.pin.p_AP), to_eigen(loop.pin.p_BQ);
    return more;
  }();
  const auto of_parameters =
      [&](const auto& x) -> VecX<typename std::decay_t<decltype(x)>::Scalar> {
    using T = typename std::decay_t<decltype(x)>::Scalar;
    Tree<T> tree = loop.tree.template cast<T>();
    for (int i = 0; i < bars; ++i) {
      Theta<T> theta;
      for (int k = 0; k < kThetaSize; ++k) theta[k] = x[10 * i + k];
      tree.links[i].inertia = SpatialInertia<T>::from_theta(theta);
      if (i > 0) tree.links[i].X_PJ.p.x = x[10 * bars + i - 1];
    }
    const Eigen::Index at = x.size() - 6;
    const BallJoint<T> pin{{x[at], x[at + 1], x[at + 2]}, {x[at + 3], x[at + 4], x[at + 5]}};
    const auto closed = [&](const auto& links, auto& rows) {
      append_rows(pin, "pin", {kWorld, bars - 1}, links, rows);
    };
    ConstrainedTreeWorkspace<T, double> ws;
    return constrained_forward_dynamics<T, double>(tree, closed, loop.q, loop.qd, loop.tau, kNone,
                                                   ws);
  };
  CHECK_THAT(test::jet_jacobian(pi, of_parameters),
             MatrixNear(test::central_jacobian(pi, 1e-6, of_parameters), kCentralDifferenceTol));
}

}  // namespace constrained_tree_test
