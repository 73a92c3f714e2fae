#pragma once

#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// string_rebound: a string that becomes taut throws the ball back, v_u ← −e v_u of the velocity
/// along it against the anchor; without it nothing is left of that velocity.
struct StringRebound {
  static const EffectInfo& info() {
    static const EffectInfo kInfo = [] {
      EffectInfo out{.name = "string_rebound",
                     .formula = "v_u <- -e v_u",
                     .summary = "string that throws the ball back when it becomes taut",
                     .place = Place::kString,
                     .port = Port::kStringContact,
                     .parameters = {ball_parameter("restitution", "1", Sign::kNonNegative)},
                     .traits = {Trait::kJumps}};
      out.parameters[0].most = 0.6;  // of more, a ball under tension would hardly come to rest
      out.parameters[0].search = {0.2};
      return out;
    }();
    return kInfo;
  }

  template <class T>
  T rebound(const T* p) const {
    return p[0];
  }
};

}  // namespace diffnea
