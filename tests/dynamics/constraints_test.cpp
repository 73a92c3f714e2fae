/// Bodies in maximal coordinates under constraints, each kind against an independent answer.

#include <cmath>
#include <support/jet_jacobian.hpp>
#include <support/matrix_near.hpp>
#include <support/random_arm.hpp>

#include <Eigen/Cholesky>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/constrained_bodies.hpp>
#include <diffnea/dynamics/constraints.hpp>
#include <diffnea/dynamics/free_motion.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

namespace constraints_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using Rows = std::vector<ConstraintRow<double>>;
using States = std::vector<BodyState<double>>;

namespace {

/// Second difference along the path, h = 1e-4 on values of order 1: rounding 1e-16/h² = 1e-8.
constexpr double kSecondDifferenceTol = 1e-6;
/// Two algorithms on numbers of order 100.
constexpr double kIdentityTol = 1e-9;

const Vec3<double> kGravity{0, 0, -9.81};
const Vec3<double> kZero{0, 0, 0};
const Stabilisation kNone{};

/// X exp(V t) by the series, far beyond double precision for |V t| < 1.
Pose<double> along(const Pose<double>& X, const Twist<double>& V, double t) {
  Eigen::Matrix4d xi = Eigen::Matrix4d::Zero(), term = Eigen::Matrix4d::Identity(), sum = term;
  xi.topLeftCorner<3, 3>() = to_eigen(skew(V.angular));
  xi.topRightCorner<3, 1>() = to_eigen(V.linear);
  for (int k = 1; k < 25; ++k) {
    term = term * xi * (t / k);
    sum += term;
  }
  return X * Pose<double>{mat3<double>(Eigen::Matrix3d(sum.topLeftCorner<3, 3>())),
                          vec3<double>(Eigen::Vector3d(sum.topRightCorner<3, 1>()))};
}

BodyState<double> random_state(Rng& rng) {
  return {test::random_pose(rng, 1.0), {test::random_vec3(rng), test::random_vec3(rng)}};
}

template <class C>
void check_rows_against_differences(const C& constraint, unsigned seed) {
  Rng rng(seed);
  constexpr std::size_t n = C::kBodies;
  States states;
  std::array<int, n> bodies;
  for (std::size_t b = 0; b < n; ++b) {
    states.push_back(random_state(rng));
    bodies[b] = static_cast<int>(b);
  }
  Rows rows;
  append_rows(constraint, "c", bodies, states, rows);
  REQUIRE(rows.size() == C::kRows);
  // g along the path of constant twists V + dV.
  const auto at = [&](double t, const States& s) {
    std::array<Pose<double>, n> X;
    std::array<Twist<double>, n> V;
    for (std::size_t b = 0; b < n; ++b) {
      X[b] = along(s[b].X_WB, s[b].V, t);
      V[b] = s[b].V;
    }
    if constexpr (VelocityConstraint<C>)
      return constraint(X, V);
    else
      return constraint(X);
  };
  const double h = 1e-4;
  const auto minus = at(-h, states), here = at(0.0, states), plus = at(h, states);
  for (std::size_t r = 0; r < C::kRows; ++r) {
    CAPTURE(r, seed);
    CHECK_THAT(rows[r].g, WithinAbs(here[r], 1e-12));
    // Of order h⁴: a wheel that nearly lies flat has large higher derivatives.
    const double first =
        (8 * (plus[r] - minus[r]) - (at(2 * h, states)[r] - at(-2 * h, states)[r])) / (12 * h);
    if constexpr (VelocityConstraint<C>) {
      CHECK_THAT(rows[r].bias, WithinAbs(first, kSecondDifferenceTol));
    } else {
      CHECK_THAT(rows[r].gd, WithinAbs(first, kSecondDifferenceTol));
      CHECK_THAT(rows[r].bias, WithinAbs((plus[r] - 2 * here[r] + minus[r]) / (h * h),
                                         1e2 * kSecondDifferenceTol));
      double JV = 0.0;
      for (std::size_t b = 0; b < n; ++b) JV += dot(states[b].V, rows[r].J[b]);
      CHECK_THAT(JV, WithinAbs(rows[r].gd, 1e-10));
    }
    for (std::size_t b = 0; b < n; ++b)
      for (int k = 0; k < 6; ++k) {
        CAPTURE(b, k);
        Twist<double> unit{kZero, kZero};
        detail::component(unit, k) = 1.0;
        double slope;
        if constexpr (VelocityConstraint<C>) {  // against the twist
          States more = states;
          more[b].V = more[b].V + unit;
          slope = at(0.0, more)[r] - here[r];  // linear in V
        } else {
          States there = states;
          const auto g = [&](double t) {
            there[b].X_WB = along(states[b].X_WB, unit, t);
            return at(0.0, there)[r];
          };
          slope = (g(h) - g(-h)) / (2 * h);
        }
        CHECK_THAT(detail::component(rows[r].J[b], k), WithinAbs(slope, kSecondDifferenceTol));
      }
  }
}

/// The bodies of a tree, joined by hinges, in the state (q, q̇).
struct HingedTree {
  HingedTree(const Tree<double>& tree, const VecX<double>& q, const VecX<double>& qd) {
    LinkKinematics<double> kinematics;
    forward_kinematics<double, double>(tree, q, qd, VecX<double>::Zero(q.size()), kinematics);
    for (std::size_t i = 0; i < tree.links.size(); ++i) {
      const Link<double>& link = tree.links[i];
      bodies.push_back({BodyKind::kRigid, link.inertia});
      states.push_back({kinematics.links[i].X_WL, kinematics.links[i].V});
      applied.push_back({kZero, kZero});
    }
    for (std::size_t i = 0; i < tree.links.size(); ++i) {
      const Link<double>& link = tree.links[i];
      // A frame whose z axis is the joint's.
      const Vec3<double> z = link.axis;
      const Vec3<double> other =
          std::abs(z.x) < 0.8 ? Vec3<double>{1, 0, 0} : Vec3<double>{0, 1, 0};
      Vec3<double> x = cross(other, z);
      x = x * (1.0 / std::sqrt(dot(x, x)));
      const Pose<double> X_LK{{{x, cross(z, x), z}}, kZero};
      const Hinge<double> hinge{link.X_PJ * X_LK, X_LK};
      append_rows(hinge, "joint" + std::to_string(i), {link.parent, static_cast<int>(i)}, states,
                  rows);
    }
  }
  std::vector<FreeBody<double>> bodies;
  States states;
  std::vector<Wrench<double>> applied;
  Rows rows;
};

test::RandomArmOptions revolute() {
  test::RandomArmOptions options;
  options.num_dofs = 4;
  options.prismatic = false;
  options.armature = false;
  return options;
}

}  // namespace

