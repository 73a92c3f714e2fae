#pragma once
/// Described structs (diffnea/core/fields.hpp) as Python value types: read-only properties with
/// docstrings and types, repr, to_dict, a table for notebooks, pickle.
///
///     auto c = value_type<JointError>(m);
///
/// A few small functions a struct differ by type; the rest is compiled once.

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <diffnea/core/fields.hpp>

#include "arrays.hpp"

namespace diffnea {
struct Model;
struct Recording;
struct Trajectory;
}  // namespace diffnea

namespace diffnea::python {

/// A field of a struct that is known by its address.
struct Property {
  std::string name;
  std::string doc;     ///< with the unit
  std::string unit;    ///< SI; "unit": that of the struct's field `unit`
  std::string type;    ///< as the stub has it
  std::size_t offset;  ///< from the struct [bytes]
  py::object (*get_value)(const void*);
  void (*set_value)(void*, const py::handle&);

  py::object get(const void* x) const { return get_value(static_cast<const char*>(x) + offset); }
  void set(void* x, const py::handle& value) const {
    set_value(static_cast<char*>(x) + offset, value);
  }
};

/// A value that files hold.
struct Entry {
  std::string key;  ///< may be a path: "outer.key", "key[0]"
  FieldTraits traits;
  std::function<py::object(const void*)> get;
};

namespace detail {

/// "Of the fit [N·m]."
std::string with_unit(std::string doc, const std::string& unit);

/// Name of the Python class of a described type.
template <Described T>
std::string class_name();

template <class F>
constexpr bool is_array =
    std::is_same_v<F, std::vector<double>> || std::is_same_v<F, VecX<double>> ||
    std::is_same_v<F, RowMatX<double>> || std::is_same_v<F, std::vector<std::array<double, 3>>>;

template <class F>
struct TypeName {
  static std::string text() {
    if constexpr (is_array<F> || std::is_same_v<F, py::array_t<double>>)
      return "Array";
    else if constexpr (std::is_same_v<F, py::array_t<bool>>)
      return "NDArray[np.bool_]";
    else if constexpr (std::is_same_v<F, py::dict>)
      return "dict[str, Array]";
    else if constexpr (std::is_same_v<F, bool>)
      return "bool";
    else if constexpr (std::is_integral_v<F>)
      return "int";
    else if constexpr (std::is_floating_point_v<F>)
      return "float";
    else if constexpr (std::is_same_v<F, std::string>)
      return "str";
    else if constexpr (std::is_same_v<F, Model>)
      return "Model";
    else if constexpr (std::is_same_v<F, Recording>)
      return "Recording";
    else if constexpr (std::is_same_v<F, Trajectory>)
      return "Trajectory";
    else if constexpr (NamedEnum<F>) {
      std::string out;
      for (const auto& each : EnumNames<F>::list)
        out += (out.empty() ? "\"" : ", \"") + std::string(each.name) + "\"";
      return "Literal[" + out + "]";
    } else
      return class_name<F>();
  }
};
template <class F>
struct TypeName<std::vector<F>> {
  static std::string text() {
    if constexpr (is_array<std::vector<F>>)
      return "Array";
    else
      return "list[" + TypeName<F>::text() + "]";
  }
};
template <class F>
struct TypeName<std::optional<F>> {
  static std::string text() { return TypeName<F>::text() + " | None"; }
};

/// No JSON holds recordings.
template <class F>
constexpr bool in_json = !std::is_same_v<F, Recording> && !std::is_same_v<F, Trajectory>;

/// Series of numbers are arrays in Python, not lists.
template <class F>
py::object to_python(const F& x) {
  if constexpr (is_array<F>)
    return array_out(x);
  else if constexpr (std::is_base_of_v<py::object, F>)
    return x;
  else if constexpr (NamedEnum<F>)
    return py::str(name_of(x));
  else
    return py::cast(x);
}

template <class F>
F from_python(const py::handle& x) {
  if constexpr (NamedEnum<F>)
    return value_of<F>(x.cast<std::string>(), "value");
  else
    return x.cast<F>();
}

/// Functions of a field's type alone, whatever struct it is in: compiled once each.
template <class F>
py::object get_value(const void* x) {
  return to_python(*static_cast<const F*>(x));
}
template <class F>
void set_value(void* x, const py::handle& value) {
  *static_cast<F*>(x) = from_python<F>(value);
}

/// Bytes from the beginning of a struct to a member.
template <class T, class F>
std::size_t offset_of(F T::* member) {
  // Storage without an object: arrays of NumPy cannot be made before it is imported.
  alignas(T) static std::byte storage[sizeof(T)];
  const auto* place = reinterpret_cast<const T*>(storage);
  return static_cast<std::size_t>(reinterpret_cast<const std::byte*>(&(place->*member)) - storage);
}

/// Collects the fields of a type.
template <class T>
struct PropertyList {
  const char* name = "";
  const char* doc = "";
  std::vector<Property> properties;
  std::vector<Entry> entries;  ///< values that files hold
  bool complete = true;        ///< entries are all that files hold

