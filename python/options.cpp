#include "options.hpp"

namespace diffnea::python {
namespace detail {

std::string joined(const std::vector<std::string>& words, const char* quote) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : ", ") + (quote + word + quote);
  return out;
}

std::string literal(const std::vector<std::string>& words) {
  return "Literal[" + joined(words, "\"") + "]";
}

}  // namespace detail

void OptionSetter::finish() const {
  for (const auto& [key, value] : given_) {
    const std::string name = py::str(key);
    if (std::find(names_.begin(), names_.end(), name) == names_.end())
      throw py::type_error(function_ + "() got an unexpected keyword argument '" + name +
                           "'; options: " + detail::joined(names_, ""));
  }
}

py::object OptionSetter::find(const char* name) {
  if (name == nullptr) return {};
  names_.emplace_back(name);
  return given_.contains(name) ? given_[name].cast<py::object>() : py::object();
}

void OptionSetter::refuse_type(const char* name, const py::object& x) const {
  throw py::type_error(function_ + ": " + name + ": got " + std::string(py::repr(x)));
}

std::string OptionSetter::one_of(const char* name, const std::string& word,
                                 std::vector<std::string> choices) const {
  std::sort(choices.begin(), choices.end());
  if (!std::binary_search(choices.begin(), choices.end(), word))
    throw Error(function_ + ": " + name + ": got '" + word +
                "'; choices: " + detail::joined(choices, ""));
  return word;
}

}  // namespace diffnea::python
