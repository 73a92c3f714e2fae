#include <string>

#include <pybind11/pybind11.h>

#include "diffnea/version.hpp"

namespace py = pybind11;

PYBIND11_MODULE(_core, m) {
  m.doc() = "Compiled part of diffnea.";
  m.attr("__version__") = std::string(diffnea::version());
}
