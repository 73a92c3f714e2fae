#include "value_type.hpp"

#include <cmath>

#include "bindings.hpp"

namespace diffnea::python {
namespace {

/// Short enough for one line: an array shows its shape, a list its length.
std::string short_repr(const py::handle& x) {
  if (py::isinstance<py::array>(x)) return "array" + shape_text(py::cast<py::array>(x));
  if (py::isinstance<py::list>(x) && py::len(x) > 4)
    return "[" + std::to_string(py::len(x)) + " items]";
  return py::repr(x);
}

/// The value that JSON has: a number that does not exist is null.
py::object plain(const py::handle& x) {
  if (py::isinstance<py::array>(x)) return plain(x.attr("tolist")());
  if (py::isinstance<py::float_>(x) && !std::isfinite(x.cast<double>())) return py::none();
  if (py::isinstance<py::list>(x) || py::isinstance<py::tuple>(x)) {
    py::list out;
    for (const py::handle item : x) out.append(plain(item));
    return out;
  }
  if (py::isinstance<py::dict>(x)) {
    py::dict out;
    for (const auto& [key, value] : x.cast<py::dict>()) out[key] = plain(value);
    return out;
  }
  if (py::hasattr(x, "to_dict")) return x.attr("to_dict")();
  return py::reinterpret_borrow<py::object>(x);
}

/// Condition of FieldTraits::empty_is_null and `absent`.
bool is_empty(const py::object& x) {
  if (py::isinstance<py::float_>(x) || py::isinstance<py::int_>(x)) return x.cast<double>() <= 0.0;
  return x.is_none() || (py::hasattr(x, "__len__") && py::len(x) == 0);
}

/// Puts a value at "key", "outer.key", or "key[0]"; places of a list come in their order.
void put(py::dict out, std::string path, const py::object& value) {
  for (std::size_t dot; (dot = path.find('.')) != std::string::npos; path.erase(0, dot + 1))
    out = out.attr("setdefault")(path.substr(0, dot), py::dict()).cast<py::dict>();
  const std::size_t bracket = path.find('[');
  if (bracket == std::string::npos)
    out[path.c_str()] = value;
  else
    out.attr("setdefault")(path.substr(0, bracket), py::list()).attr("append")(value);
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

py::dict file_dict(const std::vector<Entry>& entries, const void* x) {
  py::dict out;
  for (const Entry& e : entries) {
    const py::object value = e.get(x);
    const bool empty = (e.traits.absent || e.traits.empty_is_null) && is_empty(value);
    if (empty && e.traits.absent) continue;
    put(out, e.key, empty ? py::none() : plain(value));
  }
  return out;
}

py::object html_of(const std::vector<Property>& properties, const void* x) {
  py::dict values;
  for (const Property& p : properties) values[p.name.c_str()] = p.get(x);
  py::list rows;
  for (const Property& p : properties) {
    const py::object value = values[p.name.c_str()];
    const bool number = py::isinstance<py::float_>(value);
    rows.append(
        py::make_tuple(p.name, number ? value : py::str(short_repr(value)),
                       p.unit == "unit" ? values["unit"].cast<py::object>() : py::str(p.unit)));
  }
  return python_function("diffnea._results", "fields_html")(rows);
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
