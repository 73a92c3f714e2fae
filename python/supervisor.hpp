#pragma once
/// Ctrl-C and the caller's own function, asked by long work as it goes.

#include <exception>
#include <utility>

#include <pybind11/pybind11.h>

#include <diffnea/identify/identify.hpp>

namespace diffnea::python {

namespace py = pybind11;

/// Python's exceptions wait here until the work has come home.
class Supervisor {
 public:
  explicit Supervisor(py::object callback) : callback_(std::move(callback)) {}

  bool operator()(const FitProgress& progress) {
    const py::gil_scoped_acquire gil;
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      return callback_.is_none() || !callback_(progress).is(py::bool_(false));
    } catch (const py::error_already_set&) {
      raised_ = std::current_exception();
      return false;
    }
  }
  /// With the GIL held.
  void rethrow() const {
    if (raised_) std::rethrow_exception(raised_);
  }

 private:
  py::object callback_;
  std::exception_ptr raised_;
};

}  // namespace diffnea::python