TEST_CASE("constraints: rows are the function's derivatives", "[constraints]") {
  const unsigned seed = GENERATE(range(0u, 5u));
  Rng rng(seed + 100);
  const Vec3<double> p = test::random_vec3(rng), q = test::random_vec3(rng);
  const Vec3<double> axle = test::random_unit(rng);
  check_rows_against_differences(Rod<double>{p, q, 0.4}, seed);
  check_rows_against_differences(String<double>{{p, q, 0.4}}, seed);
  check_rows_against_differences(BallJoint<double>{p, q}, seed);
  check_rows_against_differences(
      Hinge<double>{test::random_pose(rng, 1.0), test::random_pose(rng, 1.0)}, seed);
  check_rows_against_differences(WheelContact<double>{p, axle, 0.3}, seed);
  check_rows_against_differences(RollingWheel<double>{p, axle, 0.3}, seed);
  check_rows_against_differences(Skate<double>{p, axle}, seed);
}

TEST_CASE("constraints: hinged bodies move as the tree of the same links", "[constraints]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  Rng rng(seed);
  const Tree<double> tree = test::random_tree(rng, revolute());
  const int n = tree.num_dofs();
  const VecX<double> q = test::random_vector(rng, n), qd = test::random_vector(rng, n);
  AbaWorkspace<double, double> ws;
  const VecX<double> qdd = aba<double, double>(tree, q, qd, VecX<double>::Zero(n), ws);
  LinkKinematics<double> expected;
  forward_kinematics<double, double>(tree, q, qd, qdd, expected);

  const HingedTree made(tree, q, qd);
  const auto found = constrained_acceleration<double>(made.bodies, made.states, made.applied, {},
                                                      made.rows, tree.gravity, kNone);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < 6; ++k) {
      Twist<double> a = found.Vd[i], b = expected.links[i].A;
      CHECK_THAT(detail::component(a, k), WithinAbs(detail::component(b, k), kIdentityTol));
    }
}

