#pragma once
/// Described options (diffnea/core/options.hpp) as keyword arguments of a Python function.

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <diffnea/core/error.hpp>
#include <diffnea/core/options.hpp>

#include "value_type.hpp"

namespace diffnea::python {
namespace detail {

/// `a, b`, each between `quote`.
std::string joined(const std::vector<std::string>& words, const char* quote);
/// `Literal["a", "b"]`
std::string literal(const std::vector<std::string>& words);

template <class F>
std::string option_type(const OptionTraits& traits) {
  if constexpr (std::is_same_v<F, std::array<double, 3>>)
    return "tuple[float, float, float]";
  else if constexpr (std::is_same_v<F, std::optional<std::vector<std::string>>>)
    return "str | Sequence[str] | None";
  else if constexpr (std::is_same_v<F, std::vector<std::string>>)
    return traits.all ? "str | Sequence[str] | None" : "str | Sequence[str]";
  else
    return TypeName<F>::text();
}

}  // namespace detail

/// Lists name, type, default and text of each option.
class OptionLister {
 public:
  py::list options;

  void words(const char*, const char* name, const std::vector<std::string>& choices,
             const std::string& now, const std::function<void(const std::string&)>&,
             const std::string& text) {
    const bool told = std::all_of(choices.begin(), choices.end(), [&](const std::string& word) {
      return text.find(word) != std::string::npos;
    });
    add(name, detail::literal(choices), py::str(now),
        told ? text : text + ": " + detail::joined(choices, ""));
  }
  template <class F>
  void option(const char*, const char* name, F& value, const std::string& text,
              OptionTraits traits = {}) {
    if (name == nullptr) return;
    if constexpr (NamedEnum<F>) return words("", name, names_of<F>(), name_of(value), {}, text);
    py::object now = detail::to_python(value);
    if (traits.all) now = py::none();
    if (py::isinstance<py::list>(now)) now = py::tuple(now);  // a default must not change
    const bool can_be_none = std::is_same_v<F, std::optional<std::vector<std::string>>>;
    add(name, detail::option_type<F>(traits), now, can_be_none ? text + "; []: none" : text);
  }

 private:
  void add(const char* name, const std::string& type, const py::object& now,
           const std::string& text) {
    options.append(py::make_tuple(name, type, now, text));
  }
};

/// Sets the options that are given by name.
class OptionSetter {
 public:
  /// @param function  for messages
  OptionSetter(std::string function, const py::dict& given)
      : function_(std::move(function)), given_(given) {}

  void words(const char*, const char* name, std::vector<std::string> choices, const std::string&,
             const std::function<void(const std::string&)>& set, const std::string&) {
    if (const py::object x = find(name))
      set(one_of(name, cast<std::string>(name, x), std::move(choices)));
  }
  template <class F>
  void option(const char*, const char* name, F& value, const std::string&,
              OptionTraits traits = {}) {
    const py::object x = find(name);
    if (!x || (traits.all && x.is_none())) return;
    if constexpr (NamedEnum<F>)
      value = value_of<F>(one_of(name, cast<std::string>(name, x), names_of<F>()), name);
    else if constexpr (std::is_same_v<F, std::vector<std::string>> ||
                       std::is_same_v<F, std::optional<std::vector<std::string>>>)
      value = cast<F>(name, py::isinstance<py::str>(x) ? py::make_tuple(x) : x);
    else
      value = cast<F>(name, x);
  }

  /// @throws py::type_error if there is an argument that is no option
  void finish() const;

 private:
  /// The value given, or nothing.
  py::object find(const char* name);
  template <class F>
  F cast(const char* name, const py::object& x) const {
    try {
      return x.cast<F>();
    } catch (const py::cast_error&) {
      refuse_type(name, x);
    }
  }
  [[noreturn]] void refuse_type(const char* name, const py::object& x) const;
  /// @throws Error listing the choices
  std::string one_of(const char* name, const std::string& word,
                     std::vector<std::string> choices) const;

  std::string function_;
  py::dict given_;
  std::vector<std::string> names_;
};

/// Name, type, default and text of each option.
template <class Options>
py::list list_options() {
  Options defaults;
  OptionLister lister;
  defaults.options(lister);
  return lister.options;
}

/// @throws py::type_error for arguments that are no options, or of another type; Error for words
/// that are none of an option's
template <class Options>
void set_options(Options& options, const std::string& function, const py::dict& given) {
  OptionSetter setter(function, given);
  options.options(setter);
  setter.finish();
}

}  // namespace diffnea::python
