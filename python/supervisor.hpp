#pragma once
/// Ctrl-C and the caller's own function, asked by long work as it goes.

#include <exception>
#include <optional>
#include <utility>

#include <pybind11/pybind11.h>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/identify.hpp>

namespace diffnea::python {

namespace py = pybind11;

/// Once told to stop, all that asks is told so: what one part of the work was told, the next may
/// not have heard. Python's exceptions wait here until the work has come home.
class Supervisor {
 public:
  explicit Supervisor(py::object callback) : callback_(std::move(callback)) {}

  bool operator()(const FitProgress& progress) {
    const py::gil_scoped_acquire gil;
    if (stopped_) return false;
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      stopped_ = !callback_.is_none() && callback_(progress).is(py::bool_(false));
    } catch (const py::error_already_set&) {
      raised_ = std::current_exception();
      stopped_ = true;
    }
    return !stopped_;
  }
  /// work() with the GIL free. What Python raised meanwhile comes through, also where the work then
  /// found too little to return anything.
  template <typename Work>
  auto run(Work work) {
    std::optional<decltype(work())> out;
    try {
      const py::gil_scoped_release release;
      out = work();
    } catch (const Error&) {
      rethrow();
      throw;
    }
    rethrow();
    return std::move(*out);
  }

 private:
  void rethrow() const {
    if (raised_) std::rethrow_exception(raised_);
  }

  py::object callback_;
  std::exception_ptr raised_;
  bool stopped_ = false;
};

}  // namespace diffnea::python
