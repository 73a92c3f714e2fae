#pragma once
/// Options that Python names by a word.

#include <map>
#include <string>

#include <diffnea/core/error.hpp>

namespace diffnea::python {

/// @param what  the function and its option, for messages
/// @throws Error listing the choices
template <class T>
T choice(const std::string& what, const std::string& name,
         const std::map<std::string, T>& choices) {
  const auto it = choices.find(name);
  if (it != choices.end()) return it->second;
  std::string names;
  for (const auto& [known, value] : choices) names += (names.empty() ? "" : ", ") + known;
  throw Error(what + ": got '" + name + "'; choices: " + names);
}

}  // namespace diffnea::python
