#include "diagnose/gear_offers.hpp"

#include <algorithm>

#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/effects/stepping.hpp>

#include "identify/gears.hpp"

namespace diffnea {

std::vector<std::vector<EffectSpec>> gear_offers(const BoundEffect& gear, const FitLayout& layout,
                                                 const VecX<double>& x, const VecX<double>& shape,
                                                 const MotionData& data) {
  std::vector<std::vector<EffectSpec>> out;
  const int joint = gear.joints.front();
  BoundEffect at = gear;
  set_flanks(drive_gain(layout, x, joint), rotor_of(layout, x, joint), at);
  for (const double side : {0.0, 1.0}) {
    out.emplace_back();
    for (const double size : gear_sizes(at, layout, x, shape, data)) {
      at.parameters[gear_size(at)] = size;
      EffectSpec spec = to_spec(at);
      for (EffectParameter& p : spec.parameters)
        if (p.name == "encoder_side") p.value = side;
      out.back().push_back(std::move(spec));
    }
  }
  return out;
}

bool clashes(const Model& model, const BoundEffect& effect) {
  const auto needs_motion = [](const BoundEffect& e) {
    return reads_acceleration(e) && !e.info().has(Trait::kRotor);
  };
  const bool gear = hides_motor(effect);
  if (!gear && !needs_motion(effect)) return false;
  return std::ranges::any_of(model.effects, [&](const EffectSpec& spec) {
    if (acts_on_ball(find_effect(spec.effect))) return false;
    const BoundEffect e = bind(spec, model);
    const bool apart = !(hides_motor(e) || (gear && needs_motion(e)));
    return !apart && std::ranges::any_of(e.joints, [&](int j) {
      return std::ranges::find(effect.joints, j) != effect.joints.end();
    });
  });
}

}  // namespace diffnea