TEST_CASE("constraints: a closed chain moves as the reduced model with the loop's multiplier",
          "[constraints]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  Rng rng(seed);
  const Tree<double> tree = test::random_tree(rng, revolute());
  const int n = tree.num_dofs();
  const VecX<double> q = test::random_vector(rng, n);
  VecX<double> qd = test::random_vector(rng, n);
  // A rod from the world to the last link, at its length now; q̇ made consistent with it.
  const Vec3<double> p_W = test::random_vec3(rng), p_L = test::random_vec3(rng, 0.3);
  const auto loop = [&](const auto& joints) {
    using T = typename std::decay_t<decltype(joints)>::Scalar;
    LinkKinematics<T> kin;
    forward_kinematics<double, T>(tree, joints, kin);
    const Pose<T>& X = kin.links[n - 1].X_WL;
    const Vec3<T> delta = X.R * p_L.cast<T>() + X.p - p_W.cast<T>();
    return VecX<T>::Constant(1, dot(delta, delta)).eval();
  };
  const MatX<double> J = test::jet_jacobian(q, loop);
  qd -= J.transpose() * (J * qd)(0) / J.squaredNorm();
  const auto rate = [&](const auto& joints) {
    using T = typename std::decay_t<decltype(joints)>::Scalar;
    VecX<T> qd_t = qd.cast<T>();
    LinkKinematics<T> kin;
    forward_kinematics<double, T>(tree, joints, qd_t, VecX<T>::Constant(n, T(0.0)), kin);
    const FrameMotion<T> f = frame_motion(kin, n - 1, Pose<double>{Mat3<double>::identity(), p_L});
    const Vec3<T> delta = f.X_WF.p - p_W.cast<T>();
    return VecX<T>::Constant(1, dot(delta, f.velocity) * T(2.0)).eval();
  };
  const double bias = (test::jet_jacobian(q, rate) * qd)(0);

  AbaWorkspace<double, double> ws;
  const VecX<double> free = aba<double, double>(tree, q, qd, VecX<double>::Zero(n), ws);
  MassMatrixWorkspace<double, double> mws;
  const VecX<double> response =
      mass_matrix<double, double>(tree, q, mws).ldlt().solve(J.transpose()).col(0);
  const double lambda = ((J * free)(0) + bias) / (J * response)(0);
  const VecX<double> qdd = free - response * lambda;
  LinkKinematics<double> expected;
  forward_kinematics<double, double>(tree, q, qd, qdd, expected);

  HingedTree made(tree, q, qd);
  const double length = std::sqrt(loop(q)[0]);
  append_rows(Rod<double>{p_W, p_L, length}, "rod", {kWorld, n - 1}, made.states, made.rows);
  const auto found = constrained_acceleration<double>(made.bodies, made.states, made.applied, {},
                                                      made.rows, tree.gravity, kNone);
  CHECK_THAT(found.multiplier.back(), WithinRel(lambda, 1e-7));
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < 6; ++k) {
      Twist<double> a = found.Vd[i], b = expected.links[i].A;
      CHECK_THAT(detail::component(a, k), WithinAbs(detail::component(b, k), 1e-7));
    }
}

