#include "value_type.hpp"

namespace diffnea::python {
namespace {

/// Short enough for one line: an array shows its shape, a list its length.
std::string short_repr(const py::handle& x) {
  if (py::isinstance<py::array>(x)) return "array" + shape_text(py::cast<py::array>(x));
  if (py::isinstance<py::list>(x) && py::len(x) > 4)
    return "[" + std::to_string(py::len(x)) + " items]";
  return py::repr(x);
}

void def_property(const py::object& type, const char* name, const py::cpp_function& get,
                  const std::string& doc) {
  type.attr(name) =
      py::module_::import("builtins").attr("property")(get, py::none(), py::none(), doc);
}

}  // namespace

namespace detail {

std::string with_unit(std::string doc, const std::string& unit) {
  if (unit.empty()) return doc;
  const std::string text = unit == "unit" ? " [``unit``]" : " [" + unit + "]";
  return doc.insert(doc.ends_with('.') ? doc.size() - 1 : doc.size(), text);
}

void def_properties(py::object type, const std::vector<Property>& properties,
                    const void* (*address)(const py::handle&)) {
  py::dict annotations;
  for (const Property& p : properties) {
    const py::cpp_function get(
        [address, &p](const py::object& self) { return p.get(address(self)); });
    def_property(type, p.name.c_str(), get, p.doc);
    annotations[p.name.c_str()] = p.type;
  }
  type.attr("__annotations__") = annotations;
}

std::string repr_of(const char* name, const std::vector<Property>& properties, const void* x) {
  std::string text;
  for (const Property& p : properties)
    text += (text.empty() ? "" : ", ") + p.name + "=" + short_repr(p.get(x));
  return std::string(name) + "(" + text + ")";
}

py::tuple state_of(const std::vector<Property>& properties, const void* x) {
  py::tuple out(properties.size());
  for (std::size_t k = 0; k < properties.size(); ++k) out[k] = properties[k].get(x);
  return out;
}

void set_state(const std::vector<Property>& properties, void* x, const py::tuple& state) {
  if (state.size() != properties.size()) throw py::value_error("pickled by another version");
  for (std::size_t k = 0; k < properties.size(); ++k) properties[k].set(x, state[k]);
}

}  // namespace detail

void redefine(py::object type, const char* name, const char* python_type,
              const py::cpp_function& get) {
  def_property(type, name, get, type.attr(name).attr("__doc__").cast<std::string>());
  type.attr("__annotations__")[name] = python_type;
}

}  // namespace diffnea::python
