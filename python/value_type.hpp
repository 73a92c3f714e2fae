#pragma once
/// Plain structs as Python value types: read-only fields by name, repr, equality of kind, pickle.
///
///     value_type<JointError>(m, "JointError", "…", field("joint", &JointError::joint, "…"), …);
///
/// A struct that gains a field which its binding does not name fails to compile: it would be lost
/// when pickled.

#include <array>
#include <string>
#include <vector>

#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.hpp"

namespace diffnea::python {

template <class T, class F>
struct Field {
  const char* name;
  F T::* member;
  const char* doc;
};

template <class T, class F>
Field<T, F> field(const char* name, F T::* member, const char* doc) {
  return {name, member, doc};
}

namespace detail {

struct AnyValue {
  template <class T>
  operator T() const;
};

/// Number of members of an aggregate.
template <class T, class... Values>
consteval std::size_t field_count() {
  if constexpr (requires { T{Values{}..., AnyValue{}}; })
    return field_count<T, Values..., AnyValue>();
  else
    return sizeof...(Values);
}

/// Series of numbers are arrays in Python, not lists.
template <class F>
py::object to_python(const F& x) {
  if constexpr (std::is_same_v<F, std::vector<double>> || std::is_same_v<F, VecX<double>> ||
                std::is_same_v<F, RowMatX<double>>)
    return array_out(x);
  else if constexpr (std::is_same_v<F, std::vector<std::array<double, 3>>>)
    return array_out(x);
  else if constexpr (std::is_base_of_v<py::object, F>)
    return x;
  else
    return py::cast(x);
}

/// Short enough for one line: an array shows its shape, a list its length.
inline std::string short_repr(const py::handle& x) {
  if (py::isinstance<py::array>(x)) return "array" + shape_text(py::cast<py::array>(x));
  if (py::isinstance<py::list>(x) && py::len(x) > 4)
    return "[" + std::to_string(py::len(x)) + " items]";
  return py::repr(x);
}

}  // namespace detail

/// Pickles the fields in their order.
template <class T, class... Options, class... Fs>
void def_pickle(py::class_<T, Options...>& c, Field<T, Fs>... fields) {
  static_assert(sizeof...(Fs) == detail::field_count<T>(),
                "the struct has other fields than this binding: name each of them here");
  c.def(py::pickle(
      [fields...](const T& x) { return py::make_tuple(detail::to_python(x.*fields.member)...); },
      [fields...](const py::tuple& state) {
        if (state.size() != sizeof...(Fs)) throw py::value_error("pickled by another version");
        T x;
        std::size_t k = 0;
        ((x.*fields.member = state[k++].template cast<Fs>()), ...);
        return x;
      }));
}

template <class T, class... Fs>
py::class_<T> value_type(py::module_& m, const char* name, const char* doc,
                         Field<T, Fs>... fields) {
  py::class_<T> c(m, name, doc);
  (c.def_property_readonly(
       fields.name, [member = fields.member](const T& x) { return detail::to_python(x.*member); },
       fields.doc),
   ...);
  c.def("__repr__", [fields..., name](const T& x) {
    std::string text;
    ((text += (text.empty() ? "" : ", ") + std::string(fields.name) + "=" +
              detail::short_repr(detail::to_python(x.*fields.member))),
     ...);
    return std::string(name) + "(" + text + ")";
  });
  def_pickle(c, fields...);
  c.attr("__module__") = "diffnea";
  return c;
}

}  // namespace diffnea::python
