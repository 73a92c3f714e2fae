#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/model/tree.hpp>

namespace diffnea {

/// link_extension: the joint sits d further along its parent's x axis than the model says.
struct LinkExtension {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "link_extension",
        .formula = "p_PJ + (d, 0, 0)",
        .summary = "joint that sits further out than the model says",
        .place = Place::kJoint,
        .port = Port::kModelParameter,
        .parameters = {{.name = "length", .unit = "m", .unit_prismatic = "m", .linear = false}}};
    return kInfo;
  }

  template <Scalar P>
  void add_to_tree(const int* joint, const P* p, Tree<P>& tree) const {
    tree.links[*joint].X_PJ.p.x = tree.links[*joint].X_PJ.p.x + p[0];
  }
};

}  // namespace diffnea
