#pragma once
/// The pendulum behind a servo of which no torque is logged, and what a fit says of it.

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

/// First parameter of a fit whose name ends so.
inline const ParameterEstimate& estimate(const IdentifyResult& result, const std::string& end) {
  for (const ParameterEstimate& p : result.parameters)
    if (p.name.ends_with(end)) return p;
  FAIL("no parameter " << end);
  return result.parameters.front();
}

}  // namespace diffnea::test