TEST_CASE("constraints: redundant ones leave the motion as it is, contradictions are named",
          "[constraints]") {
  // A door on one hinge, and on a second one along the same axis.
  Rng rng(3);
  const FreeBody<double> door{BodyKind::kRigid, test::random_inertia(rng)};
  const States states{{Pose<double>::identity(), {{0, 0, 0.7}, kZero}}};
  const Pose<double> lower = Pose<double>::identity();
  Pose<double> upper = lower;
  upper.p = {0, 0, 0.8};
  Rows one, two;
  append_rows(Hinge<double>{lower, lower}, "lower", {kWorld, 0}, states, one);
  two = one;
  append_rows(Hinge<double>{upper, upper}, "upper", {kWorld, 0}, states, two);
  const std::vector<Wrench<double>> applied{{{0.1, 0.2, 0.3}, {1.0, -2.0, 0.5}}};
  const auto a =
      constrained_acceleration<double>({door}, states, applied, {}, one, kGravity, kNone);
  const auto b =
      constrained_acceleration<double>({door}, states, applied, {}, two, kGravity, kNone);
  CHECK_THAT(b.Vd[0].angular.z, WithinRel(a.Vd[0].angular.z, 1e-9));
  CHECK_THAT(b.Vd[0].angular.x, WithinAbs(0.0, 1e-9));
  CHECK_THAT(b.force[0].force.x, WithinRel(a.force[0].force.x, 1e-9));
  // Five rows of the two hinges' ten are enough.
  const auto count = [](const std::vector<bool>& x) {
    return std::count(x.begin(), x.end(), true);
  };
  CHECK(count(redundant_rows({door}, one, a.multiplier)) == 0);
  CHECK(count(redundant_rows({door}, two, b.multiplier)) == 5);
  CHECK(count(active_rows(two, b.multiplier)) == 10);

  // Turning about two axes at once demands what no force can give.
  Pose<double> beside = lower;
  beside.p = {0.5, 0, 0};
  Rows three = one;
  append_rows(Hinge<double>{beside, beside}, "beside", {kWorld, 0}, states, three);
  CHECK_THROWS_WITH(
      constrained_acceleration<double>({door}, states, applied, {}, three, kGravity, kNone),
      ContainsSubstring("contradicts the others") &&
          ContainsSubstring("the others agree without 'lower' or 'beside'"));
}

TEST_CASE("constraints: strings that nothing can satisfy are named, those that can are not",
          "[constraints]") {
  // A mass that is held, on a taut string to a pivot that drives away; another string is slack.
  const std::vector<FreeBody<double>> bodies{particle(1.0), {BodyKind::kPrescribed, {}}};
  States states{{Pose<double>::identity(), {kZero, kZero}},
                {Pose<double>::identity(), {kZero, kZero}}};
  states[1].X_WB.p = {1, 0, 0};
  Rows rows;
  append_rows(String<double>{{kZero, kZero, 1.0}}, "taut", {0, 1}, states, rows);
  append_rows(String<double>{{kZero, kZero, 9.0}}, "slack", {0, 1}, states, rows);
  append_rows(BallJoint<double>{kZero, kZero}, "held", {kWorld, 0}, states, rows);
  const std::vector<Twist<double>> away{{kZero, kZero}, {kZero, {2, 0, 0}}};
  const std::vector<Wrench<double>> applied(2, {kZero, kZero});
  CHECK_THROWS_WITH(
      constrained_acceleration<double>(bodies, states, applied, away, rows, kGravity, kNone),
      ContainsSubstring("agree without 'taut' or 'held'"));
}

