#include "arrays.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include <diffnea/core/error.hpp>

namespace diffnea::python {
namespace {

using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

RowMatX<double> copy(const py::array_t<double>& a, long rows, long columns) {
  return Eigen::Map<const RowMatX<double>>(a.data(), rows, columns);
}

/// None if `x` is no array of real numbers. NumPy would make NaN of None, and drop what is
/// imaginary.
Numbers numbers_in(const py::handle& x) {
  if (Numbers::check_(x)) return py::reinterpret_borrow<Numbers>(x);
  const bool is_complex =
      py::isinstance<py::array>(x) && py::reinterpret_borrow<py::array>(x).dtype().kind() == 'c';
  if (x.is_none() || is_complex) return py::reinterpret_steal<Numbers>(nullptr);
  return Numbers::ensure(x);
}

[[noreturn]] void throw_not_numbers(const std::string& what, const py::handle& x) {
  throw py::type_error(what + ": got " + std::string(py::str(py::type::of(x).attr("__name__"))) +
                       ", expected an array of real numbers");
}

/// Tells whether both hold a single state, or both as many, one a row.
bool as_many_states(const py::array& a, const py::array& b) {
  return a.ndim() == b.ndim() && (a.ndim() == 1 || a.shape(0) == b.shape(0));
}

}  // namespace

std::string shape_text(const py::array& array) {
  std::string out = "(";
  for (py::ssize_t k = 0; k < array.ndim(); ++k)
    out += (k == 0 ? "" : ", ") + std::to_string(array.shape(k));
  return out + (array.ndim() == 1 ? ",)" : ")");
}

py::array_t<double> number_array(const std::string& what, const py::handle& x) {
  if (const Numbers array = numbers_in(x)) return array;
  throw_not_numbers(what, x);
}

VecX<double> vector_in(const std::string& what, const py::handle& x, long size) {
  const py::array_t<double> a = number_array(what, x);
  if (a.ndim() != 1 || (size >= 0 && a.shape(0) != size))
    throw ShapeError(what + ": got shape " + shape_text(a) + ", expected " +
                     (size < 0 ? "(N,)" : "(" + std::to_string(size) + ",)"));
  return Eigen::Map<const VecX<double>>(a.data(), a.size());
}

VecX<double> optional_vector(const std::string& what, const py::object& x) {
  return x.is_none() ? VecX<double>() : vector_in(what, x);
}

RowMatX<double> matrix_in(const std::string& what, const py::handle& x, long rows, long columns) {
  const py::array_t<double> a = number_array(what, x);
  const bool column = a.ndim() == 1 && columns <= 1;  // one joint's series needs no second index
  if (!(column || a.ndim() == 2) || a.shape(0) != rows ||
      (!column && columns >= 0 && a.shape(1) != columns))
    throw ShapeError(what + ": got shape " + shape_text(a) + ", expected (" + std::to_string(rows) +
                     ", " + (columns < 0 ? "n" : std::to_string(columns)) + ")");
  return copy(a, rows, column ? 1 : a.shape(1));
}

py::array_t<double> array_out(RowMatX<double>&& values, const std::vector<py::ssize_t>& shape) {
  constexpr long kCopied = 512;  // values that are copied in less time than an owner is made
  if (values.size() <= kCopied) {
    py::array_t<double> out(shape);
    std::copy_n(values.data(), values.size(), out.mutable_data());
    return out;
  }
  auto* kept = new RowMatX<double>(std::move(values));
  const py::capsule owner(kept, [](void* p) { delete static_cast<RowMatX<double>*>(p); });
  return py::array_t<double>(shape, kept->data(), owner);
}

py::array_t<double> array_out(const RowMatX<double>& values) {
  return py::array_t<double>({values.rows(), values.cols()}, values.data());
}

py::array_t<double> array_out(const VecX<double>& values) {
  return py::array_t<double>(values.size(), values.data());
}

py::array_t<double> array_out(const std::vector<double>& values) {
  return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
}

py::array_t<double> States::shaped(RowMatX<double>&& rows,
                                   const std::vector<py::ssize_t>& inner) const {
  std::vector<py::ssize_t> shape;
  if (!single) shape.push_back(this->rows());
  shape.insert(shape.end(), inner.begin(), inner.end());
  return array_out(std::move(rows), shape);
}

py::array_t<bool> array_out(const std::vector<bool>& values) {
  py::array_t<bool> out(static_cast<py::ssize_t>(values.size()));
  std::copy(values.begin(), values.end(), out.mutable_data());
  return out;
}

py::array_t<double> array_out(const std::vector<std::array<double, 3>>& points) {
  return py::array_t<double>({static_cast<py::ssize_t>(points.size()), py::ssize_t{3}},
                             points.empty() ? nullptr : points.front().data());
}

States states_in(const char* where, long n, std::initializer_list<NamedArray> arrays) {
  const auto what = [where](const NamedArray& argument) {
    return std::string(where) + ": " + argument.name;
  };
  States out;
  out.values.reserve(arrays.size());
  Numbers first;
  for (const NamedArray& argument : arrays) {
    const Numbers a = numbers_in(argument.array);
    if (!a) throw_not_numbers(what(argument), argument.array);
    const long columns = argument.columns < 0 ? n : argument.columns;
    if ((a.ndim() != 1 && a.ndim() != 2) || a.shape(a.ndim() - 1) != columns)
      throw ShapeError(what(argument) + ": got shape " + shape_text(a) + ", expected (" +
                       std::to_string(columns) + ",) or (T, " + std::to_string(columns) + "), " +
                       argument.what);
    if (out.values.empty())
      first = a;
    else if (!as_many_states(a, first))
      throw ShapeError(
          what(argument) + ": got shape " + shape_text(a) + ", expected " +
          (first.ndim() == 1 ? "(" : "(" + std::to_string(first.shape(0)) + ", ") +
          std::to_string(columns) + (first.ndim() == 1 ? ",)" : ")") +
          (columns == first.shape(first.ndim() - 1) ? ", that of " : ", as many states as ") +
          arrays.begin()->name);
    out.values.push_back(copy(a, a.ndim() == 1 ? 1 : a.shape(0), columns));
  }
  out.single = first.ndim() == 1;
  return out;
}

void require_increasing(const char* where, const VecX<double>& time) {
  for (long k = 0; k < time.size(); ++k) {
    if (std::isfinite(time[k]) && (k == 0 || time[k] > time[k - 1])) continue;
    throw DataError(std::string(where) + ": time[" + std::to_string(k) + "] is " +
                    std::to_string(time[k]) +
                    (k == 0 ? "" : " after " + std::to_string(time[k - 1])) +
                    " s, expected finite and strictly increasing; leave such rows out");
  }
}

void require_names(const char* where, const std::vector<std::string>& names, long joints) {
  if (static_cast<long>(names.size()) != joints)
    throw ShapeError(std::string(where) + ": got " + std::to_string(names.size()) +
                     " joint_names, expected " + std::to_string(joints) + ", one per column of q");
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size())
    throw DataError(std::string(where) + ": a name occurs twice in joint_names");
}

}  // namespace diffnea::python
