/// Rotors behind springs and gaps in simulated windows: against the closed form of two masses, and
/// derivatives against central differences.

#include "motion/hidden_rotors.hpp"

#include <cmath>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include "motion/joint_windows.hpp"

namespace hidden_rotors_test {

using namespace diffnea;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;

namespace {

constexpr double kLink = 0.02, kRotor = 0.05;  // [kg·m²]

/// A wheel about the vertical, or a pendulum, behind its rotor.
Model two_masses(bool hangs) {
  Model model;
  model.name = "two masses";
  ModelLink base, arm;
  base.name = "base";
  arm.name = "arm";
  arm.joint = "servo";
  arm.parent = 0;
  arm.type = ModelJoint::kRevolute;
  arm.axis = hangs ? Vec3<double>{0, 1, 0} : Vec3<double>{0, 0, 1};
  const double m = 0.5, l = hangs ? 0.1 : 0.0;
  arm.inertia.m = m;
  arm.inertia.h = {0.0, 0.0, -m * l};
  arm.inertia.I = {};
  arm.inertia.I.xx = arm.inertia.I.yy = arm.inertia.I.zz = kLink;
  model.links = {base, arm};
  model.effects.push_back({"armature", "servo", {{"armature", kRotor, ""}}});
  return model;
}

Model with(Model model, const EffectSpec& spec) {
  model.effects.push_back(spec);
  return model;
}

EffectSpec elasticity(double stiffness, double damping, double side) {
  return {"joint_elasticity",
          "servo",
          {{"stiffness", stiffness, ""}, {"damping", damping, ""}, {"encoder_side", side, ""}}};
}

EffectSpec backlash(double gap, double side) {
  return {"backlash",
          "servo",
          {{"gap", gap, ""},
           {"stiffness", 2e3, ""},
           {"motor_inertia", kRotor, ""},
           {"restitution", 0.3, ""},
           {"encoder_side", side, ""}}};
}

std::vector<BoundEffect> bound(const Model& model) {
  std::vector<BoundEffect> out;
  for (const EffectSpec& spec : model.effects) out.push_back(bind(spec, model));
  return out;
}

/// Rows 5 ms apart with a torque, and positions that are none.
MotionStretch rows(long count, const std::function<double(double)>& torque) {
  MotionStretch s;
  s.q = RowMatX<double>::Zero(count, 1);
  s.u.resize(count, 1);
  for (long k = 0; k < count; ++k) {
    s.time.push_back(0.005 * static_cast<double>(k));
    s.u(k, 0) = torque(s.time.back());
  }
  s.u_end = s.u;
  s.u_end.topRows(count - 1) = s.u.bottomRows(count - 1);
  return s;
}

MotionStretch commanded(long count) {
  MotionStretch s = rows(count, [](double) { return 0.0; });
  RowMatX<double> c(count, 1);
  for (long k = 0; k < count; ++k)
    c(k, 0) = 0.6 * std::sin(5.0 * s.time[static_cast<std::size_t>(k)]) +
              0.2 * std::sin(17.0 * s.time[static_cast<std::size_t>(k)]);
  s.command = std::make_shared<const CommandPath>(s.time, c, VecX<double>::Ones(1));
  return s;
}

RowMatX<double> positions(const Model& model, const MotionStretch& s, const MotionWindow& w) {
  return JointWindows(extend(model), bound(model), {}, {}).positions(s, w);
}

/// Derivatives of a window by its first state and some parameters, against central differences.
/// @param tolerance  of an entry of JᵀJ, over the norms of its two columns
void check_derivatives(const Model& model, const MotionStretch& s, const MotionWindow& w,
                       const std::vector<MotionParameter>& free, double tolerance) {
  JointWindows simulator(extend(model), bound(model), free, {});
  const int columns = 2 + static_cast<int>(free.size());
  TriangularFactor factor(columns);
  REQUIRE(simulator.linearise(s, w, VecX<double>::Ones(1), factor));
  const auto moved = [&](int column, double by) {
    Model m = model;
    MotionWindow at = w;
    if (column >= 0 && column < 2) at.state[column] += by;
    if (column >= 2) {
      const MotionParameter& p = free[static_cast<std::size_t>(column - 2)];
      SpatialInertia<double>& inertia = m.links[1].inertia;
      if (p.effect < 0) (p.theta == 7 ? inertia.I.yy : inertia.h.z) += by;
      if (p.effect >= 0) {
        double& value = m.effects[static_cast<std::size_t>(p.effect)]
                            .parameters[static_cast<std::size_t>(p.index)]
                            .value;
        value = p.logarithmic ? value * std::exp(by) : value + by;
      }
    }
    return VecX<double>(positions(m, s, at).col(0));
  };
  const VecX<double> at = moved(-1, 0.0);
  MatX<double> J(at.size(), columns + 1);
  constexpr double kStep = 1e-6;
  for (int c = 0; c < columns; ++c) J.col(c) = (moved(c, kStep) - moved(c, -kStep)) / (2.0 * kStep);
  J.col(columns) = at;
  MatX<double> R = MatX<double>::Zero(columns + 1, columns + 1);
  R.topLeftCorner(columns, columns) = factor.R();
  R.topRightCorner(columns, 1) = factor.d();
  R(columns, columns) = std::sqrt(factor.residual_sum_of_squares());
  const MatX<double> gram = R.transpose() * R, expected = J.transpose() * J;
  for (int i = 0; i <= columns; ++i)
    for (int k = 0; k <= columns; ++k) {
      CAPTURE(i, k);
      CHECK(std::abs(gram(i, k) - expected(i, k)) <
            tolerance * std::sqrt(expected(i, i) * expected(k, k)));
    }
}

}  // namespace

TEST_CASE("hidden rotor: a torque at the link moves it within its gap, one at the drive does not",
          "[motion]") {
  constexpr double kGap = 0.03;
  const Model model = with(with(two_masses(false), backlash(kGap, 0.0)),
                           {"viscous_friction", "servo", {{"viscous", 5.0, ""}}});
  MotionStretch s = rows(400, [](double t) { return 0.2 * std::sin(20.0 * t); });
  const MotionWindow w{0, 0, 400, VecX<double>::Zero(2)};
  const auto range = [&] {
    const VecX<double> q = positions(model, s, w).col(0);
    return q.maxCoeff() - q.minCoeff();
  };
  // The motor, which friction holds, swings by 0.2 / (5 · 20) = 2 mrad; alone, the link by 25 mrad.
  CHECK(range() < 0.2 * kGap);
  s.at_links = true;
  CHECK(range() > 0.8 * kGap);
}

TEST_CASE("hidden rotors: a step of torque swings two masses as the closed form has it",
          "[motion]") {
  const double side = GENERATE(0.0, 1.0), stiffness = GENERATE(30.0, 2000.0);
  CAPTURE(side, stiffness);
  const Model model = with(two_masses(false), elasticity(stiffness, 0.0, side));
  constexpr double kTorque = 0.4, kSpeed = 0.3;
  const MotionStretch s = rows(80, [](double) { return kTorque; });
  MotionWindow w{0, 0, 80, VecX<double>(2)};
  w.state << 0.1, kSpeed;
  const RowMatX<double> q = positions(model, s, w);
  const double both = kLink + kRotor,
               frequency = std::sqrt(stiffness * (1.0 / kLink + 1.0 / kRotor));
  for (long k = 0; k < 80; ++k) {
    const double t = s.time[static_cast<std::size_t>(k)],
                 centre = 0.1 + kSpeed * t + 0.5 * kTorque / both * t * t,
                 wound =
                     kTorque / (kRotor * frequency * frequency) * (1.0 - std::cos(frequency * t));
    const double expected =
        side > 0.5 ? centre + kLink / both * wound : centre - kRotor / both * wound;
    // Runge–Kutta 4 at 0.5 rad a step: the phase of the swing is off by 5e-4 a radian.
    const double amplitude = kTorque / (kRotor * frequency * frequency);
    CHECK(std::abs(q(k, 0) - expected) < 6e-4 * frequency * t * amplitude + 1e-9);
  }
}

TEST_CASE("hidden rotors: within its gap a rotor flies alone, beyond it takes the link along",
          "[motion]") {
  const Model model = with(two_masses(false), backlash(0.05, 1.0));
  const MotionStretch s = rows(200, [](double) { return 0.2; });
  MotionWindow w{0, 0, 200, VecX<double>(2)};
  w.state << 0.0, 0.0;
  const RowMatX<double> q = positions(model, s, w);
  // No load: it begins in the middle. Half of the gap takes √(β J/τ) s.
  const double flight = std::sqrt(0.05 * kRotor / 0.2);
  for (long k = 0; s.time[static_cast<std::size_t>(k)] < flight; ++k)
    CHECK(
        q(k, 0) ==
        Approx(0.5 * 0.2 / kRotor * std::pow(s.time[static_cast<std::size_t>(k)], 2)).margin(1e-9));
  // Bounces of a restitution of 0.3 are soon over: then the acceleration is that of both.
  const double dt = 0.1, a = (q(199, 0) - 2.0 * q(179, 0) + q(159, 0)) / (dt * dt);
  CHECK(a == Approx(0.2 / (kLink + kRotor)).epsilon(0.02));
}

TEST_CASE("hidden rotors: derivatives of windows, by central differences", "[motion]") {
  const double side = GENERATE(0.0, 1.0);
  const bool gap = GENERATE(false, true), servo = GENERATE(false, true);
  CAPTURE(side, gap, servo);
  Model model = two_masses(true);
  model.effects.push_back(
      {"coulomb_friction", "servo", {{"coulomb", 0.05, ""}, {"smoothing", 0.2, ""}}});
  model.effects.push_back({"joint_spring", "servo", {{"stiffness", 0.3, ""}}});
  if (servo)
    model.effects.push_back(
        {"position_servo",
         "servo",
         {{"stiffness", 12.0, ""}, {"damping", 0.4, ""}, {"delay", 0.011, ""}}});
  model.effects.push_back(gap ? backlash(0.03, side) : elasticity(60.0, 0.05, side));
  const int gear = static_cast<int>(model.effects.size()) - 1;
  const MotionStretch s =
      servo ? commanded(150) : rows(150, [](double t) { return 0.5 * std::sin(9.0 * t); });
  MotionWindow w{0, 20, 120, VecX<double>(2)};
  w.state << 0.2, -0.4;
  // I_yy, h_z, armature, Coulomb, the gear's stiffness or gap, damping, the drive's gain and delay
  std::vector<MotionParameter> free{{.dof = 0, .theta = 7},
                                    {.dof = 0, .theta = 3},
                                    {.effect = 0, .index = 0},
                                    {.effect = 1, .index = 0},
                                    {.effect = gear, .index = 0, .logarithmic = true}};
  if (!gap) free.push_back({.effect = gear, .index = 1});
  if (servo) {
    free.push_back({.effect = 3, .index = 0});
    free.push_back({.effect = 3, .index = 2});
  }
  /// A smooth run: what h = 1e-6 leaves. Teeth that meet within a step have a kink there, and their
  /// damping follows the inertias, which the derivatives by these leave out.
  check_derivatives(model, s, w, free, gap ? 0.1 : 1e-5);
}

TEST_CASE("hidden rotors: a drive that integrates its error, and follows its supply", "[motion]") {
  // A wheel without friction or braking: J q̈ = K (c − q + z w), ẇ = c − q; of a step it is linear.
  Model model = two_masses(false);
  constexpr double kGain = 2.0, kRate = 1.5, kVolts = 6.0, kNominal = 7.5;
  model.effects.push_back(
      {"position_servo", "servo", {{"stiffness", kGain, ""}, {"damping", 0.3, ""}}});
  model.effects.push_back({"integral_action", "servo", {{"rate", kRate, ""}}});
  model.effects.push_back({"supply_sag", "servo", {{"nominal", kNominal, ""}}});
  MotionStretch s = rows(300, [](double) { return 0.0; });
  CommandPath path(s.time, RowMatX<double>::Ones(300, 1), VecX<double>::Ones(1));
  path.set_supply(RowMatX<double>::Constant(300, 1, kVolts));
  s.command = std::make_shared<const CommandPath>(path);
  MotionWindow w{0, 0, 300, VecX<double>::Zero(2)};
  const RowMatX<double> q = positions(model, s, w);
  Eigen::Matrix3d A;
  A << 0, 1, 0, -1, 0, kRate, -1, 0, 0;
  A.row(1) *= kGain * kVolts / kNominal / (kLink + kRotor);
  A(1, 1) = -0.3 / (kLink + kRotor);
  // The equilibrium is q = 1, ẇ = 0: x − x∞ decays by exp(A t), in steps of a hundredth of a row.
  const Eigen::Matrix3d H = A * 0.00005,
                        step = Eigen::Matrix3d::Identity() + H + 0.5 * H * H + H * H * H / 6.0;
  Eigen::Vector3d x(-1.0, 0.0, 0.0);
  for (long k = 0; k < 300; ++k) {
    CHECK(q(k, 0) == Approx(1.0 + x[0]).margin(1e-5));  // Runge–Kutta at a step's phase of 0.03
    for (int i = 0; i < 100; ++i) x = step * x;
  }
}

TEST_CASE("hidden rotors: derivatives of a drive with an integral and a supply", "[motion]") {
  const bool geared = GENERATE(false, true);
  CAPTURE(geared);
  Model model = two_masses(true);
  model.effects.push_back(
      {"coulomb_friction", "servo", {{"coulomb", 0.05, ""}, {"smoothing", 0.2, ""}}});
  model.effects.push_back({"position_servo",
                           "servo",
                           {{"stiffness", 12.0, ""}, {"damping", 0.4, ""}, {"delay", 0.011, ""}}});
  model.effects.push_back({"integral_action", "servo", {{"rate", 2.5, ""}}});
  model.effects.push_back({"supply_sag", "servo", {{"share", 0.8, ""}, {"nominal", 7.4, ""}}});
  if (geared) model.effects.push_back(elasticity(60.0, 0.05, 0.0));
  MotionStretch s = commanded(150);
  CommandPath path = *s.command;
  RowMatX<double> volts(150, 1);
  for (long k = 0; k < 150; ++k) volts(k, 0) = 7.0 + std::cos(0.1 * static_cast<double>(k));
  path.set_supply(volts);
  s.command = std::make_shared<const CommandPath>(path);
  MotionWindow w{0, 20, 120, VecX<double>(2)};
  w.state << 0.2, -0.4;
  // I_yy, armature, gain, damping, delay, rate, share
  const std::vector<MotionParameter> free{{.dof = 0, .theta = 7},    {.effect = 0, .index = 0},
                                          {.effect = 2, .index = 0}, {.effect = 2, .index = 1},
                                          {.effect = 2, .index = 2}, {.effect = 3, .index = 0},
                                          {.effect = 4, .index = 0}};
  check_derivatives(model, s, w, free, 1e-5);
}

TEST_CASE("hidden rotors: where effects act, and what cannot be", "[motion]") {
  Model model = with(two_masses(true), elasticity(50.0, 0.0, 1.0));
  model.effects.back().parameters.push_back({"friction_share", 0.25, ""});
  model.effects.push_back({"coulomb_friction", "servo", {{"coulomb", 0.1, ""}}});
  ExtendedTree tree = extend(model);
  const HiddenRotors rotors(tree);
  REQUIRE(rotors.dofs() == 2);
  CHECK(rotors.encoder(0) == 1);
  CHECK(tree.tree.armature(0) == 0.0);
  CHECK(tree.tree.armature(1) == kRotor);
  const auto parts = rotors.parts(bind({"coulomb_friction", "servo", {}}, model));
  REQUIRE(parts.size() == 2);
  CHECK((parts[0].effect.joints[0] == 0 && parts[0].share == 0.75));
  CHECK((parts[1].effect.joints[0] == 1 && parts[1].share == 0.25));
  // The drive is fed back from the encoder, all of it at the rotor.
  const auto drive = rotors.parts(bind({"position_servo", "servo", {}}, model));
  REQUIRE(drive.size() == 1);
  CHECK(drive[0].effect.joints == std::vector<int>{1});
  CHECK(drive[0].effect.encoders == std::vector<int>{1});

  ExtendedTree loaded = extend(with(model, {"load_friction", "servo", {{"mu", 0.1, ""}}}));
  CHECK_THROWS_WITH(HiddenRotors(loaded), ContainsSubstring("load_friction"));
  ExtendedTree twice = extend(with(model, backlash(0.01, 0.0)));
  CHECK_THROWS_WITH(HiddenRotors(twice), ContainsSubstring("one elasticity or backlash a joint"));
}

}  // namespace hidden_rotors_test
