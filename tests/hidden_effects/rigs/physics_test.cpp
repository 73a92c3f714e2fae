/// The rigs against closed forms: rigid links, dry friction that sticks, a spring, a gap.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include "plant.hpp"

namespace {

using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using Eigen::Vector3d;
using Eigen::VectorXd;
using namespace rigs;

/// Two recursions in double precision, torques of order 10, documents with 12 digits.
constexpr double kRounding = 1e-8;

Eigen::Matrix4d body(double mass, double at, double xx, double zz) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Zero();
  out(0, 0) = xx + mass * at * at;
  out(1, 1) = 1e-3;
  out(2, 2) = zz;
  out(0, 3) = out(3, 0) = mass * at;
  out(3, 3) = mass;
  return out;
}

Joint hinge(const std::string& name, double offset, const Eigen::Matrix4d& pseudo) {
  Joint out;
  out.name = name;
  out.axis = Vector3d(0.0, -1.0, 0.0);  // positive turns lift the arm
  out.offset = Vector3d(offset, 0.0, 0.0);
  out.pseudo = pseudo;
  return out;
}

/// One mass on a rail across gravity.
Rig on_a_rail(double mass) {
  Rig out;
  out.arm.kind = "arm";
  Joint joint;
  joint.name = "rail";
  joint.slide = true;
  joint.axis = Vector3d(1.0, 0.0, 0.0);
  joint.offset.setZero();
  joint.pseudo = body(mass, 0.0, 1e-3, 1e-3);
  out.arm.joints = {joint};
  out.arm.tip.setZero();
  out.controller = out.arm;
  out.physics = Physics(1);
  out.control.bandwidth = 0.0;  // no torque at all
  out.control.knows_gravity = false;
  out.motor_noise.setZero(1);
  return out;
}

Motion swing(const Arm& arm) {
  MotionPlan plan;
  plan.kind = "multisine";
  plan.waves = 1;
  plan.reach = 1.0;
  plan.speed = 3.0;
  plan.push = 50.0;
  plan.centre.setZero(arm.size());
  return {arm, plan, 5.0, Draw(3, 1)};
}

Sampling every_millisecond(double seconds) {
  Sampling out;
  out.period = 0.001;
  for (int k = 0; k < static_cast<int>(seconds * 1000.0); ++k) out.times.push_back(0.001 * k);
  return out;
}

}  // namespace

TEST_CASE("rigs: torques of a planar arm are the textbook's", "[rigs]") {
  const double l1 = 0.4, m1 = 3.0, c1 = 0.15, m2 = 2.0, c2 = 0.2, g = 9.81;
  const double I1 = 0.03, I2 = 0.02;  // about the centres
  Arm arm;
  arm.kind = "arm";
  arm.joints = {hinge("a", 0.0, body(m1, c1, 0.02, 0.01)),
                hinge("b", l1, body(m2, c2, 0.015, 0.005))};
  arm.tip = Vector3d(0.4, 0.0, 0.0);
  Draw draw(1, 1);
  Rigid rigid(arm);
  for (int i = 0; i < 20; ++i) {
    Eigen::Vector2d q, v, a;
    for (int j = 0; j < 2; ++j)
      q[j] = 2.0 * draw.normal(), v[j] = draw.normal(), a[j] = draw.normal();
    const double C = std::cos(q[1]), S = m2 * l1 * c2 * std::sin(q[1]);
    const double M12 = m2 * (c2 * c2 + l1 * c2 * C) + I2, M22 = m2 * c2 * c2 + I2;
    const double M11 = m1 * c1 * c1 + I1 + m2 * (l1 * l1 + c2 * c2 + 2.0 * l1 * c2 * C) + I2;
    const double outer = m2 * c2 * g * std::cos(q[0] + q[1]);
    const Eigen::Vector2d expected{M11 * a[0] + M12 * a[1] - S * (2.0 * v[0] * v[1] + v[1] * v[1]) +
                                       (m1 * c1 + m2 * l1) * g * std::cos(q[0]) + outer,
                                   M12 * a[0] + M22 * a[1] + S * v[0] * v[0] + outer};
    const VectorXd by_mujoco = rigid.torque(q, v, a);
    const VectorXd by_regressor = regressor(arm, q, v, a) * inertial_parameters(arm);
    for (int j = 0; j < 2; ++j) {
      CHECK_THAT(by_mujoco[j], WithinAbs(expected[j], kRounding));
      CHECK_THAT(by_regressor[j], WithinAbs(expected[j], kRounding));
    }
  }
}

