#pragma once
/// The pendulum behind a servo of which no torque is logged, and what a fit says of it.

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/identify/identify.hpp>
#include <diffnea/io/model_file.hpp>

namespace diffnea::test {

/// Arm on the joint `servo`, which hangs down at 0.
/// @param mass, length  [kg], and of its center of mass from the axis [m]
/// @param inertia       about the center of mass, in all directions [kg·m²]
inline Model servo_bench(double mass, double length, double inertia,
                         std::vector<EffectSpec> effects = {}) {
  Model out;
  out.name = out.source = "bench";
  out.links.resize(2);
  out.links[0].name = "base";
  ModelLink& arm = out.links[1];
  arm.name = "arm";
  arm.joint = "servo";
  arm.parent = 0;
  arm.type = ModelJoint::kRevolute;
  arm.axis = {0, 1, 0};
  const double about = inertia + mass * length * length;
  arm.inertia = SpatialInertia<double>::from_theta(
      {mass, 0, 0, -mass * length, about, 0, 0, about, 0, inertia});
  out.effects = std::move(effects);
  return out;
}

/// A log of servo_bench() without a number yet: times, positions and commands, no torque.
inline Recording blank_servo_log(long rows) {
  Recording r;
  r.source = "bench";
  r.joint_names = {"servo"};
  r.has_tau = {false};
  r.time.resize(rows);
  r.q.resize(rows, 1);
  r.qcmd.resize(rows, 1);
  r.tau = RowMatX<double>::Constant(rows, 1, std::nan(""));
  return r;
}

/// Arm of servo_bench(), its servo, and a spring.
struct SprungServo {
  double mass = 0.5, length = 0.1, inertia = 0.001;  // the arm's, as servo_bench() takes it
  double stiffness = 12.0, damping = 0.5, rotor = 0.02;
  double spring = 0.0;  // about the joint, beside the servo [N·m/rad]
  double rate = 2.0;    // slow part of the command [rad/s]

  /// A log by the pendulum's own equation: counts of 12 bits at 100 Hz, no torque.
  Recording record(double seconds) const {
    constexpr double kRow = 0.01, kStep = 2.0 * M_PI / 4096.0;
    constexpr int kFine = 100;  // steps a row
    const double h = kRow / kFine;
    const long rows = std::lround(seconds / kRow);
    Recording r = blank_servo_log(rows);
    double q = 0.0, v = 0.0;
    for (long k = 0; k < rows; ++k) {
      const double t = kRow * static_cast<double>(k),
                   command =
                       0.6 * std::sin(rate * t) * std::min(t, 1.0) + 0.3 * std::sin(3.5 * rate * t);
      r.time[k] = t;
      r.q(k, 0) = kStep * std::round(q / kStep);
      r.qcmd(k, 0) = command;
      for (int i = 0; i < kFine; ++i) {
        const double tau = stiffness * (command - q) - damping * v - spring * q -
                           mass * 9.81 * length * std::sin(q);
        v += h * tau / (inertia + mass * length * length + rotor);
        q += h * v;
      }
    }
    return r;
  }
};

/// First parameter of a fit whose name ends so.
inline const ParameterEstimate& estimate(const IdentifyResult& result, const std::string& end) {
  for (const ParameterEstimate& p : result.parameters)
    if (p.name.ends_with(end)) return p;
  FAIL("no parameter " << end);
  return result.parameters.front();
}

}  // namespace diffnea::test
