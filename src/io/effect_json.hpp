#pragma once
/// An effect as model files and `info` show it.

#include <diffnea/model/model.hpp>

#include "io/json.hpp"

namespace diffnea::io {

/// {effect, where, parameters}, and the `table` where it has one.
Json effect_to_json(const EffectSpec& effect);

}  // namespace diffnea::io
