#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/model/tree.hpp>

namespace diffnea {

/// base_tilt: the robot's base is not level. In the base's frame gravity has g_x and g_y more than
/// the model's; a tilt of φ radians about x gives g_y = −9.81 sin φ.
struct BaseTilt {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "base_tilt",
        .formula = "g + (g_x, g_y, 0)",
        .summary = "base that is not level: horizontal components of gravity",
        .place = Place::kBase,
        .port = Port::kModelParameter,
        .parameters = {{.name = "gravity_x", .unit = "m/s^2", .unit_prismatic = "m/s^2"},
                       {.name = "gravity_y", .unit = "m/s^2", .unit_prismatic = "m/s^2"}},
        .traits = {Trait::kGravity}};
    return kInfo;
  }

  template <Scalar P>
  void add_to_tree(const int*, const P* p, Tree<P>& tree) const {
    tree.gravity = tree.gravity + Vec3<P>{p[0], p[1], P(0.0)};
  }
};

}  // namespace diffnea
