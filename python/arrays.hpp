#pragma once
/// NumPy at the boundary: what comes in is copied (another thread may change it while the GIL is
/// released), what goes out owns its memory.

#include <array>
#include <initializer_list>
#include <string>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <diffnea/core/scalar.hpp>

namespace diffnea::python {

namespace py = pybind11;

/// "(20, 7)"
std::string shape_text(const py::array& array);

/// Any array of numbers as float64 in C order. @throws py::type_error naming `what`
py::array_t<double> number_array(const std::string& what, const py::handle& x);

/// A vector of any length, or of `size`. @throws ShapeError
VecX<double> vector_in(const std::string& what, const py::handle& x, long size = -1);

/// None is an empty vector. @throws ShapeError
VecX<double> optional_vector(const std::string& what, const py::object& x);

/// (rows, columns); columns < 0: any. @throws ShapeError
RowMatX<double> matrix_in(const std::string& what, const py::handle& x, long rows, long columns);

py::array_t<double> array_out(RowMatX<double>&& values, const std::vector<py::ssize_t>& shape);
py::array_t<double> array_out(const RowMatX<double>& values);
py::array_t<double> array_out(const VecX<double>& values);
py::array_t<double> array_out(const std::vector<double>& values);
/// (M, 3)
py::array_t<double> array_out(const std::vector<std::array<double, 3>>& points);
py::array_t<bool> array_out(const std::vector<bool>& values);

/// Of a series. @param where  whose, for messages  @throws DataError naming the row
void require_increasing(const char* where, const VecX<double>& time);
/// One a column, no two alike. @throws ShapeError, DataError
void require_names(const char* where, const std::vector<std::string>& names, long joints);

/// An argument by name, e.g. {"qd", qd}.
struct NamedArray {
  const char* name;
  const py::object& array;
  long columns = -1;  ///< numbers of a state; negative: those of the call
  const char* what = "one value per joint";
};

/// Arguments of a single state, (n,), or of many, (T, n), one a row.
struct States {
  std::vector<RowMatX<double>> values;  ///< (T, n) each; T = 1 for a single state
  bool single = false;

  long rows() const { return values.front().rows(); }
  /// Results, one row a state, as (T, *inner), or as `inner` for a single state.
  py::array_t<double> shaped(RowMatX<double>&& rows, const std::vector<py::ssize_t>& inner) const;
};

/// @param where  the function, for messages
/// @param n  numbers of a state, in arrays that state none of their own
/// @throws ShapeError if an array is neither (n,) nor (T, n), or if their states differ in number
States states_in(const char* where, long n, std::initializer_list<NamedArray> arrays);

}  // namespace diffnea::python
