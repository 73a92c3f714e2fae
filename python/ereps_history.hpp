#pragma once
/// A search's history as a dict of arrays, one entry an iteration.

#include <string>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <diffnea/policy/ereps.hpp>

#include "value_type.hpp"

namespace diffnea::python {

/// Calls visit(name, member) for every number of an iteration but its own.
template <class Visit>
struct HistoryFields {
  Visit visit;

  void type(const char*, const char*, TypeTraits = {}) {}
  void field(const char* name, double ErepsIteration::* member, const char*, FieldTraits = {}) {
    visit(name, member);
  }
  void in_memory(const char*, int ErepsIteration::*, const char*, FieldTraits = {}) {}
};

template <class Visit>
void for_each_history_field(Visit visit) {
  HistoryFields<Visit> fields{visit};
  visit_fields<ErepsIteration>(fields);
}

inline py::dict history_out(const std::vector<ErepsIteration>& history) {
  py::dict out;
  for_each_history_field([&](const char* name, double ErepsIteration::* member) {
    py::array_t<double> column(static_cast<py::ssize_t>(history.size()));
    for (std::size_t i = 0; i < history.size(); ++i) column.mutable_data()[i] = history[i].*member;
    out[name] = column;
  });
  return out;
}

inline std::vector<ErepsIteration> history_in(const py::dict& arrays) {
  std::vector<ErepsIteration> out(py::len(arrays["reward_mean"]));
  for (std::size_t i = 0; i < out.size(); ++i) out[i].iteration = static_cast<int>(i) + 1;
  for_each_history_field([&](const char* name, double ErepsIteration::* member) {
    const VecX<double> column = vector_in("history", arrays[name], static_cast<long>(out.size()));
    for (std::size_t i = 0; i < out.size(); ++i) out[i].*member = column[static_cast<long>(i)];
  });
  return out;
}

}  // namespace diffnea::python