TEST_CASE("constraints: what rounding and drift leave is no contradiction", "[constraints]") {
  // At rest without gravity all that is demanded is the pull of the stabilisation, and of two
  // hinges that share an axis one has drifted by a nanometre.
  Rng rng(3);
  const FreeBody<double> door{BodyKind::kRigid, test::random_inertia(rng)};
  const States states{{Pose<double>::identity(), {kZero, kZero}}};
  const Pose<double> lower = Pose<double>::identity();
  Pose<double> upper = lower;
  upper.p = {1e-9, 0, 0.8};
  Pose<double> upper_B = upper;
  upper_B.p.z += 1e-9;
  Rows rows;
  append_rows(Hinge<double>{lower, lower}, "lower", {kWorld, 0}, states, rows);
  append_rows(Hinge<double>{upper, upper_B}, "upper", {kWorld, 0}, states, rows);
  const auto found = constrained_acceleration<double>({door}, states, {{kZero, kZero}}, {}, rows,
                                                      kZero, Stabilisation::within(0.01));
  CHECK(std::abs(found.Vd[0].angular.z) < 1e-3);
}

TEST_CASE("constraints: a body without mass and a body that is not there are named",
          "[constraints]") {
  const States states(1);
  Rows rows;
  CHECK_THROWS_WITH(
      append_rows(BallJoint<double>{kZero, kZero}, "pivot", {kWorld, 3}, states, rows),
      ContainsSubstring("constraint 'pivot' names body 3"));
  CHECK_THROWS_WITH(constrained_acceleration<double>({particle(0.0)}, states, {{kZero, kZero}}, {},
                                                     rows, kGravity, kNone),
                    ContainsSubstring("body 0 has a mass of 0.0"));
}

TEST_CASE("constraints: a string on a driven pivot pulls, and never pushes", "[constraints]") {
  const double length = 0.4, mass = 0.024;
  const std::vector<FreeBody<double>> bodies{{BodyKind::kPrescribed, {}}, particle(mass)};
  const double angle = GENERATE(-0.9, 0.2, 1.4);
  // The pivot accelerates along x and z; in its frame gravity is g − a.
  const Twist<double> pivot{kZero, {2.0, 0.0, 1.5}};
  const Vec3<double> down{std::sin(angle), 0.0, -std::cos(angle)};
  const Vec3<double> across{std::cos(angle), 0.0, std::sin(angle)};
  const double rate = 3.0;
  States states(2);
  states[1].X_WB.p = down * length;
  states[1].V.linear = across * (rate * length);
  states[0].V = states[1].V = {kZero, states[1].V.linear};
  states[0].V.linear = kZero;
  const String<double> string{{kZero, kZero, length}};
  Rows rows;
  append_rows(string, "string", {0, 1}, states, rows);
  const std::vector<Wrench<double>> applied(2, {kZero, kZero});
  const auto found = constrained_acceleration<double>(bodies, states, applied, {pivot, pivot}, rows,
                                                      kGravity, kNone);
  const Vec3<double> apparent = kGravity - pivot.linear;
  const double tension = mass * (dot(apparent, down) + rate * rate * length);
  REQUIRE(tension > 0.0);
  CHECK_THAT(dot(found.force[1].force, down), WithinRel(-tension, 1e-10));
  // θ̈ of the pendulum, and the pivot feels the tension.
  const double rate_d = dot(found.Vd[1].linear - pivot.linear, across) / length;
  CHECK_THAT(rate_d, WithinRel(dot(apparent, across) / length, 1e-10));
  CHECK_THAT(dot(found.force[0].force, down), WithinRel(tension, 1e-10));

  // Above the pivot and slow: it falls freely, although g = 0.
  states[1].X_WB.p = down * -length;
  states[1].V.linear = across * 0.1;
  rows.clear();
  append_rows(string, "string", {0, 1}, states, rows);
  const auto slack =
      constrained_acceleration<double>(bodies, states, applied, {}, rows, kGravity, kNone);
  CHECK(slack.multiplier[0] == 0.0);
  CHECK_THAT(slack.Vd[1].linear.z, WithinRel(-9.81, 1e-12));

  // Becoming taut: the velocity along the string is lost, or reversed.
  states[1].X_WB.p = down * length;
  states[1].V.linear = down * 2.0 + across * 1.0;
  rows.clear();
  append_rows(string, "string", {0, 1}, states, rows);
  const auto dead = after_impact(bodies, states, rows);
  CHECK_THAT(dot(dead[1].linear, down), WithinAbs(0.0, 1e-12));
  CHECK_THAT(dot(dead[1].linear, across), WithinRel(1.0, 1e-12));
  CHECK_THAT(dot(after_impact(bodies, states, rows, 0.5)[1].linear, down), WithinRel(-1.0, 1e-12));
}

