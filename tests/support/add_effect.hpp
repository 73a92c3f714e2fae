#pragma once
/// Effects in a line.

#include <string>
#include <utility>
#include <vector>

#include <diffnea/model/model.hpp>

namespace diffnea::test {

inline void add(Model& model, const std::string& effect, const std::string& where,
                const std::vector<std::pair<std::string, double>>& parameters) {
  EffectSpec spec{effect, where, {}};
  for (const auto& [name, value] : parameters) spec.parameters.push_back({name, value, ""});
  model.effects.push_back(spec);
}

}  // namespace diffnea::test
