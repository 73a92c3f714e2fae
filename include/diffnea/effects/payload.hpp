#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/model/tree.hpp>

namespace diffnea {

/// payload: a rigid body held by the last moving link, or by the link that the named joint moves.
/// Its ten inertial parameters, in that link's frame about its origin, add to the link's own.
struct Payload {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "payload",
        .formula = "theta_link + theta",
        .summary = "rigid body held at the tip: ten inertial parameters",
        .place = Place::kTip,
        .port = Port::kModelParameter,
        .parameters =
            {{.name = "mass", .unit = "kg", .unit_prismatic = "kg", .sign = Sign::kNonNegative},
             {.name = "hx", .unit = "kg*m", .unit_prismatic = "kg*m"},
             {.name = "hy", .unit = "kg*m", .unit_prismatic = "kg*m"},
             {.name = "hz", .unit = "kg*m", .unit_prismatic = "kg*m"},
             {.name = "Ixx", .unit = "kg*m^2", .unit_prismatic = "kg*m^2"},
             {.name = "Ixy", .unit = "kg*m^2", .unit_prismatic = "kg*m^2"},
             {.name = "Ixz", .unit = "kg*m^2", .unit_prismatic = "kg*m^2"},
             {.name = "Iyy", .unit = "kg*m^2", .unit_prismatic = "kg*m^2"},
             {.name = "Iyz", .unit = "kg*m^2", .unit_prismatic = "kg*m^2"},
             {.name = "Izz", .unit = "kg*m^2", .unit_prismatic = "kg*m^2"}},
        .traits = {Trait::kInertia}};
    return kInfo;
  }

  template <Scalar P>
  void add_to_tree(const int* links, const P* p, Tree<P>& tree) const {
    const Theta<P> theta{p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8], p[9]};
    SpatialInertia<P>& link = tree.links[*links].inertia;
    link = link + SpatialInertia<P>::from_theta(theta);
  }
};

}  // namespace diffnea
