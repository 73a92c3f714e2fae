#include "effect_names.hpp"

#include <algorithm>

#include <diffnea/effects/bound_effect.hpp>

namespace diffnea::apps {
namespace {

const EffectInfo* known(const std::string& name) {
  const auto at = std::ranges::find(catalogue(), name, [](const EffectInfo& i) { return i.name; });
  return at == catalogue().end() ? nullptr : &*at;
}

/// Whether a word names the first joint of a pair, and no second one.
bool lacks_second(const std::string& word) {
  const std::size_t at = word.find('@');
  if (at == word.npos || word.find(',', at) != word.npos) return false;
  const EffectInfo* info = known(word.substr(0, at));
  return info != nullptr && info->place == Place::kJointPair;
}

}  // namespace

std::vector<std::string> with_pairs(const std::vector<std::string>& words) {
  std::vector<std::string> out;
  for (const std::string& word : words) {
    const bool is_effect = known(word.substr(0, word.find('@'))) != nullptr;
    if (!out.empty() && !is_effect && lacks_second(out.back()))
      out.back() += "," + word;
    else
      out.push_back(word);
  }
  return out;
}

}  // namespace diffnea::apps