TEST_CASE("rigs: torques of drawn machines are linear in possible bodies", "[rigs]") {
  const auto seed = static_cast<std::uint64_t>(GENERATE(range(0, 12)));
  CAPTURE(seed);
  Draw draw(seed, 5);
  const std::string kind = seed % 4 == 3 ? "gantry" : "arm";
  const Arm arm = draw_arm(kind, 2 + static_cast<int>(seed % 6), false, draw);
  const Arm other = misjudged(arm, 0.05, 0.25, draw);
  for (const Arm* machine : {&arm, &other}) {
    Rigid rigid(*machine);  // MuJoCo refuses bodies that cannot be
    const Eigen::Index n = machine->size();
    VectorXd q(n), v(n), a(n);
    for (Eigen::Index j = 0; j < n; ++j)
      q[j] = draw.normal(), v[j] = draw.normal(), a[j] = draw.normal();
    const VectorXd expected = regressor(*machine, q, v, a) * inertial_parameters(*machine);
    const VectorXd torque = rigid.torque(q, v, a);
    CHECK_THAT((torque - expected).norm(), WithinAbs(0.0, kRounding * (1.0 + expected.norm())));
  }
  const VectorXd off = (inertial_parameters(other) - inertial_parameters(arm)).cwiseAbs();
  for (Eigen::Index b = 0; b < arm.size(); ++b) {
    const double mass = off[10 * b] / inertial_parameters(arm)[10 * b];
    CHECK(mass >= 0.049);
    CHECK(mass <= 0.251);
  }
}

TEST_CASE("rigs: a mass on a spring loses 2 F/k a half swing to dry friction, and sticks",
          "[rigs]") {
  const double mass = 2.0, k = 200.0, F = 0.4;
  const bool bristles = GENERATE(false, true);
  CAPTURE(bristles);
  Rig rig = on_a_rail(mass);
  rig.physics.spring[0] = k;
  rig.physics.coulomb_plus[0] = rig.physics.coulomb_minus[0] = F;
  if (bristles) rig.physics.bristle_width = 2e-5;
  const Sampling rows = every_millisecond(5.0);
  const Track track = simulate(rig, swing(rig.arm), 0, 0.0, 5.0, rows, Draw(1, 1));
  std::vector<double> extremes;
  for (Eigen::Index i = 1; i + 1 < track.q.rows(); ++i) {
    const double before = track.q(i, 0) - track.q(i - 1, 0),
                 after = track.q(i + 1, 0) - track.q(i, 0);
    if (before * after < 0.0 && std::abs(track.q(i, 0)) > 2.0 * F / k)
      extremes.push_back(std::abs(track.q(i, 0)));
  }
  REQUIRE(extremes.size() > 3);
  // Rows miss an extreme by ω² A (0.5 ms)²/2 = 1e-5 A; bristles give by their width.
  for (std::size_t i = 1; i < extremes.size(); ++i)
    CHECK_THAT(extremes[i - 1] - extremes[i], WithinAbs(2.0 * F / k, 5e-5));
  const Eigen::Index last = track.q.rows() - 1;
  CHECK(k * std::abs(track.q(last, 0)) <= F * 1.01);
  if (!bristles) {
    CHECK(track.qd(last, 0) == 0.0);
    CHECK(track.q(last, 0) == track.q(last - 100, 0));
  } else {
    CHECK_THAT(track.qd(last, 0), WithinAbs(0.0, 1e-4));
  }
}

TEST_CASE("rigs: logged torques belong to their row's time", "[rigs]") {
  // Rate of control [Hz] at rows of 10 ms; row's start, its middle, its instant.
  struct Way {
    double rate;
    bool middle, centred, early;
  };
  const Way way = GENERATE(Way{100.0, false, false, false}, Way{500.0, true, true, false},
                           Way{500.0, false, true, true}, Way{1000.0, true, true, false});
  CAPTURE(way.rate, way.middle, way.centred);
  Rig rig = on_a_rail(2.0);
  rig.control.bandwidth = 10.0;
  rig.control.rate = way.rate;
  Sampling rows;
  rows.period = 0.01;
  rows.middle = way.middle;
  rows.centred = way.centred;
  Draw draw(5, 1);
  for (int k = 0; k < 400; ++k)
    rows.times.push_back(std::max(0.0, 0.01 * k + 4e-4 * draw.normal()));
  const Track track = simulate(rig, swing(rig.arm), 0, 0.0, 4.0, rows, Draw(1, 1));
  // Least squares of a shift in time against what acted about the row, or from it on.
  double along = 0.0, square = 0.0;
  for (Eigen::Index k = 2; k + 2 < track.tau.rows(); ++k) {
    const auto mean = [&](Eigen::Index row) {
      return track.mean_tau.col(0).segment(4 * row - (way.early ? 2 : 0), 4).mean();
    };
    const double rate = (mean(k + 1) - mean(k - 1)) / 0.02;
    along += (track.tau(k, 0) - mean(k)) * rate;
    square += rate * rate;
  }
  // Means are of kicks, which begin half a step of 0.25 ms early; steps of the encoders in the
  // commands make 0.1 ms more. A row without the mean of both commands is off by half a tick: 0.5
  // and 1 ms.
  CHECK_THAT(along / square, WithinAbs(1.25e-4, 1.5e-4));
}

