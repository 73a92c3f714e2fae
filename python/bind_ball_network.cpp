/// Networks of a ball: read, evaluated; PyTorch trains them (diffnea.blackbox).

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/runs/ball_network_file.hpp>

#include "arrays.hpp"
#include "bindings.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

/// One state a row. @return accelerations in L, and what the cells then remember
py::tuple evaluate(const BallNetwork& network, const py::object& inputs, const py::object& hidden) {
  const py::ssize_t rows = py::len(inputs);
  const RowMatX<double> x = matrix_in("BallNetwork: inputs", inputs, rows, kNetworkInputs);
  const int remembered = num_hidden(network);
  RowMatX<double> h = RowMatX<double>::Zero(x.rows(), remembered);
  if (!hidden.is_none()) h = matrix_in("BallNetwork: hidden", hidden, x.rows(), remembered);
  RowMatX<double> out(x.rows(), kNetworkOutputs);
  {
    const py::gil_scoped_release release;
    NetworkEvaluator<double> ask(network);
    for (long k = 0; k < x.rows(); ++k) {
      const Vec3<double> a = ask(x.row(k).data(), h.data() + k * remembered);
      out.row(k) << a.x, a.y, a.z;
    }
  }
  return py::make_tuple(array_out(out), array_out(h));
}

}  // namespace

void bind_ball_network(py::module_& m) {
  using N = BallNetwork;
  py::class_<N, std::shared_ptr<N>>(m, "_BallNetwork")
      .def(py::init([](const std::string& text, const std::string& source) {
             return std::make_shared<N>(ball_network_from_json(text, source));
           }),
           "text"_a, "source"_a)
      .def_static(
          "read",
          [](const std::filesystem::path& path) {
            return std::make_shared<N>(*read_ball_network(path));
          },
          "path"_a)
      .def_readonly("source", &N::source)
      .def_readonly("text", &N::text)
      .def_readonly("sha256", &N::sha256)
      .def_readonly("step", &N::step)
      .def_readonly("warm_up", &N::warm_up)
      .def("evaluate", &evaluate, "inputs"_a, "hidden"_a)
      .def(
          "save",
          [](const N& n, const std::filesystem::path& path) {
            write_file_atomically(path, n.text);
          },
          "path"_a)
      .def(py::pickle([](const N& n) { return py::make_tuple(n.text, n.source); },
                      [](const py::tuple& state) {
                        return std::make_shared<N>(ball_network_from_json(
                            py::cast<std::string>(state[0]), py::cast<std::string>(state[1])));
                      }));
}

}  // namespace diffnea::python
