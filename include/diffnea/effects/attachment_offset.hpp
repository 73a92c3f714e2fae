#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// attachment_offset: the string is tied R(t) o away from where the model says, o in the link's
/// frame. The base fits the attachment; this is for a base that is held (`--base fixed`).
struct AttachmentOffset {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "attachment_offset",
        .formula = "R(t) o",
        .summary = "the string is tied elsewhere on its link",
        .place = Place::kString,
        .port = Port::kStringAnchor,
        .parameters = {ball_parameter("offset_x", "m"), ball_parameter("offset_y", "m"),
                       ball_parameter("offset_z", "m")}};
    return kInfo;
  }

  template <Scalar T>
  void add_to_anchor(const T* p, Vec3<T>& p_LS) const {
    p_LS = p_LS + Vec3<T>{p[0], p[1], p[2]};
  }
};

}  // namespace diffnea
