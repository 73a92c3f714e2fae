/// A ball's path, as results of identification and diagnosis hold it.

#include <diffnea/identify/ball_series.hpp>

#include "bindings.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

py::array_t<int> integers(const std::vector<int>& x) {
  return py::array_t<int>(static_cast<py::ssize_t>(x.size()), x.data());
}

py::array_t<bool> booleans(const std::vector<bool>& x) {
  py::array_t<bool> out(static_cast<py::ssize_t>(x.size()));
  std::copy(x.begin(), x.end(), out.mutable_data());
  return out;
}

}  // namespace

void bind_ball(py::module_& m) {
  value_type<BallFlag>(m, "BallFlag",
                       "A row or flight that cannot be true; left out, but for rows beyond the "
                       "string's reach.",
                       field("run", &BallFlag::run, "Of the recording."),
                       field("time", &BallFlag::time, "[s]"),
                       field("channel", &BallFlag::channel, "``ball`` or ``spin``."),
                       field("reason", &BallFlag::reason, "Why, a sentence with numbers."));
  using B = BallSeries;
  auto c = value_type<B>(
      m, "BallSeries",
      "The ball's path as the camera saw it and as two models have it, row by row of those at "
      "which it was seen. Positions in the world [m].",
      field("held_out", &B::held_out, "Of the test recordings, else of those that were fitted."),
      field("has_string", &B::has_string, "The ball hangs on a string."),
      field("run", &B::run, "(M,) recording of each row, integers."),
      field("window", &B::window,
            "(M,) integers; each window starts from an estimated state of its own."),
      field("time", &B::time, "(M,) [s]"),
      field("measured", &B::measured, "(M, 3) as the camera saw it; NaN: not seen."),
      field("base", &B::base, "(M, 3) of the model before the fit, or without the causes."),
      field("extended", &B::extended, "(M, 3) of the model as fitted, or with the causes."),
      field("anchor", &B::anchor, "(M, 3) where the string is tied."),
      field("taut", &B::taut, "(M,) booleans: the string is taut in the extended model."),
      field("length", &B::length, "Of the extended model's string [m]."),
      field("sigma", &B::sigma, "Noise of one position along one axis [m]."),
      field("base_rms", &B::base_rms, "Error of one position along one axis, base model [m]."),
      field("extended_rms", &B::extended_rms, "The same of the extended model [m]."),
      field("flagged", &B::flagged,
            "Rows and flights that cannot be true, a list of :class:`BallFlag`."));
  // Arrays where a list would be slow to compute with.
  c.def_property_readonly(
      "run", [](const B& b) { return integers(b.run); }, "(M,) recording of each row, integers.");
  c.def_property_readonly(
      "window", [](const B& b) { return integers(b.window); },
      "(M,) integers; each window starts from an estimated state of its own.");
  c.def_property_readonly(
      "taut", [](const B& b) { return booleans(b.taut); },
      "(M,) booleans: the string is taut in the extended model.");
  c.def("__len__", &B::rows, "Rows.");
  c.def(
      "to_dict",
      [](const B& b) { return python_function("diffnea._ball", "to_dict")(b).cast<py::dict>(); },
      "The fields by name: arrays, numbers, and ``flagged`` as a list of dicts.");
  c.def(
      "plot",
      [](const B& b) { return python_function("diffnea._ball", "plot")(b, "before", "after"); },
      "Draw the path in space, the string's length, the error over the string's direction and "
      "over\ntime with matplotlib; return the figure.");
  def_to_frame(c, "The series as a pandas data frame, a row an instant.");
}

}  // namespace diffnea::python
