#pragma once

#include <diffnea/dynamics/string_route.hpp>
#include <diffnea/effects/ball_effect.hpp>

namespace diffnea {

/// string_wrap: above the cup, a string that is tied below it does not pass through it but lies
/// around it (dynamics/string_route.hpp), ℓ(x) ≤ r with the length ℓ of that way. At size 1 the
/// body that bars it is the cup of the model, at 0 there is none.
struct StringWrap {
  static const EffectInfo& info() {
    static const EffectInfo kInfo = [] {
      EffectInfo out{.name = "string_wrap",
                     .formula = "l(x) <= r, l around the cup",
                     .summary = "string that lies around the cup's edge and rim",
                     .place = Place::kString,
                     .port = Port::kStringContact,
                     .parameters = {ball_parameter("size", "1", Sign::kNonNegative)},
                     .traits = {Trait::kNeedsCup}};
      out.parameters[0].search = {1.0};
      return out;
    }();
    return kInfo;
  }

  template <class T>
  StringRoute<T> route(const CupPosition<T>& ball, const CupPosition<T>& knot, const CupSpec& cup,
                       const T* p) const {
    return route_around_cup(ball, knot, cup, p[0]);
  }
};

}  // namespace diffnea