TEST_CASE("constraints: two strings that share a load, one slack", "[constraints]") {
  // A ball below two pivots at one point each: pushed to the right, the right string is slack.
  const std::vector<FreeBody<double>> bodies{particle(1.0)};
  States states(1);
  Rows rows;
  append_rows(String<double>{{{-1, 0, 1}, kZero, std::sqrt(2.0)}}, "left", {kWorld, 0}, states,
              rows);
  append_rows(String<double>{{{1, 0, 1}, kZero, std::sqrt(2.0)}}, "right", {kWorld, 0}, states,
              rows);
  const auto hangs =
      constrained_acceleration<double>(bodies, states, {{kZero, kZero}}, {}, rows, kGravity, kNone);
  CHECK_THAT(hangs.Vd[0].linear.z, WithinAbs(0.0, 1e-12));
  CHECK_THAT(hangs.multiplier[0], WithinRel(hangs.multiplier[1], 1e-12));
  const auto pushed = constrained_acceleration<double>(bodies, states, {{kZero, {20, 0, 0}}}, {},
                                                       rows, kGravity, kNone);
  CHECK(pushed.multiplier[0] > 0.0);
  CHECK(pushed.multiplier[1] == 0.0);
  CHECK_THAT(pushed.Vd[0].linear.x, WithinRel(pushed.Vd[0].linear.z, 1e-12));
}

TEST_CASE("constraints: accelerations differentiate with respect to parameters and state",
          "[constraints]") {
  // Length of a rod, place of its ends, mass and the body's velocity: a loop of two bodies.
  const auto accelerations = [](const auto& x) {
    using T = typename std::decay_t<decltype(x)>::Scalar;
    Rng rng(11);
    const SpatialInertia<double> I = test::random_inertia(rng);
    FreeBody<T> body{BodyKind::kRigid, {T(I.m) + x[4], I.h.cast<T>(), I.I.cast<T>()}};
    std::vector<BodyState<T>> states{
        {test::random_pose(rng, 1.0).cast<T>(), {{T(0.3), x[5], T(-0.2)}, {T(1.0), T(0.5), x[6]}}},
        {test::random_pose(rng, 1.0).cast<T>(), {}}};
    states[1].V = detail::still<T>();
    std::vector<ConstraintRow<T>> rows;
    append_rows(Rod<T>{{x[1], x[2], T(0.1)}, {T(0.1), T(0.2), x[3]}, x[0]}, "rod", {0, 1}, states,
                rows);
    append_rows(BallJoint<T>{{T(0.3), T(0.1), T(0.0)}, {T(0.0), x[1], T(0.2)}}, "ball", {kWorld, 1},
                states, rows);
    const Vec3<T> zero{T(0.0), T(0.0), T(0.0)};
    const auto found =
        constrained_acceleration<T>({body, body}, states, {{zero, zero}, {zero, zero}}, {}, rows,
                                    {T(0.0), T(0.0), T(-9.81)}, Stabilisation::within(0.1));
    VecX<T> out(12);
    for (int b = 0; b < 2; ++b)
      for (int k = 0; k < 6; ++k) {
        Twist<T> a = found.Vd[b];
        out[6 * b + k] = detail::component(a, k);
      }
    return out;
  };
  VecX<double> x(7);
  x << 0.9, 0.2, -0.1, 0.15, 0.3, 0.4, -0.6;
  // Accelerations of order 1e3 (the stabilisation), h = 1e-6: rounding leaves 1e-7, curvature 1e-6.
  const MatX<double> jets = test::jet_jacobian(x, accelerations);
  CHECK_THAT(jets, test::MatrixNear(test::central_jacobian(x, 1e-6, accelerations),
                                    1e-6 * jets.cwiseAbs().maxCoeff()));
}

}  // namespace constraints_test