TEST_CASE("rigs: a motor on a spring swings against its link", "[rigs]") {
  const double link = 2.0, rotor = 0.5, pull = 3.0, hertz = 11.0;
  const double turn = 2.0 * std::numbers::pi * hertz;
  const double stiffness = turn * turn * link * rotor / (link + rotor);
  Rig rig = on_a_rail(link);
  rig.arm.joints[0].rotor = rotor;
  rig.physics.transmission = {0, false, stiffness, 0.0, 0.0, 0.0};
  rig.physics.offset[0] = -pull;
  rig.control.rate = 1000.0;
  const Sampling rows = every_millisecond(0.3);
  const Track at_link = simulate(rig, swing(rig.arm), 0, 0.0, 0.3, rows, Draw(1, 1));
  rig.motor_encoder = true;
  const Track at_motor = simulate(rig, swing(rig.arm), 0, 0.0, 0.3, rows, Draw(1, 1));
  // It began at rest in the spring 1 s before: 1 − cos about the twist of a steady pull.
  const double twist = pull * link / (link + rotor) / stiffness;
  for (Eigen::Index i = 0; i < at_link.q.rows(); ++i) {
    // The first velocity is that of half a step before.
    const double time = 1.0 + 0.001 * static_cast<double>(i) + 0.5 * 2.5e-4;
    // Leapfrog's frequency is off by (ω h)²/24 = 1e-5: 1e-3 rad after 1.3 s.
    CHECK_THAT(at_motor.q(i, 0) - at_link.q(i, 0),
               WithinAbs(twist * (1.0 - std::cos(turn * time)), 5e-3 * twist));
  }
}

TEST_CASE("rigs: a gap keeps its width and the momentum", "[rigs]") {
  const double link = 2.0, rotor = 0.5, gap = 0.01, amplitude = 3.0;
  Rig rig = on_a_rail(link);
  rig.arm.joints[0].rotor = rotor;
  rig.physics.transmission = {0, true, 0.0, 0.0, gap, 0.4};
  // A ripple over the motor's position that turns its sign drives it from flank to flank.
  rig.physics.ripple_sine[0] = amplitude;
  rig.physics.ripple_cycles[0] = 40.0;
  const Sampling rows = every_millisecond(1.0);
  const Track at_link = simulate(rig, swing(rig.arm), 0, 0.0, 1.0, rows, Draw(1, 1));
  rig.motor_encoder = true;
  const Track at_motor = simulate(rig, swing(rig.arm), 0, 0.0, 1.0, rows, Draw(1, 1));
  const VectorXd twist = (at_motor.q - at_link.q).col(0);
  CHECK(twist.maxCoeff() <= 0.5 * gap * 1.02);
  CHECK(twist.minCoeff() >= -0.5 * gap * 1.02);
  CHECK(twist.maxCoeff() >= 0.49 * gap);
  CHECK(twist.minCoeff() <= -0.49 * gap);
  // Momentum changes by what the ripple pushes alone, by the trapezoid over the rows.
  double push = 0.0;
  const auto force = [&](Eigen::Index i) { return -amplitude * std::sin(40.0 * at_motor.q(i, 0)); };
  for (Eigen::Index i = 1; i < twist.size(); ++i) push += 5e-4 * (force(i) + force(i - 1));
  const auto momentum = [&](Eigen::Index i) {
    return rotor * at_motor.qd(i, 0) + link * at_link.qd(i, 0);
  };
  CHECK_THAT(momentum(twist.size() - 1) - momentum(0), WithinAbs(push, 0.01 * amplitude));
}
