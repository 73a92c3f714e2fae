#pragma once
/// Options that Python names by a word.

#include <map>
#include <string>

#include <diffnea/core/error.hpp>
#include <diffnea/core/fields.hpp>

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

/// Values of an enumeration by their names.
template <NamedEnum E>
std::map<std::string, E> by_name() {
  std::map<std::string, E> out;
  for (const NamedValue<E>& each : EnumNames<E>::list) out.emplace(each.name, each.value);
  return out;
}

template <NamedEnum E>
E choice(const std::string& what, const std::string& name) {
  return choice(what, name, by_name<E>());
}

}  // namespace diffnea::python
