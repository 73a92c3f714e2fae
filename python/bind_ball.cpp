/// A ball's path, as results of identification and diagnosis hold it.

#include <diffnea/identify/ball_series.hpp>

#include "bindings.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

py::array_t<int> integers(const std::vector<int>& x) {
  return py::array_t<int>(static_cast<py::ssize_t>(x.size()), x.data());
}

}  // namespace

void bind_ball(py::module_& m) {
  value_type<BallFlag>(m);
  using B = BallSeries;
  auto c = value_type<B>(m, {.to_dict = true});
  // Arrays where a list would be slow to compute with.
  redefine(c, "run", "NDArray[np.int32]", [](const B& b) { return integers(b.run); });
  redefine(c, "window", "NDArray[np.int32]", [](const B& b) { return integers(b.window); });
  redefine(c, "taut", "NDArray[np.bool_]", [](const B& b) { return array_out(b.taut); });
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