  void type(const char* its_name, const char* its_doc, TypeTraits = {}) {
    name = its_name;
    doc = its_doc;
  }
  template <class F>
  void field(const char* field_name, F T::* member, const char* field_doc,
             FieldTraits traits = {}) {
    in_memory(field_name, member, field_doc, traits);
    if constexpr (in_json<F>)
      entries.push_back({traits.key ? traits.key : field_name, traits,
                         [p = properties.back()](const void* x) { return p.get(x); }});
  }
  template <class F>
  void in_memory(const char* field_name, F T::* member, const char* field_doc,
                 FieldTraits traits = {}) {
    properties.push_back({field_name, with_unit(field_doc, traits.unit), traits.unit,
                          TypeName<F>::text(), offset_of(member), &get_value<F>, &set_value<F>});
  }
  template <class F>
  void columns(const char* field_name, F T::* member, const char* field_doc,
               FieldTraits traits = {}) {
    in_memory(field_name, member, field_doc, traits);
    complete = false;
  }
  template <class M>
  void embed(M T::* member) {
    PropertyList<M> inner;
    visit_fields<M>(inner);
    for (Property& p : inner.properties) {
      p.offset += offset_of(member);
      properties.push_back(std::move(p));
    }
    for (const Entry& e : inner.entries)
      entries.push_back({e.key, e.traits, [get = e.get, offset = offset_of(member)](const void* x) {
                           return get(static_cast<const char*>(x) + offset);
                         }});
    complete = complete && inner.complete;
  }
  template <class M, class F>
  void also(const char*, M T::*, F M::*, const char* = "", FieldTraits = {}) {
    complete = false;
  }
  template <class Function>
  void derived(const char* key, Function function, const char*, FieldTraits traits = {}) {
    entries.push_back({key, traits, [function](const void* x) {
                         return to_python(std::invoke(function, *static_cast<const T*>(x)));
                       }});
  }
  void custom(const char*, const char*, FieldTraits = {}) { complete = false; }
};

template <Described T>
const PropertyList<T>& property_list() {
  static const PropertyList<T> list = [] {
    PropertyList<T> out;
    visit_fields<T>(out);
    return out;
  }();
  return list;
}

template <Described T>
std::string class_name() {
  return property_list<T>().name;
}

/// Properties and `__annotations__`. @param address  of the struct that an object holds
void def_properties(py::object type, const std::vector<Property>& properties,
                    const void* (*address)(const py::handle&));
std::string repr_of(const char* name, const std::vector<Property>& properties, const void* x);
/// Keys, nulls and names as in files; series are lists, all their digits kept.
py::dict file_dict(const std::vector<Entry>& entries, const void* x);
/// A table of name, value and unit.
py::object html_of(const std::vector<Property>& properties, const void* x);
py::tuple state_of(const std::vector<Property>& properties, const void* x);
/// @throws py::value_error if it was pickled by another version
void set_state(const std::vector<Property>& properties, void* x, const py::tuple& state);

}  // namespace detail

/// Replaces a property that value_type has made.
void redefine(py::object type, const char* name, const char* python_type,
              const py::cpp_function& get);

/// Its fields by name.
template <Described T>
py::dict dict_of(const T& x) {
  py::dict out;
  for (const Property& p : detail::property_list<T>().properties) out[p.name.c_str()] = p.get(&x);
  return out;
}

/// The value with these fields, all of which are there.
template <Described T>
T from_fields(const py::dict& fields) {
  T out;
  for (const Property& p : detail::property_list<T>().properties)
    p.set(&out, fields[p.name.c_str()]);
  return out;
}

/// Parts that a type defines itself.
struct Own {
  bool repr = false;     ///< `__repr__`
  bool to_dict = false;  ///< must, where also(), columns() or custom() are in its list
  bool html = false;     ///< `_repr_html_`
};

/// The Python class of a described struct.
template <Described T>
py::class_<T> value_type(py::module_& m, Own own = {}) {
  const auto& list = detail::property_list<T>();
  py::class_<T> c(m, list.name, list.doc);
  detail::def_properties(c, list.properties, [](const py::handle& self) -> const void* {
    return &self.cast<const T&>();
  });
  if (!own.repr)
    c.def("__repr__",
          [&list](const T& x) { return detail::repr_of(list.name, list.properties, &x); });
  if (!own.to_dict && !list.complete)
    throw std::logic_error(std::string(list.name) + " needs a to_dict of its own");
  if (!own.to_dict)
    c.def(
        "to_dict", [&list](const T& x) { return detail::file_dict(list.entries, &x); },
        "The fields under their keys in files.");
  if (!own.html)
    c.def(
        "_repr_html_", [&list](const T& x) { return detail::html_of(list.properties, &x); },
        "A small table for notebooks.");
  c.def(py::pickle([&list](const T& x) { return detail::state_of(list.properties, &x); },
                   [&list](const py::tuple& state) {
                     T x;
                     detail::set_state(list.properties, &x, state);
                     return x;
                   }));
  c.attr("__module__") = "diffnea";
  return c;
}

}  // namespace diffnea::python
